"""The dnc command; while its parts are loaded an interrupt ends it as it ends any program, without a word."""

import signal


def run() -> None:
    """Load the commands and run one."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from dnc.standard_streams import open_standard_streams

    open_standard_streams()
    from dnc.cli.main import run as run_command

    signal.signal(signal.SIGINT, before)
    run_command()


if __name__ == "__main__":
    run()
