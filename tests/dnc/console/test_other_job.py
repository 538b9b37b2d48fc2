"""What belongs to one job is not taken for another's: questions of the console (2.2; fault O6), the mill's status."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from dnc.console.rows import text_of
from sim.endpoint_modbus import ModbusEnd
from sim.panel import Panel
from tests.dnc.console.test_app import console, published, until


@pytest.mark.parametrize(("question", "answer", "what"), [("f8", "a", "abort"), ("f5", "enter", "resume")])
async def test_an_answer_does_not_go_to_the_next_job(tmp_path: Path, question: str, answer: str, what: str) -> None:
    """The job ended while the question stood, another port's was shown, and the answer aborted that one."""
    app = console(tmp_path)
    async with app.run_test(headless=True, size=(80, 24)) as pilot, published(tmp_path) as first:
        first.snapshot.update(job="20261122T000000-1", state="SENDING")
        await until(pilot, app, lambda text: "SENDING" in text)
        await pilot.press(question)
        await until(pilot, app, lambda text: f"{what.upper()}?" in text)
        first.snapshot.update(job="20261122T000001-2", state="PAUSED")
        await until(pilot, app, lambda text: "PAUSED" in text)
        await pilot.press(answer)
        text = await until(pilot, app, lambda text: f"no {what}" in text)
        assert "another job is shown now" in text
        assert first.orders == []
        await pilot.press("space")
        await first.is_asked.wait()
        assert "another job" not in text_of(app.face)


async def test_a_rehearsal_is_not_shown_with_the_status_of_another_mill(tmp_path: Path) -> None:
    """(2.2) Two rehearsals at once: one job stood beside the other mill's "control at N10"."""
    end = ModbusEnd("127.0.0.1", 0)
    end.show(Panel(block=27))
    end.start()
    app = console(tmp_path, end.port)
    async with published(tmp_path) as job, app.run_test(headless=True, size=(80, 24)) as pilot:
        job.snapshot.update(mill_modbus=f"127.0.0.1:{end.port}")
        await until(pilot, app, lambda text: "control at N27" in text)
        job.snapshot.update(mill_modbus="127.0.0.1:1")
        text = await until(pilot, app, lambda text: "modbus UNAVAILABLE" in text)
        assert "control at N27" not in text
    await asyncio.to_thread(end.stop)
