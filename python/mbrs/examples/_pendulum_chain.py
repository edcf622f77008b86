"""A chain of uniform rods that swings in a plane."""

from __future__ import annotations

from ..model.model import Model
from ._links import rod


def pendulum_chain(n: int = 40, length: float = 2.0, mass: float = 2.0, gravity: float = 9.81) -> Model:
    """A chain of ``n`` equal rods, drawn level and at rest, that falls: hinges "h0" ... about z, rods "link0" ...

    ``length`` m and ``mass`` kg of the whole chain, ``gravity`` m/s2 downwards (-y); marker "end" on the last rod's free
    end. Data invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.pendulum_chain(5)).dof
    5
    """
    m = Model(f"chain of {n} rods", gravity=(0.0, -gravity, 0.0))
    h, before = length / n, m.ground
    for i in range(n):
        link = rod(m, f"link{i}", [(i * h, 0), ((i + 1) * h, 0)], mass / n)
        m.revolute(f"h{i}", before, link, at=(i * h, 0, 0), axis="z")
        before = link
    m.marker("end", before, at=(length, 0, 0))
    return m
