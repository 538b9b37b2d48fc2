"""Lets `python -m dnc` be the dnc command."""

from dnc.cli.main import run

run()
