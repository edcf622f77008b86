"""Velocities that straight vortex filaments induce."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import choice, count, each, real_array, real_number
from ..errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["induced_velocity"]

CORES = ("rosenhead-moore", "lamb-oseen", "vatistas")


def induced_velocity(
    points: ArrayLike,
    start: ArrayLike,
    end: ArrayLike,
    circulation: ArrayLike,
    *,
    core_radius: ArrayLike = 0.0,
    core: str = "rosenhead-moore",
    exponent: float = 2.0,
    threads: int = 0,
) -> np.ndarray:
    """Velocities of straight vortex filaments by the law of Biot and Savart, with cores.

        v = sum Gamma / (4 pi) (r1 x r2) (R1 + R2) / (R1 R2 (R1 R2 + r1.r2)) K(h),   r1 = p - start,   r2 = p - end

    Parameters
    ----------
    points
        (..., 3) m, in any axes that do not turn.
    start, end
        (m, 3) m: the circulation is positive about the direction from start to end.
    circulation
        (m,) m^2/s, or one number.
    core_radius
        (m,) m, or one number; not negative. 0 is a line: on it the velocity is that of the other filaments.
    core
        "rosenhead-moore": the kernel 1 / (r^2 + rc^2)^(3/2), exact along each filament. "lamb-oseen": K = 1 - exp(-1.2564 h^2 /
        rc^2). "vatistas": K = h^2 / (h^(2n) + rc^(2n))^(1/n) with n the ``exponent``, 1 or more (1: Scully; 2 is close to
        "lamb-oseen"). h is the distance from the filament's line, rc the radius where the swirl is largest.
    exponent
        Of "vatistas".
    threads
        1 to 1000; 0 for as many as the machine has. The bits of the answer do not depend on it.

    Returns
    -------
    ndarray
        (..., 3) m/s.

    Raises
    ------
    ModelError
        Shapes that do not fit, nan, a negative radius, an unknown core.

    Notes
    -----
    Cost O(points m), in double precision, in chunks of eight points. L. Rosenhead, Proc. R. Soc. A 134 (1931) 170; D. W. Moore,
    Proc. R. Soc. A 272 (1963) 403; G. H. Vatistas, V. Kozel and W. C. Mih, Exp. Fluids 11 (1991) 73; P. G. Saffman, "Vortex
    Dynamics" (1992), chapters 2, 10, 11.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> mb.aero.induced_velocity([0.5, 0.0, 0.0], [[0.0, 0.0, -1e6]], [[0.0, 0.0, 1e6]], 2 * np.pi).round(6)
    array([0., 2., 0.])
    """
    p = real_array("induced_velocity: points", points)
    a, b = real_array("induced_velocity: start", start), real_array("induced_velocity: end", end)
    if p.ndim == 0 or p.shape[-1] != 3:
        raise ModelError(f"induced_velocity: points must end in three coordinates, their shape is {p.shape}")
    if a.ndim != 2 or a.shape[1] != 3 or b.shape != a.shape:
        raise ModelError(f"induced_velocity: start and end must both be (m, 3), they are {a.shape} and {b.shape}")
    given = (("circulation", circulation), ("core_radius", core_radius))
    strength, radius = (each(f"induced_velocity: {name}", v, len(a), "filaments") for name, v in given)
    if np.any(radius < 0.0):
        raise ModelError(f"induced_velocity: core_radius must not be negative, it is {radius.min():g} m")
    n = real_number("induced_velocity: exponent", exponent, 1.0)
    choice("core of filaments", core, CORES)
    count("induced_velocity: threads", threads, 1000, 0)
    flat = np.ascontiguousarray(p.reshape(-1, 3))
    with core_errors():
        found = _core.induced_velocity(flat, a, b, strength, radius, core, float(n), int(threads))
    return found.reshape(p.shape)
