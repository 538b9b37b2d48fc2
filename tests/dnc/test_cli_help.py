"""Every command explains itself with an example, without loading the heavy libraries (interface, section 1)."""

from __future__ import annotations

import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

from dnc.cli.main import program

COMMANDS = program.list_commands(click.Context(program))


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_an_example(name: str) -> None:
    result = CliRunner().invoke(program, [name, "--help"])
    assert result.exit_code == 0
    assert f"dnc {name}" in result.output.split("Example", 1)[-1]


def test_the_list_of_commands_is_not_cut_off() -> None:
    """(2.2) In 80 columns most said half a sentence: "Interpret PROGRAM without moving anything and list..."."""
    shown = CliRunner().invoke(program, ["--help"], terminal_width=80).output.split("Commands:", 1)[1]
    lines = shown.strip().splitlines()
    assert len(lines) == len(COMMANDS)
    assert not [line for line in lines if "..." in line]


def test_help_loads_nothing_heavy() -> None:
    script = (
        "import sys\nfrom click.testing import CliRunner\nfrom dnc.cli.main import program\n"
        f"for name in {COMMANDS!r}:\n    CliRunner().invoke(program, [name, '--help'])\n"
        "print(sorted({'numpy', 'scipy', 'textual', 'matplotlib', 'pymodbus', 'numba'} & set(sys.modules)))\n"
    )
    shown = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout
    assert shown.strip() == "[]"
