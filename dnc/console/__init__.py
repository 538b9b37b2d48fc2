"""The operator's console in the terminal."""
