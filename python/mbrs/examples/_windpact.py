"""Public data of the WindPACT 1.5 MW turbine: a stand-in for the rotor of the derivative-free solver's paper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

HUB_RADIUS = 1.75  # m
BLADE_LENGTH = 33.25  # m, from the hub's radius to the tip at 35 m
HUB_MASS, HUB_INERTIA = 15148.0, 34600.0  # kg, kg m2 about the shaft
NACELLE_MASS, NACELLE_YAW_INERTIA = 51170.0, 49130.0  # kg, kg m2
OVERHANG = 3.3  # m, from the tower's axis to the hub
TILT = np.radians(5.0)
HUB_HEIGHT = 84.0  # m, of the shaft on the tower's axis
DAMPING = {"flap": 0.03882, "edge": 0.059}  # ratio of critical
SPEED = 17.2 * 2 * np.pi / 60  # rad/s: of the paper's rotor, not of this turbine

# span fraction, kg/m, N m2 flapwise, N m2 edgewise
_DISTRIBUTION = """
0        1447.607  7.68146e9  7.68146e9
.02105   180.333   1.16987e9  1.16987e9
.05263   181.672   1.02062e9  1.09228e9
.10526   183.905   7.7188e8   9.6297e8
.15789   186.138   5.2314e8   8.3366e8
.21053   188.37    2.744e8    7.0435e8
.26316   178.321   2.3457e8   6.1465e8
.31579   168.271   1.9474e8   5.2496e8
.36842   158.222   1.549e8    4.3526e8
.42105   148.172   1.1507e8   3.4557e8
.47368   138.123   7.523e7    2.5587e8
.52632   122.896   6.249e7    2.1787e8
.57895   107.669   4.975e7    1.7986e8
.63158   92.442    3.701e7    1.4186e8
.68421   77.215    2.427e7    1.0385e8
.73684   61.988    1.153e7    6.585e7
.78947   51.861    9.27e6     5.425e7
.84211   41.734    7.01e6     4.266e7
.89474   31.607    4.75e6     3.106e7
.94737   21.48     2.49e6     1.947e7
1        11.353    2.3e5      7.87e6
"""
# degrees: 11.1 up to the sixth station, then
_TWIST = (9.5, 7.9, 6.3, 4.7, 3.1, 2.6, 2.1, 1.6, 1.1, 0.6, 0.48, 0.36, 0.24, 0.12, 0.0)


# Chord over the distance from the axis, m: invented, of the size of a 1.5 MW blade.
CHORD_AT = (1.75, 5.1, 9.5, 13.9, 18.4, 22.8, 27.2, 31.7, 35.0)
CHORD = (1.9, 2.3, 2.7, 2.4, 2.1, 1.75, 1.43, 1.13, 0.95)


@dataclass(frozen=True)
class BladeData:
    """Distributions over the stations (n,): place from the root (m), kg/m, N m2, N m2, rad."""

    station: np.ndarray
    mass: np.ndarray
    EI_flap: np.ndarray
    EI_edge: np.ndarray
    twist: np.ndarray


def windpact_blade() -> BladeData:
    """The blade of the WindPACT 1.5 MW turbine: stations (m), mass (kg/m), stiffness (N m2), structural twist (rad).

    Source: OpenFAST r-test, ``WP_Baseline/Baseline_Blade.dat`` (public). It is a stand-in for the 40 m blade of the
    paper (J. Algorithms Comput. Technol. 2017, doi 10.1177/1748301817729990), whose data were not published.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> blade = mb.examples.windpact_blade()
    >>> round(float(np.trapezoid(blade.mass, blade.station)), 1)
    4355.9
    """
    rows = np.array([[float(v) for v in line.split()] for line in _DISTRIBUTION.split("\n") if line])
    twist = np.radians(np.concatenate([np.full(6, 11.1), _TWIST]))
    return BladeData(BLADE_LENGTH * rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], twist)
