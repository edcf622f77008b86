"""The nonholonomic point mass of docs/theory.md (23.13), y' = b z x': one body and one row of velocities."""

from __future__ import annotations

from ..model.model import Model

START, SPEED = (1.0, 0.0, 0.5), 1.0


def nonholonomic_particle(mass: float = 1.0, stiffness: float = 10.0, b: float = 1.0) -> Model:
    """A point (x, y, z) of mass m on springs k to the origin whose velocity obeys y' = b z x'; starts at (1, 0, 0.5), x' = 1.

    Parameters "m" (kg), "k" (N/m), "b" (1/m); body "point", which does not turn.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.nonholonomic_particle()
    >>> mb.simulate(m, t=5.0, rtol=1e-10).position("point")[-1].round(6).tolist()
    [-0.851974, 0.310797, -0.497328]
    """
    m = Model("nonholonomic particle")
    p, k, r = (
        m.parameter("m", mass, unit="kg"),
        m.parameter("k", stiffness, unit="N/m"),
        m.parameter("b", b, unit="1/m"),
    )
    z = START[2]
    point = m.body("point", mass=p, inertia=(1, 1, 1), at=START, velocity=(SPEED, r * z * SPEED, 0))
    m.bushing("springs", m.ground, point, at=((0, 0, 0), START), k=(k, k, k, 0, 0, 0))
    motions = [point.motion("x"), point.motion("y"), point.motion("z")]
    m.velocity_constraint("row", lambda t, u: [-r * (u[2] + z), 1.0, 0.0], motions)
    return m
