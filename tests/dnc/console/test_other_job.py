"""A question of the console belongs to the job that was shown when it was asked (2.2; fault O6)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc.console.rows import text_of
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
