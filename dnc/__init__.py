"""Streams programs to a control over RS-232, checks them, watches the machine and tells the operator."""
