"""Findings about a program before any byte leaves."""
