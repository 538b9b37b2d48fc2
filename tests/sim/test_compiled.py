import ast
import shutil
from pathlib import Path

import pytest

from sim import blunt
from sim.compiled import SOURCES, source_stamp

SIM = Path(blunt.__file__).parent


def test_machine_code_is_kept_for_exactly_these_sources(tmp_path: Path) -> None:
    """(3.4) Kept code is used only while no file that holds compiled functions has changed, the caller's or another."""
    pytest.importorskip("numba")
    from sim import piece_fast, probe_fast

    for module in (blunt, piece_fast, probe_fast):
        stamps = {each._cache._cache_file._source_stamp for each in vars(module).values() if hasattr(each, "_cache")}
        assert stamps == {source_stamp(SIM)}
    for name in SOURCES:
        folder = tmp_path / name
        folder.mkdir()
        for each in SOURCES:
            shutil.copy(SIM / each, folder)
        assert source_stamp(folder) == source_stamp(SIM)
        with (folder / name).open("a") as file:
            file.write("# upgraded\n")
        assert source_stamp(folder) != source_stamp(SIM)


def test_every_file_with_compiled_functions_counts() -> None:
    """(3.4) No file uses `compiled` without being part of the stamp."""
    users = set()
    for path in SIM.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module == "sim.compiled":
                users.add(path.name)
    assert users == set(SOURCES)
