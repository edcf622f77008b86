"""Values that no argument accepts: what users hand over by mistake."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from mbrs.model.model import Model
from scenes import FakeLaw

JUNK = [
    *(
        None,
        "",
        "x",
        "ground",
        b"x",
        object(),
        math.nan,
        -math.inf,
        1j,
        True,
        10**400,
        1e308,
        -0.0,
        5e-324,
        Fraction(1, 3),
    ),
    *([], {}, set(), (1, 2), [[1, 2], [3]], [[[]]], {"x": 1}, {"x": FakeLaw(1)}, range(3), iter([1, 2, 3]), lambda: 1),
    *(np.zeros((0, 3)), np.array(None), np.array("x"), np.full((3, 3), np.nan), np.zeros((2, 3)), np.eye(6) * 1j),
    *(np.array([1, None, "x"], dtype=object), np.float32(2), np.int8(3), np.bool_(True), np.datetime64("2020-01-01")),
    *(Model, Model("other"), Model("other").parameter("p", 1.0), Model("other").parameter("P", [1.0, 2.0, 3.0])),
    *((1e308,) * 3, (1e-320,) * 3, ((0, 0, 0), None), (None, None), ((1, 2, 3), (1, 2, 3)), "a\0b", "\ud800"),
]
