"""Constraint rows and free coordinates of each type of joint, as tables.

A row names a function of the relative pose, whose value and slope `joints` has: ("u", i, 0) a translation, ("dot", i, j) the product
A_i . B_j, ("stretch", 0, 0) the distance, ("angle", Z, 0) and ("beta", X, 0) angles, ("log", i, 0) the rotation vector, ("thread", 0, 0),
("disc", k, 0) and ("knife", 0, 0) the conditions of a screw, a rolling disc and a blade.
"""

from __future__ import annotations

X, Y, Z = 0, 1, 2
Row = tuple[str, int, int]


def _rows(translations: str, products: str = "") -> list[Row]:
    index = "xyz".index
    rows: list[Row] = [("u", index(t), 0) for t in translations]
    return rows + [("dot", index(p[0]), index(p[1])) for p in products.split()]


CONSTRAINTS: dict[str, list[Row]] = {
    "fixed": _rows("xyz", "xz yz yx"),
    "revolute": _rows("xyz", "xz yz"),
    "prismatic": _rows("xy", "xz yz yx"),
    "cylindrical": _rows("xy", "xz yz"),
    "universal": _rows("xyz", "zx"),
    "spherical": _rows("xyz"),
    "planar": _rows("z", "xz yz"),
    "free": [],
    "distance": [("stretch", 0, 0)],
    "knife_edge": [],
    "rolling_disc": [("disc", 0, 0)],
    "point_on_line": _rows("xy"),
    "screw": [*_rows("xy", "xz yz"), ("thread", 0, 0)],
}
# rows that restrict velocities only
VELOCITY_CONSTRAINTS: dict[str, list[Row]] = {
    "knife_edge": [("knife", 0, 0)],
    "rolling_disc": [("disc", 1, 0), ("disc", 2, 0)],
}

ANGLE: Row = ("angle", Z, 0)
LOG: list[Row] = [("log", i, 0) for i in range(3)]
# free coordinates: those of trees, of springs and laws, of drives
FREE: dict[str, list[Row]] = {
    "revolute": [ANGLE],
    "prismatic": _rows("z"),
    "cylindrical": [*_rows("z"), ANGLE],
    "universal": [ANGLE, ("beta", X, 0)],
    "spherical": LOG,
    "planar": [*_rows("xy"), ANGLE],
    "free": [*_rows("xyz"), *LOG],
    "screw": [ANGLE],
    "point_on_line": _rows("z"),
    "bushing": [*_rows("xyz"), *LOG],
    "torsion": [ANGLE],
    "spring_damper": [("stretch", 0, 0)],
} | {kind: [] for kind in ("fixed", "distance", "knife_edge", "rolling_disc", "drive", "coupler", "modal")}


def coordinate_name(kind: str, row: Row) -> str:
    """The ending of a tree coordinate's name."""
    if row[0] in ("u", "log"):
        return ("r" if row[0] == "log" else "") + "xyz"[row[1]]
    return "beta" if row[0] == "beta" else "alpha" if kind == "universal" else "rz"


def is_length(row: Row) -> bool:
    """True for rows in metres; products of axes and angles have no unit."""
    return row[0] not in ("dot", "angle", "beta", "log")
