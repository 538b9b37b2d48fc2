"""The mill at the other end of the cable: receives bytes, interprets, moves, cuts and is measured."""
