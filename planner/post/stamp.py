"""The stamp in the head of a program: for which control it was written and which point it drives.

`dnc send` reads it before a byte leaves: a program that drives the ball's centre at a control set up for the tip cuts
one radius too deep. Standard library only.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_NUMBER = rb"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e-?[0-9]{1,2})?(?![0-9.e-])"
_STAMP = re.compile(
    rb"DRIPMILL CONTROL=(?P<control>[a-z0-9-]+) REFERENCE=(?P<reference>tip|centre) R=(?P<radius>%b) "
    rb"T=(?P<tool>[0-9]{1,9}) D=(?P<edge>[0-9]{1,9}) TOLERANCE=(?P<tolerance>%b)(?: LIFT=(?P<lift>%b))?"
    % (_NUMBER, _NUMBER, _NUMBER)
)
_HEAD_BYTES = 4096


@dataclass(frozen=True, slots=True)
class Stamp:
    """What the head of a program says about it; lengths mm."""

    control: str
    reference: str
    radius_mm: float
    tool: int
    edge: int
    tolerance_mm: float
    lift_mm: float = 0.0

    def text(self) -> str:
        """The comment's words, without the dialect's comment signs."""
        lift = f" LIFT={self.lift_mm:g}" if self.lift_mm else ""
        return (
            f"DRIPMILL CONTROL={self.control} REFERENCE={self.reference} R={self.radius_mm:g} "
            f"T={self.tool} D={self.edge} TOLERANCE={self.tolerance_mm:g}{lift}"
        )


def read_stamp(head: bytes) -> Stamp | None:
    """The stamp in the first bytes of a program, or None where there is none.

    >>> read_stamp(b";" + Stamp("sinumerik-840d", "tip", 4.0, 2, 1, 0.001).text().encode()).reference
    'tip'
    """
    found = _STAMP.search(head[:_HEAD_BYTES])
    if found is None:
        return None
    return Stamp(
        control=found["control"].decode(),
        reference=found["reference"].decode(),
        radius_mm=float(found["radius"]),
        tool=int(found["tool"]),
        edge=int(found["edge"]),
        tolerance_mm=float(found["tolerance"]),
        lift_mm=float(found["lift"] or 0.0),
    )
