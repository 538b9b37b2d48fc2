"""The three lists: what is acted on, what is accepted without effect, and what the interpreter refuses.

Every code of the language's modal groups, every M function and every address stands in exactly one list; anything
else is an alarm as an unknown word.
"""

from __future__ import annotations


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


ACTED_CODES = _words(
    """
    G0 G1 G2 G3 CIP CT ASPLINE BSPLINE CSPLINE POLY
    G4 G28 G74 G75
    TRANS ATRANS ROT AROT SCALE ASCALE MIRROR AMIRROR G25 G26 G58 G59
    G17 G18 G19 G40 G41 G42 G450 G451
    G500 G54 G55 G56 G57 G53 G153 SUPA
    G60 G64 G641 G642 G643 G644 G645 G9
    G70 G71 G700 G710 G90 G91 G93 G94 G95
    CFC CFTCP CFIN
    BNAT BTAN BAUTO ENAT ETAN EAUTO
    BRISK SOFT DRIVE
    WALIMON WALIMOF
    """
) | frozenset(f"G{number}" for number in range(505, 600))

IGNORED_CODES: dict[str, str] = {
    "STARTFIFO": "the buffer is the mill's own",
    "STOPFIFO": "the buffer is the mill's own",
    "FIFOCTRL": "the buffer is the mill's own",
    "G601": "one exact-stop window is modelled",
    "G602": "one exact-stop window is modelled",
    "G603": "one exact-stop window is modelled",
    "NORM": "compensation always approaches on the normal",
    "CUT2D": "compensation in the plane is the only one",
    "CDOF": "collision detection is not modelled",
    "CDON": "collision detection is not modelled",
    "CDOF2": "collision detection is not modelled",
    "FFWON": "axes follow without lag",
    "FFWOF": "axes follow without lag",
    "DIAMOF": "radius programming is the only one",
    "COMPOF": "straight blocks stay straight",
    "COMPON": "straight blocks stay straight; the compressor may deviate by its tolerance",
    "COMPCURV": "straight blocks stay straight; the compressor may deviate by its tolerance",
    "COMPCAD": "straight blocks stay straight; the compressor may deviate by its tolerance",
    "COMPSURF": "straight blocks stay straight; the compressor may deviate by its tolerance",
    "FNORM": "the feed of a block holds over its length",
    "FLIN": "the feed of a block holds over its length, not rising to it",
    "FCUB": "the feed of a block holds over its length, not rising to it",
    "CPRECOF": "contours are followed without error",
    "CPRECON": "contours are followed without error",
    "RTLION": "rapids run straight here",
    "RTLIOF": "rapids run straight here",
    "FENDNORM": "corners do not slow the programmed feed",
    "G62": "corners do not slow the programmed feed",
    "G621": "corners do not slow the programmed feed",
    "DYNNORM": "the machine has one set of accelerations",
    "DYNPOS": "the machine has one set of accelerations",
    "DYNROUGH": "the machine has one set of accelerations",
    "DYNSEMIFIN": "the machine has one set of accelerations",
    "DYNFINISH": "the machine has one set of accelerations",
    "G290": "the language is SINUMERIK already",
}

REFUSED_CODES: dict[str, str] = {
    "G33": "thread cutting",
    "G34": "thread cutting",
    "G35": "thread cutting",
    "G331": "rigid tapping",
    "G332": "rigid tapping",
    "G63": "tapping with a floating chuck",
    "REPOSL": "repositioning to the contour",
    "REPOSQ": "repositioning to the contour",
    "REPOSH": "repositioning to the contour",
    "ROTS": "rotation by solid angles",
    "AROTS": "rotation by solid angles",
    "G110": "polar coordinates",
    "G111": "polar coordinates",
    "G112": "polar coordinates",
    "G96": "constant cutting speed",
    "G97": "constant cutting speed",
    "G961": "constant cutting speed",
    "G971": "constant cutting speed",
    "KONT": "compensation that travels round the contour",
    "KONTT": "compensation that travels round the contour",
    "KONTC": "compensation that travels round the contour",
    "CUT2DF": "compensation in a rotated frame",
    "CUT3DC": "compensation in space",
    "CUT3DF": "compensation in space",
    "DIAMON": "diameter programming",
    "DIAM90": "diameter programming",
    "G291": "the ISO dialect",
}

ACTED_M = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 17, 30})
IGNORED_M: dict[int, str] = {
    19: "the spindle's angle is not modelled",
    40: "gear stages are not modelled",
    41: "gear stages are not modelled",
    42: "gear stages are not modelled",
    43: "gear stages are not modelled",
    44: "gear stages are not modelled",
    45: "gear stages are not modelled",
    70: "axis mode of the spindle is not modelled",
}

ACTED_ADDRESSES = _words(
    """
    X Y Z I J K I1 J1 K1 X1 Y1 Z1 F S T D L P CR AR TURN RPL PL PW SD PO ADIS CTOL FP
    MSG FGROUP EXTCALL CALL
    """
)
IGNORED_ADDRESSES: dict[str, str] = {
    "H": "auxiliary functions go to the machine's own logic",
    "ADISPOS": "rapids are not rounded",
    "OTOL": "there are no orientation axes",
    "ATOL": "axis tolerances are not modelled apart from CTOL",
    "SPOS": "the spindle's angle is not modelled",
    "SPLINEPATH": "splines run in X, Y and Z, which is the default",
    "STOPRE": "blocks take effect in order, so there is nothing to wait for",
    "POLYPATH": "polynomials apply to all axes, which is the default",
    "SPATH": "all axes follow the path",
    "UPATH": "all axes follow the path",
    "CYCLE832": "high-speed settings are not modelled",
    "WORKPIECE": "the blank is for the control's own picture",
    "GROUP_BEGIN": "groups are for the control's editor",
    "GROUP_END": "groups are for the control's editor",
    "TRAFOOF": "no transformation is active",
    "SETMS": "there is one spindle",
    "DISPLOF": "nothing is displayed",
    "DISPLON": "nothing is displayed",
}
NOT_MODELLED = "is not modelled"
"""What alarms say of words that a real control knows."""
_CYCLES = "CYCLE800 CYCLE801 POCKET1 POCKET2 POCKET3 POCKET4 SLOT1 SLOT2 LONGHOLE HOLES1 HOLES2"
REFUSED_WORDS: dict[str, str] = {
    **dict.fromkeys("ABCUVW", "a further axis"),
    "FPO": "a feed polynomial",
    "RND": "rounding between contour blocks",
    "RNDM": "rounding between contour blocks",
    "CHF": "a chamfer between contour blocks",
    "CHR": "a chamfer between contour blocks",
    "ANG": "a contour by angles",
    "AP": "polar coordinates",
    "RP": "polar coordinates",
    "LIMS": "constant cutting speed",
    "TRAORI": "a transformation",
    "TRANSMIT": "a transformation",
    "TRACYL": "a transformation",
    "MCALL": "a modal call",
    **dict.fromkeys([*(f"CYCLE{number}" for number in range(71, 90)), *_CYCLES.split()], "a machining cycle"),
}
"""Addresses, functions and calls of the language that are refused by name."""
_MOVES = frozenset(
    {
        "rounding between contour blocks", "a chamfer between contour blocks", "a contour by angles",
        "polar coordinates", "a transformation", "a modal call", "a machining cycle",
    }
)  # fmt: skip
"""What makes moves of its own: to leave such a word out would leave out material."""


def refusal_of(word: str) -> str | None:
    """Why a word of the language is refused, as a sentence, or None where it is not."""
    reason = REFUSED_WORDS.get(word)
    if reason is None:
        return None
    remedy = "write out the moves that it makes" if reason in _MOVES else "leave it out"
    return f"{word} ({reason}) {NOT_MODELLED}; {remedy}"
