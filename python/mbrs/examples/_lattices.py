"""Chain, binary tree and ladder of any size: the test structures of Jiang, Chen and Luo (2011), geometry of
docs/theory.md (23.2) to (23.4).

Lost in the source and chosen here: masses, inertias and coefficients (`_data`), the free axis of the joints (local z),
the joint of the tree's root to ground, the ladder's joints, and how s spring-dampers between two bodies share their
coefficients: each has 1/s of them, so that s changes the work but not the answer.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any, TypedDict, Unpack

import numpy as np

from ..errors import ModelError
from ..model.model import Model
from ..model.rotations import rotation
from ._data import LATTICE_C, LATTICE_INERTIA, LATTICE_K, LATTICE_MASS

_JOINTS = {
    "R": "revolute",
    "P": "prismatic",
    "C": "cylindrical",
    "S": "spherical",
    "U": "universal",
    "F": "fixed",
}
_CODE = re.compile(r"([CTL])L(\d+)([RPCS])F(\d+)")


class LatticeOptions(TypedDict, total=False):
    """Data of lattices, one set for all bodies and all joints."""

    mass: float
    inertia: Sequence[float]
    k: Sequence[float]
    c: Sequence[float] | None
    gravity: Sequence[float]


class _Builder:
    """Adds bodies that are all alike, and between two of them a joint with its spring-dampers."""

    def __init__(self, name: str, joint: str | None, springs: int, options: LatticeOptions) -> None:
        unknown = set(options) - set(LatticeOptions.__annotations__)
        if unknown:
            raise ModelError(f"{name} has no option {', '.join(sorted(unknown))}; known: mass, inertia, k, c, gravity")
        self.m = Model(name, gravity=options.get("gravity"))
        self.joint = _joint_type(joint)
        if isinstance(springs, bool) or not isinstance(springs, (int, np.integer)) or springs < 0:
            raise ModelError(f"springs must be a whole number of spring-dampers for each joint, got {springs!r}")
        self.springs = int(springs)
        self.mass = options.get("mass", LATTICE_MASS)
        self.inertia = options.get("inertia", LATTICE_INERTIA)
        share = max(self.springs, 1)
        self.k = tuple(v / share for v in options.get("k", LATTICE_K))
        c = options.get("c", LATTICE_C)
        self.c = None if c is None else tuple(v / share for v in c)

    def body(self, name: str, at: tuple[float, float, float], angle: float = 0.0) -> Any:
        turn = rotation("z", angle) if angle else None
        return self.m.body(name, mass=self.mass, inertia=self.inertia, at=at, orientation=turn)

    def connect(self, label: str, a: Any, b: Any, at: tuple[float, float, float], angle: float = 0.0) -> None:
        frame = rotation("z", angle) if angle else (1.0, 0.0, 0.0, 0.0)
        if self.joint is not None:
            getattr(self.m, self.joint)(f"J{label}", a, b, at=at, orientation=frame)
        for s in range(self.springs):
            ending = f"-{s + 1}" if self.springs > 1 else ""
            self.m.bushing(f"F{label}{ending}", a, b, at=at, k=self.k, c=self.c, orientation=frame)


def _joint_type(joint: str | None) -> str | None:
    if joint is None or joint in _JOINTS.values():
        return joint
    if joint in _JOINTS:
        return _JOINTS[joint]
    raise ModelError(f"joint must be one of {', '.join(_JOINTS)} or a name such as 'revolute', or None; got {joint!r}")


def _count(what: str, n: Any) -> int:
    if isinstance(n, bool) or not isinstance(n, (int, np.integer)) or n < 1:
        raise ModelError(f"{what} must be a positive whole number, got {n!r}")
    return int(n)


def chain(
    n: int, joint: str | None = "revolute", springs: int = 1, along: str = "z", **options: Unpack[LatticeOptions]
) -> Model:
    """n bodies in a row from ground, "B1" to "Bn", 0.2 m each.

    Parameters
    ----------
    n
        Number of bodies.
    joint
        "revolute", "prismatic", "cylindrical", "spherical" (or R, P, C, S); None for bushings alone. Free axis: z.
    springs
        Six-component spring-dampers (bushings) at each joint; together they have the coefficients k and c.
    along
        "z" as the source prints the chain: all hinges share one axis, so that R twists and P stretches. "x" lays the
        chain across the free axes: R bends in the plane.
    **options
        ``mass`` kg, ``inertia`` (3,) kg m2, ``k`` (6,), ``c`` (6,) or None, ``gravity`` (3,).

    Returns
    -------
    Model
        n (R, P), 2n (C), 3n (S) or 6n (None) degrees of freedom.

    Notes
    -----
    Geometry: docs/theory.md (23.2): centre of mass of Bi at 0.2 i - 0.1, joint J(i-1,i) at 0.2 i - 0.2. Data are
    invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.examples.chain(3)
    Model('chain': 3 bodies, 3 joints, 3 springs or dampers, 0 loads, 0 parameters)
    """
    build = _Builder("chain", joint, springs, options)
    if along not in ("x", "z"):
        raise ModelError(f'along must be "z" (the source) or "x" (across the free axes), got {along!r}')

    def place(s: float) -> tuple[float, float, float]:
        return (s, 0.0, 0.0) if along == "x" else (0.0, 0.0, s)

    previous = build.m.ground
    for i in range(1, _count("n", n) + 1):
        body = build.body(f"B{i}", place(0.2 * i - 0.1))
        build.connect(f"{i}", previous, body, place(0.2 * i - 0.2))
        previous = body
    return build.m


def tree(layers: int, joint: str | None = "revolute", springs: int = 1, **options: Unpack[LatticeOptions]) -> Model:
    """A binary tree: 2^(i-1) bodies "Bi,1", "Bi,2", ... in layer i, the root jointed to ground; options as for `chain`.

    Geometry: docs/theory.md (23.3): body (i, j) at (j, i, 0), its joints to (i+1, 2j-1) and (i+1, 2j) midway, turned by
    arccot(j-1) and arccot(j). The root's joint, not printed there, follows the same rule with ground as body (0, 1). Data are
    invented.
    """
    build = _Builder("tree", joint, springs, options)
    above = [build.m.ground]
    for i in range(1, _count("layers", layers) + 1):
        row = []
        for j in range(1, 2 ** (i - 1) + 1):
            parent = (j + 1) // 2
            body = build.body(f"B{i},{j}", (j, i, 0.0))
            # Odd children: local x along (parent - 1, 1); even ones: along (parent, 1).
            run = j - parent
            build.connect(f"{i},{j}", above[parent - 1], body, ((parent + j) / 2, i - 0.5, 0.0), math.atan2(1.0, run))
            row.append(body)
        above = row
    return build.m


def ladder(layers: int, joint: str | None = "revolute", springs: int = 1, **options: Unpack[LatticeOptions]) -> Model:
    """Stiles "Bi,1", "Bi,2" and a rung "Bi,3" in each of the layers, one loop for each; options as for `chain`.

    Geometry: docs/theory.md (23.4): stiles at (-0.1, 0.2 i - 0.1) and (0.1, ...), rung at (0, 0.2 i) turned by 90 degrees;
    stile u hinged below to the rung under it (ground for i = 1) and above to the rung of its layer at x = 0.2 u
    - 0.3. With parallel axes the loops are redundant: N degrees of freedom for R, 4N for C, 6N for S. Data are
    invented.
    """
    build = _Builder("ladder", joint, springs, options)
    below = build.m.ground
    for i in range(1, _count("layers", layers) + 1):
        stiles = [build.body(f"B{i},{u}", (0.2 * u - 0.3, 0.2 * i - 0.1, 0.0)) for u in (1, 2)]
        rung = build.body(f"B{i},3", (0.0, 0.2 * i, 0.0), math.pi / 2)
        for u, stile in enumerate(stiles, 1):
            build.connect(f"{i},{u}a", below, stile, (0.2 * u - 0.3, 0.2 * (i - 1), 0.0))
        for u, stile in enumerate(stiles, 1):
            build.connect(f"{i},{u}b", stile, rung, (0.2 * u - 0.3, 0.2 * i, 0.0))
        below = rung
    return build.m


def from_code(code: str, **options: Unpack[LatticeOptions]) -> Model:
    """A model by the source's code: kind (C, T, L), "L" and layers, joint (R, P, C, S), "F" and number of
    spring-dampers.

    >>> import mbrs as mb
    >>> len(mb.examples.from_code("TL7SF1").bodies)
    127
    """
    match = _CODE.fullmatch(code) if isinstance(code, str) else None
    if match is None:
        raise ModelError(f"the code must read like 'TL7SF1' (tree, 7 layers, spherical, 1 spring-damper), got {code!r}")
    kind, layers, joint, springs = match.groups()
    builders: dict[str, Callable[..., Model]] = {"C": chain, "T": tree, "L": ladder}
    model = builders[kind](int(layers), joint=_JOINTS[joint], springs=int(springs), **options)
    model.name = code
    return model
