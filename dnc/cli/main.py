"""The dnc program: finds the command, runs it, turns every error into one sentence and its exit code."""

from __future__ import annotations

import contextlib
import difflib
import errno
import importlib
import os
import pkgutil
import signal
import sys
import traceback

import click

import dnc.cli
from dnc.places import state_folder
from planner.errors import ExitCode, UserError

_HIDDEN = {"main"}
_FULL = (errno.ENOSPC, errno.EDQUOT)
_SURROUNDINGS = (*_FULL, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR)
_NOT_BUILT = {"serve", "web", "compare", "config"}


def _command_names() -> list[str]:
    names = (found.name for found in pkgutil.iter_modules(dnc.cli.__path__))
    return sorted(name.replace("_", "-") for name in names if name not in _HIDDEN and not name.startswith("_"))


class _Commands(click.Group):
    """Loads a command's file only when it is asked for, so that `dnc send` stays light."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of the files of this package, as commands."""
        del ctx
        return _command_names()

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name, its file imported now; UsageError for a name that is reserved or unknown."""
        if cmd_name in _NOT_BUILT:
            raise click.UsageError(f"{cmd_name} is not built yet", ctx)
        known = self.list_commands(ctx)
        if cmd_name not in known:
            near = difflib.get_close_matches(cmd_name, known, n=1)
            raise click.UsageError(
                f"no such command {cmd_name!r}" + (f"; did you mean {near[0]}?" if near else ""), ctx
            )
        module = importlib.import_module(f"dnc.cli.{cmd_name.replace('-', '_')}")
        command = module.command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that is to run; what the settings say becomes the default of its options."""
        name, command, rest = super().resolve_command(ctx, args)
        is_help = bool(rest) and set(rest) <= set(ctx.help_option_names)
        if command is not None and name is not None and not is_help:
            from dnc.settings import load_settings

            said = load_settings()
            keys = {param.name: str(param.envvar).removeprefix("DNC_").lower() for param in command.params}
            ctx.default_map = {name: {one: said[key] for one, key in keys.items() if key in said}}
        return name, command, rest


@click.command(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="dripmill", prog_name="dnc")
def program() -> None:
    """Plan, check, rehearse and drip-feed finishing programs to a mill over RS-232.

    No key of this program is an emergency stop.
    """


def run() -> None:
    """Entry point of the `dnc` command; never shows a traceback for bad input."""
    # Our matrices are small: threads of the linear algebra would only compete with the mill and the line.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(run_with(sys.argv[1:]))


def run_with(arguments: list[str]) -> int:
    """Run one command line and return its exit code (interface, section 6)."""
    try:
        result = program.main(args=arguments, prog_name="dnc", standalone_mode=False)
    except UserError as error:
        _complain(str(error))
        return int(error.exit_code)
    except click.exceptions.Abort:
        _complain("interrupted")
        return 130
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return int(ExitCode.USAGE)
    except click.BadParameter as error:
        variable = _variable(error)
        of_variable = f"{variable}: {error.message.rstrip('.')}; mend or unset it"
        _complain(of_variable if variable else _usage_sentence(error, arguments))
        return int(ExitCode.SETTINGS if variable else ExitCode.USAGE)
    except click.ClickException as error:
        _complain(_usage_sentence(error, arguments))
        return int(ExitCode.USAGE)
    except SystemExit:  # click leaves so when nobody reads our output any more
        return 128 + signal.SIGPIPE
    except OSError as error:
        return _refused_by_system(error) if error.errno in _SURROUNDINGS else _internal_fault(error)
    except Exception as error:  # noqa: BLE001 (the rim: a fault of ours becomes one sentence and a file to report)
        return _internal_fault(error)
    return result if isinstance(result, int) else 0


def _variable(error: click.BadParameter) -> str | None:
    """The environment variable that the refused value is from, if it is from one."""
    if error.ctx is None or error.param is None or error.param.name is None:
        return None
    source = error.ctx.get_parameter_source(error.param.name)
    return str(error.param.envvar) if source is click.core.ParameterSource.ENVIRONMENT else None


def _usage_sentence(error: click.ClickException, arguments: list[str]) -> str:
    """What is wrong with the command line, and whose help tells how it is meant; click does not always know whose."""
    what = error.format_message().rstrip(".").replace("\n", " ")
    context = error.ctx if isinstance(error, click.UsageError) else None
    joint = " " if what.endswith("?") else "; "
    command = f"dnc {arguments[0]}" if arguments and arguments[0] in _command_names() else "dnc"
    return f"{what[:1].lower()}{what[1:]}{joint}see {context.command_path if context else command} --help"


def _complain(what: str) -> None:
    """One line on stderr, whatever the names in it hold."""
    from dnc.progress import printable

    click.echo(f"dnc: {printable(what)}", err=True)


def _refused_by_system(error: OSError) -> int:
    """A full disk behind stdout or behind a file of ours, a folder that may not be looked into, a name too long.

    Not 3, which says that a program was refused: the surroundings must be mended, not the program.
    """
    from dnc.progress import silence_output

    silence_output()
    if error.errno in _FULL:
        what = f"{error.filename or 'the output'} cannot be written: {error.strerror}"
        _complain(f"{what}; free some space and run it again")
    else:
        _complain(f"{error.filename or 'a file'}: {error.strerror}; check the name and the rights")
    return int(ExitCode.SETTINGS)


def _internal_fault(error: Exception) -> int:
    where = ""
    with contextlib.suppress(OSError, UserError):
        place = state_folder() / "fault.txt"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text("".join(traceback.format_exception(error)))
        where = f"; details are in {place}, please report them"
    _complain(f"internal fault: {type(error).__name__}: {error}{where}")
    return int(ExitCode.INTERNAL)
