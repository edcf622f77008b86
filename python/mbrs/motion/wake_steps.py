"""Warnings of wake steps that are too long: for the turning of the rotor, or for the vibration of its blades."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._lib.warning import warn_user
from ..model.aerodynamics import Aerodynamics
from ..model.flexible import FlexibleBody
from ..model.section_loads import interpolated, line_of
from ..system.air_flow import FLOW
from ..system.snapshot import Snapshot

# rad: turn of a rotor in a step of its wake beyond which the filaments are polygons of fewer than twelve corners. Larger: their
# velocities are wrong in silence. Smaller: steps that serve are warned of. Pinned by tests/motion/test_wake_steps.py.
LARGEST_TURN = np.pi / 6.0
# Turns beyond it by this part are rounding of the rotor's speed. Pinned by the same tests.
_ROUNDED = 1e-6
# Steps in the period of a blade's mode. Fewer: the wake does not see the mode move. More: needless warnings. Pinned by the same tests.
STEPS_A_PERIOD = 8
# A mode matters if it makes this part of the deflection of the blade under the present load. Larger: second modes that are loaded are
# not seen. Smaller: steps have to follow modes that hardly move. Pinned by the same tests.
MATTERS = 0.1


def warn_long_steps(air: Aerodynamics, snapshot: Snapshot, flow: np.ndarray, step: float) -> None:
    """Warn of a step longer than an eighth of the period of a mode that matters; ``flow`` (1, sections, 36) as of `flows`.

    The modes are those of the flexible body with its frame held, at rest. Cost O(modes^3).
    """
    start = 0
    for blade in air.blades:
        n = len(blade["place"])
        owner = snapshot.model[blade["body"]]
        if isinstance(owner, FlexibleBody):
            own = flow[0, start : start + n]
            axes = [own[:, FLOW[name]] for name in ("span", "ahead", "suction")]
            force = np.stack([np.sum(own[:, FLOW["force"]] * axis, axis=1) for axis in axes], axis=1)
            frequency, share = loaded_modes(owner.modal, np.array(blade["place"]) - blade["root"], force)
            for k in np.flatnonzero(share >= MATTERS)[::-1]:
                if step * STEPS_A_PERIOD * frequency[k] > 1.0:
                    _warn_of_mode(air, blade["body"], step, int(k), frequency[k], share[k])
                    return
        start += n


def loaded_modes(modal: Any, along: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (m,) Hz of a clamped body, and the parts (m,) that its modes have in its deflection under forces (n, 3) N.

    The forces act at places ``along`` (n,) m of its line, in body axes: w = sum_k phi_k (phi_k^T f) / omega_k^2.
    """
    import scipy.linalg

    square, modes = scipy.linalg.eigh(modal.K, modal.M)
    distance, _ = line_of("blades", modal)
    shape = interpolated(distance, modal.line_shape[:, :3], np.clip(along, 0.0, distance[-1])) @ modes
    stiff = np.maximum(square, np.finfo(float).tiny)
    part = shape * (np.einsum("nik,ni->k", shape, force) / stiff)
    total = np.max(np.linalg.norm(np.sum(part, axis=2), axis=1))
    most = np.max(np.linalg.norm(part, axis=1), axis=0)
    return np.sqrt(np.maximum(square, 0.0)) / (2.0 * np.pi), most / total if total > 0.0 else 0.0 * most


def _warn_of_mode(air: Aerodynamics, body: str, step: float, k: int, frequency: float, share: float) -> None:
    warn_user(
        f"{air.name!r}: a step of the inflow takes {step:.4g} s, longer than an eighth of the period {1.0 / frequency:.4g} s of mode "
        f"{k + 1} of {body!r} ({frequency:.4g} Hz), which makes {100.0 * share:.0f} % of the blade's deflection under the present load; "
        f'give options={{"steps": ...}} {step * STEPS_A_PERIOD * frequency:.2g} times as many'
    )


def warn_long_turn(air: Aerodynamics, speed: float, step: float) -> None:
    """Warn of a rotor whose largest ``speed``, rad/s, turns it by more than 30 degrees in a step of the inflow, s."""
    turn = speed * step
    if turn > LARGEST_TURN * (1.0 + _ROUNDED):
        warn_user(
            f"{air.name!r}: the rotor came to turn by {np.degrees(turn):.4g} degrees in a step of the inflow ({step:.4g} s, chosen for "
            f'its speed at the start); give options={{"steps": ...}} {turn / LARGEST_TURN:.2g} times as many'
        )
