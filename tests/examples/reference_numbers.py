"""Makes `reference_numbers.json` beside it: what the plain NumPy reference says about every example.

The tests compare the Rust core with these numbers. Run it again after a change of an example, and look at what the change does:

    python tests/examples/reference_numbers.py [name ...]
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mbrs as mb
import numpy as np
from mbrs import reference
from mbrs.model.directions import directions
from mbrs.model.tables import tables
from mbrs.reference.dynamics import elements
from mbrs.reference.kinematics import moving

NUMBERS = Path(__file__).resolve().with_name("reference_numbers.json")
# More would make the file long without testing anything else.
MOST_MODES = 24


@dataclass(frozen=True)
class Case:
    """A model, the parameters whose sensitivities are kept, and one transfer function: (body, axis) to (body, axis)."""

    model: Callable[[], mb.Model]
    parameters: tuple[str, ...]
    force: tuple[str, str]
    motion: tuple[str, str]
    frequency: tuple[float, ...]
    at_equilibrium: bool = False


def _chain(joint: str | None, along: str = "z") -> Callable[[], mb.Model]:
    return lambda: mb.examples.chain(10, joint=joint, along=along)


_PAYLOAD = (("payload", "z"), ("payload", "z"))
_TIP = (("B10", "y"), ("B5", "y"))
_RUNG = (("B3,3", "x"), ("B2,1", "x"))
_DISC = (("disc", "x"), ("disc", "x"))
_TWIST = (("B10", "rz"), ("B5", "rz"))
_STRETCH = (("B10", "z"), ("B5", "z"))

CASES = {
    "hexapod": Case(
        mb.examples.cubic_hexapod,
        ("k_leg", "c_leg", "payload.mass", "payload.inertia[2,2]", "leg0.at_b[2]"),
        *_PAYLOAD,
        (5.0, 16.0, 60.0),
    ),
    "chain_revolute": Case(_chain("revolute"), ("F1.k[5]", "B10.inertia[2,2]"), *_TWIST, (0.1, 3.0, 20.0)),
    "chain_prismatic": Case(_chain("prismatic"), ("F1.k[2]", "B10.mass"), *_STRETCH, (1.0, 15.0)),
    "chain_cylindrical": Case(_chain("cylindrical"), ("F1.k[5]", "F1.k[2]", "B10.mass"), *_TWIST, (0.1, 3.0, 20.0)),
    "chain_spherical": Case(_chain("spherical"), ("F1.k[3]", "B10.mass", "J2.at_a[2]"), *_TIP, (0.1, 3.0, 20.0)),
    "chain_springs": Case(_chain(None), ("F1.k[3]", "B10.mass", "F2.at_a[2]"), *_TIP, (0.1, 3.0, 20.0)),
    "chain_along_x": Case(_chain("revolute", "x"), ("F1.k[5]", "B10.mass", "J2.at_a[0]"), *_TIP, (0.1, 3.0, 20.0)),
    # The plain reference takes a minute for 127 bodies, so the sensitivities are those of a smaller tree.
    "tree": Case(lambda: mb.examples.from_code("TL7SF1"), (), ("B6,1", "x"), ("B6,32", "y"), (0.002, 0.05, 1.0)),
    "tree_small": Case(
        lambda: mb.examples.from_code("TL4SF1"),
        ("F1,1.k[3]", "B4,1.mass", "F3,2.c[5]"),
        ("B3,1", "x"),
        ("B3,4", "y"),
        (0.02, 0.3, 5.0),
    ),
    "ladder_revolute": Case(lambda: mb.examples.ladder(3), ("F1,1a.k[5]", "B3,3.mass"), *_RUNG, (1.0, 12.0)),
    "ladder_cylindrical": Case(
        lambda: mb.examples.ladder(3, joint="C"), ("F1,1a.k[5]", "B3,3.mass"), *_RUNG, (1.0, 12.0)
    ),
    "ladder_spherical": Case(
        lambda: mb.examples.ladder(3, joint="S"), ("F1,1a.k[5]", "B3,3.mass"), *_RUNG, (1.0, 12.0)
    ),
    "four_bar": Case(
        mb.examples.four_bar,
        ("mount.k[0]", "coupler.mass", "crank.inertia[2,2]", "pull.value[0]"),
        ("coupler", "x"),
        ("rocker", "x"),
        (1.0, 12.0, 50.0),
        at_equilibrium=True,
    ),
    "quadruped": Case(
        mb.examples.quadruped,
        ("k_leg", "k_foot", "torso.mass", "knee-FL.at_a[1]", "foot-FL.at_a[0]"),
        ("torso", "z"),
        ("torso", "y"),
        (1.0, 9.0, 60.0),
    ),
    "stewart_platform": Case(
        mb.examples.stewart_platform,
        ("k_strut", "c_strut", "platform.mass", "head0.k[0]"),
        ("platform", "x"),
        ("platform", "ry"),
        (3.0, 7.0, 65.0),
    ),
    "wafer_stage": Case(
        mb.examples.wafer_stage,
        ("k_mount", "base.mass", "y guide.k", "flexures.k[2]"),
        ("base", "x"),
        ("chuck", "x"),
        (2.0, 35.0, 200.0),
    ),
    "rotor": Case(mb.examples.rotor, ("disc.mass", "mount.k[0]"), *_DISC, (10.0, 50.0)),
    "rotor_spinning": Case(
        lambda: mb.examples.rotor(speed=300.0), ("disc.mass", "disc.inertia[2,2]"), *_DISC, (10.0, 50.0)
    ),
}
AXES = ("x", "y", "z", "rx", "ry", "rz")


def numbers(case: Case) -> dict[str, Any]:
    """Frequencies, damping ratios, one transfer function and sensitivities, by the reference alone."""
    model = case.model()
    own = tables(model)
    state_of = _equilibrium if case.at_equilibrium else reference.assembly.drawn_and_assembled
    system = reference.System(own)
    state = state_of(system)
    lin = reference.linearize(system, state)
    modes = reference.modes(lin.M, lin.C, lin.G, lin.K, lin.N)
    labels, columns = (), []
    if case.parameters:
        along = directions(model, list(case.parameters))
        labels, columns = along.labels, [_sensitivity(own, state_of, lin, modes, d) for d in along.dense.T]
    force, motion = (
        reference.motion_rows(system, lin, body)[AXES.index(axis)] for body, axis in (case.force, case.motion)
    )
    omega = 2 * np.pi * np.array(case.frequency)
    h = reference.frf(lin.M, lin.D, lin.S, force[:, None], motion[None, :], omega)[0, 0]
    return {
        "dof": len(lin.coordinates),
        "frequency": modes.frequency[:MOST_MODES].tolist(),
        "rounding": _rounding(system, state, lin, modes)[:MOST_MODES].tolist(),
        "damping": _rounded(modes.damping[:MOST_MODES]),
        "H": {"frequency": list(case.frequency), "re": h.real.tolist(), "im": h.imag.tolist()},
        "labels": list(labels),
        "sensitivity": [_rounded(column[:MOST_MODES]) for column in columns],
    }


def _rounding(
    system: reference.System, state: reference.State, lin: reference.Linearization, modes: reference.Modes
) -> np.ndarray:
    """Relative error of each frequency that the congruence T^T K T of absolute stiffnesses may leave.

    eps |phi|^T |T|^T |K_abs| |T| |phi| / |phi^H K phi|: large where a soft mode carries far bodies along.
    """
    n = 6 * system.nb
    forces = elements(system, moving(state, np.zeros(n), pose=np.eye(n)), without=["damping"])
    absolute = forces.derivative_along(n)[:, 0].T
    carried = np.abs(lin.T) @ np.abs(modes.shape)
    size = np.einsum("ik,ij,jk->k", carried, np.abs(absolute), carried)
    strain = np.abs(np.einsum("ik,ij,jk->k", modes.shape.conj(), lin.K, modes.shape))
    return np.divide(np.finfo(float).eps * size, strain, out=np.zeros_like(size), where=modes.eigenvalue != 0)


def _sensitivity(
    own: Any, state_of: Any, lin: reference.Linearization, modes: reference.Modes, direction: np.ndarray
) -> np.ndarray:
    """df/dp (n,): the tangent from a complex step, the eigenvectors from the real linearisation."""
    _, d = reference.derivative(own, direction, state_of)
    ds = reference.eigenvalue_derivative(lin, modes, d)
    return reference.frequency_derivative(modes.eigenvalue, ds)[0]


def _equilibrium(system: reference.System) -> reference.State:
    return reference.equilibrium(system)[0]


def _rounded(values: np.ndarray) -> list[float | None]:
    """JSON has no nan: rigid modes have neither a damping ratio nor a sensitivity."""
    return [None if np.isnan(v) else float(v) for v in values]


def main(names: list[str]) -> None:
    known = json.loads(NUMBERS.read_text()) if NUMBERS.exists() else {}
    for name in names or CASES:
        known[name] = numbers(CASES[name])
        _write(known)
        print(f"{name}: {known[name]['dof']} degrees of freedom", flush=True)


def _write(known: dict[str, Any]) -> None:
    # One example per line: a change of one shows as one changed line.
    lines = [f"{json.dumps(name)}: {json.dumps(known[name])}" for name in CASES if name in known]
    NUMBERS.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
