"""Codes of universal files: directions, kinds of functions, quantities and their units (record descriptions of the SDRL, Cincinnati)."""

from __future__ import annotations

from collections.abc import Mapping

KINDS: Mapping[int, str] = {
    0: "general", 1: "time response", 2: "auto spectrum", 3: "cross spectrum", 4: "frequency response", 5: "transmissibility",
    6: "coherence", 7: "auto correlation", 8: "cross correlation", 9: "power spectral density", 10: "energy spectral density",
    11: "probability density", 12: "spectrum", 18: "mode indicator", 26: "multiple coherence",
}  # fmt: skip
# quantity: ((length, force) of a translation, of a rotation)
QUANTITIES: Mapping[int, tuple[str, tuple[int, int], tuple[int, int]]] = {
    0: ("", (0, 0), (0, 0)),
    2: ("stress", (-2, 1), (-1, 1)),
    3: ("strain", (0, 0), (0, 0)),
    6: ("heat flux", (1, 1), (1, 1)),
    8: ("displacement", (1, 0), (0, 0)),
    9: ("reaction force", (0, 1), (1, 1)),
    11: ("velocity", (1, 0), (0, 0)),
    12: ("acceleration", (1, 0), (0, 0)),
    13: ("force", (0, 1), (1, 1)),
    15: ("pressure", (-2, 1), (-1, 1)),
    16: ("mass", (-1, 1), (1, 1)),
    17: ("time", (0, 0), (0, 0)),
    18: ("frequency", (0, 0), (0, 0)),
}
CODES: Mapping[str, int] = {name: code for code, (name, _, _) in QUANTITIES.items()}
AXES = ("x", "y", "z", "rx", "ry", "rz")
NUMERATORS: Mapping[str, str] = {
    "receptance": "displacement", "mobility": "velocity", "accelerance": "acceleration", "transmissibility": "displacement",
}  # fmt: skip


def direction_name(code: int) -> str:
    """ "+x" for 1, "-rz" for -6, "" for a scalar."""
    return "" if code == 0 else ("+" if code > 0 else "-") + AXES[abs(code) - 1]


def direction_code(name: str) -> int:
    """The inverse of `direction_name`; the sign may be left out, and everything but an axis is a scalar."""
    bare = name.lstrip("+-")
    return 0 if bare not in AXES else (AXES.index(bare) + 1) * (-1 if name.startswith("-") else 1)
