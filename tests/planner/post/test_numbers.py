"""Decimal texts."""

from __future__ import annotations

from decimal import Decimal

from hypothesis import given
from hypothesis import strategies as st

from planner.gcode.words import decimal_text


@given(st.integers(-(10**12), 10**12), st.integers(0, 9))
def test_text_is_exact_and_bare(units: int, decimals: int) -> None:
    """Nothing is lost, and no zero or point stands that could be left out (6.8)."""
    text = decimal_text(units, decimals)
    assert Decimal(text) == Decimal(units).scaleb(-decimals)
    assert not ("." in text and text.endswith(("0", ".")))
    assert not text.lstrip("-").startswith("0") or text == "0"


@given(st.integers(-(10**6), 10**6), st.integers(0, 4))
def test_point_forced(units: int, decimals: int) -> None:
    assert "." in decimal_text(units, decimals, keeps_point=True)
