"""Small results made by hand for the tests of tables, plots, pages and studies: invented data or closed forms."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
from mbrs.view.scene import BodyGeometry, JointGeometry, LinkGeometry, SceneGeometry


class Modes(SimpleNamespace):
    """Stands in for a ModalResult."""

    def body_shape(self, name: str) -> np.ndarray:
        return self.shapes[name]


def hexapod_modes() -> Modes:
    """A payload on six legs, its closed-form frequencies (docs/theory.md (23.1)), shapes along and about the world axes."""
    centre, edge = np.array([0.0, 0.0, 0.1]), 0.2
    corners = [centre + 0.5 * edge * np.array(s) for s in itertools.product((-1, 1), repeat=3)]
    feet, heads = corners[0:6:2] + corners[4:7:2], corners[1:8:2] + corners[3:6:2]
    legs = tuple(
        LinkGeometry(f"leg{i}", None, "payload", a, b)
        for i, (a, b) in enumerate(zip(feet[:5], heads[:5], strict=False))
    )
    body = BodyGeometry("payload", centre, np.eye(3), np.array([link.at_b for link in legs]))
    frequency = np.array([15.9155, 15.9155, 15.9155, 18.3776, 18.3776, 36.7553])
    damping = np.array([0.015, 0.015, 0.015, 0.01732, 0.01732, 0.03464])
    s = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
    return Modes(
        frequency=frequency,
        frequency_damped=frequency * np.sqrt(1 - damping**2),
        damping=damping,
        eigenvalue=s,
        shape=np.eye(6, dtype=complex),
        kind=np.array(["underdamped"] * 6),
        groups=[(0, 1, 2), (3, 4), (5,)],
        coordinates=[f"payload.{c}" for c in ("x", "y", "z", "rx", "ry", "rz")],
        geometry=SceneGeometry((body,), legs),
        shapes={"payload": np.eye(6, dtype=complex)},
        stats=SimpleNamespace(wall_time=1e-3, counts={"eigensolutions": 1}, effects=("damping",), route="proportional"),
        error=1e-15,
        status="converged",
    )


def chain_modes(n: int, n_modes: int = 8) -> Modes:
    """A chain of n hinged links of .2 m with sine-like shapes: invented, for pictures and speed."""
    links, joints, shapes = [], [], {}
    i = np.arange(n)
    for k in range(n):
        a, b = np.array([0.2 * k, 0.0, 0.0]), np.array([0.2 * (k + 1), 0.0, 0.0])
        links.append(BodyGeometry(f"link{k}", 0.5 * (a + b), np.eye(3), np.array([a, b])))
        joints.append(JointGeometry(f"J{k}", "revolute", None if k == 0 else f"link{k - 1}", f"link{k}", a, [0, 0, 1]))
    for k in range(n):
        shape = np.zeros((6, n_modes), dtype=complex)
        for m in range(n_modes):
            w = (m + 0.5) * np.pi / n
            left, right = 1 - np.cos(w * i[k]), 1 - np.cos(w * (i[k] + 1))
            shape[1, m], shape[5, m] = 0.5 * (left + right), (right - left) / 0.2
        shapes[f"link{k}"] = shape
    frequency = (np.arange(n_modes) + 0.5) ** 2
    return Modes(
        frequency=frequency,
        damping=np.full(n_modes, 0.01),
        kind=np.array(["underdamped"] * n_modes),
        geometry=SceneGeometry(tuple(links), (), tuple(joints)),
        shapes=shapes,
    )


def oscillator_frf(n_out: int = 1, n_in: int = 1, n: int = 800, kind: str = "receptance") -> SimpleNamespace:
    """Receptance 1/(k - w^2 m + i w c) of single oscillators with stiffness 1e4 (1 + i + j): closed form."""
    frequency = np.linspace(1.0, 60.0, n)
    w = 2 * np.pi * frequency
    value = np.array([[1 / (1e4 * (1 + i + j) - w**2 * 2.0 + 1j * w * 6.0) for j in range(n_in)] for i in range(n_out)])
    return SimpleNamespace(
        value=value,
        frequency=frequency,
        omega=w,
        kind=kind,
        inputs=[f"b{j}.force.z" for j in range(n_in)],
        outputs=[f"b{i}.motion.z" for i in range(n_out)],
    )


def sensitivity() -> SimpleNamespace:
    """Derivatives of two frequencies by four parameters: invented."""
    return SimpleNamespace(
        frequency=np.array([[7.95775e-5, 0.0, -0.3979, 1.2], [9.2e-5, 0.0, 0.0, -3.0]]),
        damping=np.zeros((2, 4)),
        labels=["k_leg", "c_leg", "payload.mass", "leg0.at_b[2]"],
        units=["N/m", "N s/m", "kg", "m"],
        values=np.array([1e5, 30.0, 20.0, 0.2]),
    )
