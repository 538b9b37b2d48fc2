"""The whole chain in one command: what was planned is what the mill measured (1.6)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dnc.demo_screen import demo_screen
from tests.helpers.schemas import validated

PATH_MM, SCALLOP_MM, ROUNDING_MM = 0.001, 0.08, 0.0001


@pytest.mark.system
def test_demo_measures_what_was_planned(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dnc", "demo", "--out", str(tmp_path), "--speed", "100", "--json"]
    shop = {"DNC_HANDSHAKE": "rtscts", "DNC_START": "wait-xon", "DNC_FORMAT": "7E2"}  # meant for its own cables
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **shop})
    assert done.returncode == 0, done.stderr
    report = validated(done.stdout)
    parts = (report[name] for name in ("plan", "check", "send", "mill", "simulate"))
    for part in (*parts, *report["window"].values()):
        if isinstance(part, dict):
            validated(json.dumps(part))
    assert report == json.loads((tmp_path / "report.json").read_text())
    measured, plan, mill = report["simulate"], report["plan"], report["mill"]
    assert SCALLOP_MM - 2 * (PATH_MM + ROUNDING_MM) <= measured["scallop_mm"] <= SCALLOP_MM
    assert measured["gouge_mm"] <= PATH_MM
    assert measured["coverage"] == 1.0
    assert measured["machining_time_s"] == pytest.approx(plan["machining_time_s"], rel=0.01)
    assert report["send"]["sha256"] == mill["sha256"]
    assert mill["overrun_bytes"] == 0
    assert mill["time_scale"] == 100.0
    assert report["window"]["mill"]["time_scale"] == 1.0
    assert report["window"]["send"]["xoff_count"] >= 1
    for name in ("part.mpf", "motion.csv", "paths.png", "deviation.png"):
        assert (tmp_path / name).stat().st_size > 1000
    screen = demo_screen(report, tmp_path)
    assert screen.startswith("SIMULATED")
    assert "100 times as fast as life (scaled figures)" in screen
    report["window"]["mill"] |= {"overshoot_bytes_max": 25, "hold_up_s_max": 0.0123}
    busy = demo_screen(report, tmp_path)
    assert "the mill itself was late by up to 12 ms" in busy
    assert max(map(len, (screen + busy).splitlines())) <= max(80, len(str(tmp_path)) + 6)
