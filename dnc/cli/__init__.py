"""One file per command of the dnc program."""
