"""Constraint rows and free coordinates of each type of joint, as tables."""

from __future__ import annotations

X, Y, Z = 0, 1, 2
Row = tuple[str, int, int]  # ("u", i, 0) translation, ("dot", i, j) = A_i . B_j, ("distance", 0, 0), ("knife", 0, 0)


def _rows(translations: str, products: str) -> list[Row]:
    index = "xyz".index
    rows: list[Row] = [("u", index(t), 0) for t in translations]
    return rows + [("dot", index(p[0]), index(p[1])) for p in products.split()]


CONSTRAINTS: dict[str, list[Row]] = {
    "fixed": _rows("xyz", "xz yz yx"),
    "revolute": _rows("xyz", "xz yz"),
    "prismatic": _rows("xy", "xz yz yx"),
    "cylindrical": _rows("xy", "xz yz"),
    "universal": _rows("xyz", "zx"),
    "spherical": _rows("xyz", ""),
    "planar": _rows("z", "xz yz"),
    "free": [],
    "distance": [("distance", 0, 0)],
    "knife_edge": [],
    "rolling_disc": [("disc", 0, 0)],
    "point_on_line": _rows("xy", ""),
    "screw": [*_rows("xy", "xz yz"), ("thread", 0, 0)],
}
# rows that restrict velocities only
VELOCITY_CONSTRAINTS: dict[str, list[Row]] = {
    "knife_edge": [("knife", 0, 0)],
    "rolling_disc": [("disc", 1, 0), ("disc", 2, 0)],
}


def imposed_row(kind: str, coordinate: int) -> Row:
    """The row of a drive on a joint's free coordinate."""
    for what, i in FREE[kind]:
        n = 3 if what == "log" else 1
        if coordinate < n:
            return (what, coordinate if what == "log" else i, 0)
        coordinate -= n
    raise IndexError(f"a {kind} joint has no such coordinate")


# free coordinates for forces: ("u", i), ("angle", Z), ("beta", X), ("log", 0); the last means three
FREE: dict[str, list[tuple[str, int]]] = {
    "fixed": [],
    "revolute": [("angle", Z)],
    "prismatic": [("u", Z)],
    "cylindrical": [("u", Z), ("angle", Z)],
    "universal": [("angle", Z), ("beta", X)],
    "spherical": [("log", 0)],
    "planar": [("u", X), ("u", Y), ("angle", Z)],
    "free": [("u", X), ("u", Y), ("u", Z), ("log", 0)],
    "distance": [],
    "knife_edge": [],
    "rolling_disc": [],
    "screw": [("angle", Z)],
    "point_on_line": [("u", Z)],
    "drive": [],
    "coupler": [],
    "bushing": [("u", X), ("u", Y), ("u", Z), ("log", 0)],
    "torsion": [("angle", Z)],
    "spring_damper": [("stretch", 0)],
}
