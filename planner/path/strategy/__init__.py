"""Ways to lay passes over a part; each turns a surface and an operation's wishes into traced curves."""
