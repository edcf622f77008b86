"""The cubic hexapod: six legs along edges of a cube, which decouples all six motions of the payload."""

from __future__ import annotations

import numpy as np

from ..errors import ModelError
from ..model.model import Model

Pair = tuple[tuple[float, float, float], tuple[float, float, float]]


def cubic_hexapod_points(edge: float = 0.2, centre: tuple[float, float, float] = (0.0, 0.0, 0.1)) -> list[Pair]:
    """End points of the six legs of a cubic configuration, base first.

    The cube rests on a corner: its diagonal is vertical. The legs are the six edges that touch neither the lowest nor
    the highest corner; two are parallel to each of the cube's directions u_i, hence K = diag(2k, 2k, 2k,
    k L^2/2, k L^2/2, 2 k L^2) at the centre.

    Parameters
    ----------
    edge
        L, m, positive.
    centre
        (3,), m, world: the middle of the cube, where the payload's centre of mass belongs.

    Returns
    -------
    Six pairs (base point, payload point) of world points.

    Notes
    -----
    Source: the closed form is derived here from K = sum k [u; r x u][u; r x u]^T; it is the known result for cubic
    hexapods.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a, b = mb.examples.cubic_hexapod_points(edge=0.2)[0]
    >>> round(float(np.linalg.norm(np.subtract(b, a))), 12)
    0.2
    """
    if not edge > 0.0:
        raise ModelError(f"the edge of the cube must be positive, got {edge!r}")
    azimuth = np.arange(3) * 2.0 * np.pi / 3.0
    # Three orthonormal edge directions around the vertical: each rises by 1/sqrt(3).
    u = np.column_stack(
        [np.cos(azimuth) * np.sqrt(2 / 3), np.sin(azimuth) * np.sqrt(2 / 3), np.full(3, np.sqrt(1 / 3))]
    )
    lowest = np.asarray(centre, dtype=float) - 0.5 * edge * u.sum(axis=0)
    legs = []
    for i in range(3):
        for j in ((i + 1) % 3, (i + 2) % 3):
            legs.append((_point(lowest + edge * u[i]), _point(lowest + edge * (u[i] + u[j]))))
    return legs


def _point(p: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in p)
    return (x, y, z)


def cubic_hexapod(
    edge: float = 0.2, k: float = 1e5, c: float = 30.0, mass: float = 20.0, inertia: float = 0.15, height: float = 0.1
) -> Model:
    """The isolator of docs/theory.md (23.1): parameters "k_leg" and "c_leg", body "payload", springs "leg0" to "leg5".

    With the defaults 15.9155 Hz three times, 18.3776 Hz twice, 36.7553 Hz: sqrt(2k/m), sqrt(k L^2/(2I)), sqrt(2k
    L^2/I). ``edge`` m, ``k`` N/m, ``c`` N s/m, ``mass`` kg, ``inertia`` kg m2 about every axis, ``height`` m of the
    centre.
    """
    m = Model("isolator")
    centre = (0.0, 0.0, height)
    p = m.body("payload", mass=mass, inertia=(inertia, inertia, inertia), at=centre)
    k_leg, c_leg = m.parameter("k_leg", k, unit="N/m"), m.parameter("c_leg", c, unit="N s/m")
    for i, (a, b) in enumerate(cubic_hexapod_points(edge, centre)):
        m.spring_damper(f"leg{i}", m.ground, p, at=(a, b), k=k_leg, c=c_leg)
    return m
