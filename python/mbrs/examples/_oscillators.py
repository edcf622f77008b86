"""Small nonlinear systems that others use as tests, with their data: matrices, not models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.laws import Cubic, Gap, Jenkins, VanDerPol

if TYPE_CHECKING:
    from ..linear.matrices import MechanicalSystem


def _system(*matrices: Any, elements: Any, coordinates: Any = None) -> Any:
    from ..linear.matrices import MechanicalSystem

    return MechanicalSystem(*matrices, elements=elements, coordinates=coordinates)


def duffing(k3: float = 0.1, c: float = 0.05) -> MechanicalSystem:
    """x" + c x' + x + k3 x^3, a `MechanicalSystem`. With the force 0.18 cos(omega t), omega from 0.5 to 1.6 it is the
    case of docs/theory.md (23.5) (data of NLvib's first example); k3 = 1 with 0.3 cos(omega t) is (23.6).

    >>> import mbrs as mb
    >>> mb.examples.duffing().elements
    (Cubic(0.1, w=[1.]),)
    """
    return _system([[1.0]], [[c]], [[1.0]], elements=[Cubic(k3, w=[1.0])])


def two_mass_cubic() -> MechanicalSystem:
    """A mass with a small absorber on cubic springs, a `MechanicalSystem` of two coordinates: under 0.11 cos(omega t) on
    the first mass, omega from 0.8 to 1.4, it has a Neimark-Sacker pair (docs/theory.md (23.7), NLvib's second example).
    """
    return _system(
        np.diag([1.0, 0.05]),
        [[0.015, -0.013], [-0.013, 0.013]],
        [[1.0453, -0.0453], [-0.0453, 0.0453]],
        elements=[Cubic(1.0, w=[1.0, 0.0]), Cubic(0.0042, w=[1.0, -1.0])],
        coordinates=["mass", "absorber"],
    )


def two_mass_stop(stiffness: float = 100.0, gap: float = 1.0) -> MechanicalSystem:
    """Two unit masses in a row between a free end and a wall, the first beside a stop: ``stiffness`` beyond ``gap``.

    A `MechanicalSystem`, springs 1 with 3 % of their stiffness as damping; 0.1 cos(omega t) on the second mass
    (docs/theory.md (23.8), NLvib's third example).
    """
    K = np.array([[1.0, -1.0], [-1.0, 2.0]])
    return _system(
        np.eye(2), 0.03 * K, K, elements=[Gap(stiffness, gap, w=[1.0, 0.0])], coordinates=["first", "second"]
    )


def jenkins_oscillator(k: float = 0.5, f_slip: float = 0.2, c: float = 0.02) -> MechanicalSystem:
    """x" + c x' + x + Jenkins(k, f_slip), a `MechanicalSystem`: it sticks under small forces, slips under larger ones.

    All data are invented.
    """
    return _system([[1.0]], [[c]], [[1.0]], elements=[Jenkins(k, f_slip, w=[1.0])])


def two_tone_duffing(eta: float = 1.5) -> tuple[Any, list[dict[str, Any]]]:
    """x" + 0.1 x' + x + 1.5 x^3 = 0.25 sin(eta t) + 0.25 sin(sqrt(2) eta t): the system, and forces for
    `quasi_periodic` (docs/theory.md (23.9), CoSTAR's duffing_ap_qp)."""
    system = _system([[1.0]], [[0.1]], [[1.0]], elements=[Cubic(1.5, w=[1.0])])
    return system, [dict(force=[-0.25j], omega=w) for w in (eta, 2**0.5 * eta)]


def van_der_pol(mu: float = 1.0) -> MechanicalSystem:
    """x" - mu (1 - x^2) x' + x = 0, a `MechanicalSystem` with a limit cycle; a relaxation oscillation for large mu."""
    return _system([[1.0]], [[-mu]], [[1.0]], elements=[VanDerPol(mu, w=[1.0])])
