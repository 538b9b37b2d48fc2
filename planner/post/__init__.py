"""The only room where geometry and language meet: a tool path becomes a program."""
