"""Modal groups: which codes exclude one another in a block and replace one another over blocks (membership only).

Group numbers and members follow the list of G functions of the SINUMERIK 840D programming manual.
"""

from __future__ import annotations

from enum import IntEnum
from types import MappingProxyType


class ModalGroup(IntEnum):
    """A group of codes, with its number on the control."""

    MOTION = 1
    ONE_SHOT = 2
    FRAME = 3
    FIFO = 4
    PLANE = 6
    COMPENSATION = 7
    WORK_OFFSET = 8
    SUPPRESSION = 9
    PATH_MODE = 10
    EXACT_STOP_ONCE = 11
    EXACT_STOP_WINDOW = 12
    UNITS = 13
    DIMENSION = 14
    FEED_TYPE = 15
    FEED_CORRECTION = 16
    APPROACH = 17
    CORNER = 18
    SPLINE_START = 19
    SPLINE_END = 20
    ACCELERATION = 21
    OFFSET_TYPE = 22
    COLLISION = 23
    FEED_FORWARD = 24
    WORKING_AREA = 28
    DIAMETER = 29
    COMPRESSOR = 30
    FEED_PROFILE = 37
    PRECISION = 39
    LANGUAGE = 47
    RAPID_PATH = 55
    CORNER_FEED = 57
    DYNAMICS = 59


_MEMBERS: dict[ModalGroup, str] = {
    ModalGroup.MOTION: "G0 G1 G2 G3 CIP CT ASPLINE BSPLINE CSPLINE POLY G33 G34 G35 G331 G332",
    ModalGroup.ONE_SHOT: "G4 G63 G74 G75 G28 REPOSL REPOSQ REPOSH",
    ModalGroup.FRAME: "TRANS ATRANS ROT AROT SCALE ASCALE MIRROR AMIRROR ROTS AROTS G25 G26 G58 G59 G110 G111 G112",
    ModalGroup.FIFO: "STARTFIFO STOPFIFO FIFOCTRL",
    ModalGroup.PLANE: "G17 G18 G19",
    ModalGroup.COMPENSATION: "G40 G41 G42",
    ModalGroup.WORK_OFFSET: "G500 G54 G55 G56 G57 " + " ".join(f"G{number}" for number in range(505, 600)),
    ModalGroup.SUPPRESSION: "G53 G153 SUPA",
    ModalGroup.PATH_MODE: "G60 G64 G641 G642 G643 G644 G645",
    ModalGroup.EXACT_STOP_ONCE: "G9",
    ModalGroup.EXACT_STOP_WINDOW: "G601 G602 G603",
    ModalGroup.UNITS: "G70 G71 G700 G710",
    ModalGroup.DIMENSION: "G90 G91",
    ModalGroup.FEED_TYPE: "G93 G94 G95 G96 G97 G961 G971",
    ModalGroup.FEED_CORRECTION: "CFC CFTCP CFIN",
    ModalGroup.APPROACH: "NORM KONT KONTT KONTC",
    ModalGroup.CORNER: "G450 G451",
    ModalGroup.SPLINE_START: "BNAT BTAN BAUTO",
    ModalGroup.SPLINE_END: "ENAT ETAN EAUTO",
    ModalGroup.ACCELERATION: "BRISK SOFT DRIVE",
    ModalGroup.OFFSET_TYPE: "CUT2D CUT2DF CUT3DC CUT3DF",
    ModalGroup.COLLISION: "CDOF CDON CDOF2",
    ModalGroup.FEED_FORWARD: "FFWOF FFWON",
    ModalGroup.WORKING_AREA: "WALIMON WALIMOF",
    ModalGroup.DIAMETER: "DIAMOF DIAMON DIAM90",
    ModalGroup.COMPRESSOR: "COMPOF COMPON COMPCURV COMPCAD COMPSURF",
    ModalGroup.FEED_PROFILE: "FNORM FLIN FCUB",
    ModalGroup.PRECISION: "CPRECOF CPRECON",
    ModalGroup.LANGUAGE: "G290 G291",
    ModalGroup.RAPID_PATH: "RTLION RTLIOF",
    ModalGroup.CORNER_FEED: "FENDNORM G62 G621",
    ModalGroup.DYNAMICS: "DYNNORM DYNPOS DYNROUGH DYNSEMIFIN DYNFINISH",
}

GROUP_OF: MappingProxyType[str, ModalGroup] = MappingProxyType(
    {code: group for group, members in _MEMBERS.items() for code in members.split()}
)
