"""Blocks out of the control's ring: each byte leaves it once, whole blocks or halves (5.8)."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from sim.block_reader import BlockReader


@given(st.lists(st.binary(max_size=12).map(lambda data: data.replace(b"\0", b"")), max_size=40))
def test_every_block_comes_whole_and_every_byte_leaves_once(pieces: list[bytes]) -> None:
    reader, blocks, taken_bytes = BlockReader(), [], 0
    for number, piece in enumerate([*pieces, b"\n"], 1):
        reader.hear(piece)
        while (block := reader.block()) is not None:
            blocks.append(block)
        taken_bytes += reader.taken()
        assert reader.ring_bytes == 0
        assert taken_bytes == sum(map(len, [*pieces, b"\n"][:number]))
    assert blocks == b"".join([*pieces, b"\n"]).split(b"\n")[:-1]


def test_a_block_without_an_end_is_held_up_to_a_limit() -> None:
    reader = BlockReader()
    reader.hear(b"X" * 5000)
    assert reader.block() is None
    assert (reader.taken(), reader.ring_bytes) == (4096, 904)
    reader.hear(b"\nY1\n")
    assert (reader.block(), reader.block(), reader.block()) == (b"X" * 5000, b"Y1", None)
    assert (reader.taken(), reader.ring_bytes) == (908, 0)


def test_blank_tape_is_passed_over_before_a_block_only() -> None:
    reader = BlockReader()
    reader.hear(b"\0\0X1")
    reader.skip_nuls()
    assert (reader.taken(), reader.ring_bytes) == (2, 2)
    assert reader.block() is None
    reader.skip_nuls()
    reader.hear(b"\0Y2\n\0")
    reader.skip_all()
    assert (reader.taken(), reader.ring_bytes) == (7, 0)
    reader.hear(b"Z")
    reader.forget()
    assert (reader.taken(), reader.ring_bytes) == (0, 0)
