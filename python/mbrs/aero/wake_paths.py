"""Prescribed wakes: where the filaments of a rotor in hover or in axial wind are, from its thrust alone."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .lattice import Cores, Frame, Wake
from .lines import Lines

__all__ = ["Path", "hover_path", "prescribed", "wind_path"]

# Largest axial induction for which a wake is drawn; momentum theory has none beyond 1/2. Larger: wakes that stand still.
MOST_INDUCTION = 0.45
# Thrust coefficient of a hovering rotor for which a wake is drawn at least. Larger: wakes of light rotors go down too fast. Smaller: all
# particles of an unloaded rotor lie in its disc, where their velocities have no bound.
LEAST_THRUST = 1e-6


@dataclass(frozen=True)
class Path:
    """Places of particles that left a blade, at ages (k,).

    ``axial`` (2, k) m down the axis, for those that roll up outboard and inboard; ``contraction`` (k,) of their radius; ``drift`` (3,)
    m/s carries them off the axis.
    """

    axial: np.ndarray
    contraction: np.ndarray
    drift: np.ndarray = field(default_factory=lambda: np.zeros(3))


def hover_path(thrust: float, solidity: float, blades: int, radius: float, twist: float, angle: np.ndarray) -> Path:
    """Landgrebe's wake of a hovering rotor, at angles (k,) rad that the rotor has turned since.

        z/R = k1 psi up to psi = 2 pi / b, then with k2;   r/R = .78 + .22 exp(-(.145 + 27 C_T) psi)
        k1 = -(C_T / sigma + .001 theta) / 4,   k2 = -(1.41 + .0141 theta) sqrt(C_T / 2)

    ``thrust`` C_T = T / (rho pi R^2 (Omega R)^2), theta the linear twist in degrees, negative where the pitch falls outwards.
    A. J. Landgrebe, "The wake geometry of a hovering helicopter rotor and its influence on rotor performance", J. Am. Helicopter
    Soc. 17 (1972) 3.
    """
    ct = max(abs(thrust), LEAST_THRUST)
    k1 = 0.25 * (ct / solidity + 0.001 * twist)
    k2 = (1.41 + 0.0141 * twist) * np.sqrt(0.5 * ct)
    passage = 2.0 * np.pi / blades
    tip = k1 * np.minimum(angle, passage) + k2 * np.maximum(angle - passage, 0.0)
    side = -np.copysign(radius, thrust)
    contraction = 0.78 + 0.22 * np.exp(-(0.145 + 27.0 * ct) * angle)
    return Path(side * np.stack([tip, k2 * angle]), contraction)


def wind_path(thrust: float, speed: float, radius: float, time: np.ndarray) -> Path:
    """A wake that axial wind takes along, after times (k,) s.

        dz/dt = U (1 - a f(z)),   r / r0 = sqrt((1 - a) / (1 - a f(z))),   f = 1 + z / sqrt(R^2 + z^2)

    with a of momentum theory: f is the velocity on the axis of a semi-infinite vortex cylinder. ``thrust`` is T / (rho pi R^2 U^2 /
    2). E. Branlard, "Wind Turbine Aerodynamics and Vorticity-Based Methods" (2017), chapter 36.
    """
    a = 0.5 * (1.0 - np.sqrt(max(1.0 - thrust, (1.0 - 2.0 * MOST_INDUCTION) ** 2)))
    z, places = 0.0, [0.0]

    def rate(x: float) -> float:
        return speed * (1.0 - a * (1.0 + x / np.hypot(radius, x)))

    for h in np.diff(time):  # classical Runge-Kutta: one smooth unknown
        k1 = rate(z)
        k2 = rate(z + 0.5 * h * k1)
        k3 = rate(z + 0.5 * h * k2)
        z += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(z + h * k3))
        places.append(z)
    axial = np.array(places)
    f = 1.0 + axial / np.hypot(radius, axial)
    return Path(np.stack([axial, axial]), np.sqrt((1.0 - a) / (1.0 - a * f)))


def prescribed(
    lines: Lines,
    circulation: np.ndarray,
    path: Path,
    frame: Frame,
    turn: float,
    step: float,
    cores: Cores,
    counts: tuple[int, int, int],
    threads: int = 0,
) -> Wake:
    """A wake on a path, shed with one circulation (b, n) by lines that turn by ``turn`` in a step.

    ``counts`` are the numbers of ages of lattice, rolled up filaments and helix behind them.
    """
    p, q, r = counts
    b = len(circulation)
    local = frame.local(lines.trailing)
    near = frame.world(_shed(local, path.axial[0], path, turn, step, np.arange(p + 1)))
    turns = round(2.0 * np.pi / abs(turn))
    along = (path.axial[:, -1] - path.axial[:, -1 - turns])[:, None] * np.array([1.0, 0.0, 0.0])
    wake = Wake(
        bound=lines.edges,
        near=near,
        far=np.zeros((b, 2, q + 1, 3)),
        tail=np.zeros((b, 2, r + 1, 3)),
        strength=np.repeat(circulation[..., None], p, axis=2),
        far_strength=np.zeros((b, q)),
        far_core=np.zeros((b, 2, q)),
        step=step,
        advance=along + turns * step * path.drift,
        cores=cores,
        threads=threads,
    )
    # the far filaments begin where particles would be that left the blade at the centres of vorticity
    at_blade = Wake(**{**vars(wake), "near": np.repeat(lines.trailing[:, :, None], p + 1, axis=2)}).roll_up()
    _, core, peak = wake.roll_up()
    first = frame.local(at_blade[0])
    ages = np.arange(p, p + q + 1)
    axial = path.axial + (path.axial[:1, p] - path.axial[:, p])[:, None]  # the sides part where the lattice ends
    far = np.stack([_shed(first[:, f], axial[f], path, turn, step, ages) for f in range(2)], axis=1)
    wake = Wake(
        **{
            **vars(wake),
            "far": frame.world(far),
            "far_strength": np.repeat(peak[:, None], q, axis=1),
            "far_core": np.repeat(core[..., None], q, axis=2),
        }
    )
    return wake.placed(lines.edges, near, wake.far, frame, turn)


def _shed(local: np.ndarray, axial: np.ndarray, path: Path, turn: float, step: float, ages: np.ndarray) -> np.ndarray:
    """(..., k, 3) m in axes of the hub: particles that left points (..., 3) m at ages (k,), the rotor turning by ``turn`` an age."""
    c, s = np.cos(ages * turn), np.sin(ages * turn)
    shrink = path.contraction[ages]
    y, z = local[..., 1, None], local[..., 2, None]
    x = local[..., 0, None] + axial[ages]
    moved = np.stack([x, shrink * (c * y + s * z), shrink * (c * z - s * y)], axis=-1)
    return moved + (ages * step)[:, None] * path.drift
