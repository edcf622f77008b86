"""The accuracy with which a file draws its model, from the digits of its numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence

# Numbers with fewer significant digits than these are meant as they stand (0.25, 1.5); with more, they were cut off (0.70711), and by up
# to half a unit of their last digit. Too small: loops of exact files become doubtful. Too large: linkages with seven digits lock. Pinned by
# tests/io/test_mjcf.py.
_CUT = 5
# The largest accuracy that is concluded from digits, of lengths over the size and of angles. Pinned by tests/io/test_mjcf.py.
LARGEST = 1e-3
_DECIMALS = re.compile(r"[+-]?([0-9]*)\.?([0-9]*)(?:[eE]([+-]?[0-9]+))?")
_LENGTHS = frozenset(("pos", "anchor", "fromto", "xyz"))
_DIRECTIONS = frozenset(("axis", "quat", "xyaxes", "zaxis"))
_ANGLES = frozenset(("euler", "rpy"))


def half_unit(word: str) -> float:
    """Half a unit of the last digit of a number that was cut off; 0 of one that was not."""
    found = _DECIMALS.fullmatch(word)
    if found is None or len((found[1] + found[2]).strip("0")) < _CUT:
        return 0.0
    exponent = min(max(int(found[3] or 0), -300), 300)
    return 0.5 * 10.0 ** max(exponent - len(found[2]), -300)


class Accuracy:
    """The coarsest half units of lengths (m), of directions and of angles (as in the file)."""

    def __init__(self) -> None:
        self.length = self.direction = self.angle = 0.0

    def note(self, key: str, words: Sequence[str], values: Sequence[float]) -> None:
        """Take the numbers of an attribute into account."""
        coarsest = max((half_unit(w) for w in words), default=0.0)
        if key in _LENGTHS:
            self.length = max(self.length, coarsest)
        elif key in _DIRECTIONS:
            size = max(abs(v) for v in values)
            self.direction = max(self.direction, coarsest / size if size > 0.0 else 0.0)
        elif key in _ANGLES:
            self.angle = max(self.angle, coarsest)

    def tolerance(self, size: float, unit: float) -> float:
        """Three half units, of lengths over ``size`` (m) and of angles (``unit``: rad of one unit of the file), at most `LARGEST`."""
        length = self.length / size if size > 0.0 else 0.0
        return min(3.0 * max(length, self.direction, self.angle * unit), LARGEST)
