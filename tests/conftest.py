"""What holds for all tests: nothing is skipped in CI (1.1), nothing is written where a user keeps his records."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator

import pytest

from dnc import locks
from tests.helpers.line import RUNTIME_FOLDERS


@pytest.fixture(autouse=True, scope="session")
def _records_apart(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Journal, job records and fault files of all commands go to a folder of this run; sockets' folders are removed.

    The number of a pty that is gone goes to the next one asked for, in another worker perhaps, before its lock is given
    back: each worker locks its own.
    """
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))
    locks.LOCK_FOLDER = tmp_path_factory.mktemp("lock")
    yield
    for folder in RUNTIME_FOLDERS:
        shutil.rmtree(folder, ignore_errors=True)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> object:
    report: pytest.TestReport = yield
    if report.skipped and os.environ.get("CI") and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid} was skipped in CI: {report.longrepr}"
    return report
