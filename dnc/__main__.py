"""The dnc command; while its parts are loaded an interrupt ends it as it ends any program, without a word."""

import os
import signal
import sys


def run() -> None:
    """Load the commands and run one."""
    _open_standard_streams()
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from dnc.cli.main import run as run_command

    signal.signal(signal.SIGINT, before)
    run_command()


def _open_standard_streams() -> None:
    """The null device for those that are closed: a port would get their number, and messages would go to the mill."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w"))


if __name__ == "__main__":
    run()
