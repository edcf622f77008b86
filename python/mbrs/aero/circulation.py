"""Bound circulation of lifting lines: the law of Kutta and Joukowski met by the polars of all strips at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lines import HasSections, Lines

__all__ = ["Balance", "bound_circulation"]

# Circulation, over the largest, by which the law of Kutta and Joukowski may be missed. Larger: loads that do not balance are called
# balanced. Smaller: Newton's method circles in rounding. Pinned by test_the_lift_of_every_strip_is_that_of_its_circulation.
BALANCED = 1e-9
# Newton steps, and halvings of one. Below stall two or three full steps are enough.
MOST_STEPS, MOST_HALVINGS = 40, 10


@dataclass(frozen=True)
class Balance:
    """``circulation`` (b, n) m^2/s, ``wind`` (b, n, 3) m/s relative to the strips where the angle is taken, ``residual`` over the largest
    circulation.
    """

    circulation: np.ndarray
    wind: np.ndarray
    residual: float
    steps: int


def bound_circulation(
    lines: Lines, sections: HasSections, known: np.ndarray, influence: np.ndarray, guess: np.ndarray
) -> Balance:
    """Circulations whose lift is that of the polars.

        Gamma = |W| c cl(alpha(W)) / 2,   W = known + influence Gamma + n Gamma / (2 pi d)

    W is the wind at three quarters of the chord, d behind the bound vortex, without what an infinite straight one there would induce
    across the chord (along n): a section's polar holds this. For a flat plate it is Weissinger's method, which sees the finite chord
    at the tips, and with long blades Prandtl's lifting line.

    Parameters
    ----------
    lines, sections
        The b blades of n strips.
    known
        (b, n, 3) m/s: wind relative to the strips without what their unknown circulations induce.
    influence
        (b n, b n, 3) 1/m: velocity at each strip's rear point of the unknown circulation of each, bound vortices included.
    guess
        (b, n) m^2/s.

    Returns
    -------
    Balance
        A residual beyond ``BALANCED`` means that Newton's method found no balance, as may happen in stall.

    Notes
    -----
    J. Weissinger, NACA TM 1120 (1947).
    """
    shape = guess.shape
    behind = np.linalg.norm(lines.rear - lines.points, axis=-1)[..., None]
    i = np.arange(guess.size)
    influence = influence.copy()
    influence[i, i] += (lines.suction / (2.0 * np.pi * behind)).reshape(-1, 3)

    def rest(gamma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        wind = known + np.einsum("ijc,j->ic", influence, gamma).reshape(*shape, 3)
        angle, speed, _ = lines.angles(wind)
        lift = sections.coefficients(angle)[..., 0]
        return gamma - (0.5 * sections.chord * speed * lift).ravel(), wind

    gamma = guess.ravel()
    r, wind = rest(gamma)
    scale = np.max(np.abs(gamma)) + np.max(np.abs(r))
    step = 0
    while np.max(np.abs(r)) > BALANCED * scale and step < MOST_STEPS:
        change = np.linalg.solve(_tangent(lines, sections, wind, influence), r)
        share = 1.0
        for _ in range(MOST_HALVINGS):
            trial = gamma - share * change
            r_trial, wind_trial = rest(trial)
            if np.linalg.norm(r_trial) < (1.0 - 0.1 * share) * np.linalg.norm(r):
                break
            share *= 0.5
        gamma, r, wind = trial, r_trial, wind_trial
        scale = max(scale, np.max(np.abs(gamma)))
        step += 1
    largest = np.max(np.abs(r))
    return Balance(gamma.reshape(shape), wind, float(largest / scale) if largest else 0.0, step)


def _tangent(lines: Lines, sections: HasSections, wind: np.ndarray, influence: np.ndarray) -> np.ndarray:
    """Derivative of the rest by the circulations."""
    angle, speed, _ = lines.angles(wind)
    safe = np.where(speed > 0.0, speed, 1.0)
    lift, slope = sections.coefficients(angle)[..., 0], sections.coefficients(angle, slope=True)[..., 0]
    normal, along = np.sum(wind * lines.suction, axis=-1), -np.sum(wind * lines.forward, axis=-1)
    # derivatives of the speed and of the angle by the wind
    by_speed = (normal / safe)[..., None] * lines.suction - (along / safe)[..., None] * lines.forward
    by_angle = ((along / safe**2)[..., None] * lines.suction) + (normal / safe**2)[..., None] * lines.forward
    by_wind = 0.5 * sections.chord[:, None] * (lift[..., None] * by_speed + (speed * slope)[..., None] * by_angle)
    matrix = -np.einsum("ic,ijc->ij", by_wind.reshape(-1, 3), influence)
    matrix[np.diag_indices_from(matrix)] += 1.0
    return matrix
