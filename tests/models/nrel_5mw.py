"""The rotor of the NREL 5 MW reference turbine: as much of its public definition as the tests need.

J. Jonkman, S. Butterfield, W. Musial, G. Scott, NREL/TP-500-38060 (2009), tables 2-1 and 3-1; sections by DOWEC 10046_009, corrected for
rotation by J. Jonkman, as in github.com/OpenFAST/r-test, glue-codes/openfast/5MW_Baseline.
"""

from __future__ import annotations

from functools import lru_cache

import mbrs as mb
import numpy as np

HUB, TIP, PRECONE = 1.5, 63.0, np.radians(2.5)
# Tilt of the shaft and weight of the rotor, kg.
TILT, MASS = np.radians(5.0), 110e3

# distance from the axis (m), twist (degrees), chord (m), section
_STATIONS = """
 2.8667 13.308 3.542 cylinder1
 5.6000 13.308 3.854 cylinder1
 8.3333 13.308 4.167 cylinder2
11.7500 13.308 4.557 du40
15.8500 11.480 4.652 du35
19.9500 10.162 4.458 du35
24.0500  9.011 4.249 du30
28.1500  7.795 4.007 du25
32.2500  6.544 3.748 du25
36.3500  5.361 3.502 du21
40.4500  4.188 3.256 du21
44.5500  3.125 3.010 naca64
48.6500  2.319 2.764 naca64
52.7500  1.526 2.518 naca64
56.1667  0.863 2.313 naca64
58.9000  0.370 2.086 naca64
61.6333  0.106 1.419 naca64
"""

# degrees, lift, drag: the angles that a rotor at its best speed meets, each or each other degree of the tables
_POLARS = {
    "cylinder1": "-180 0 .5  180 0 .5",
    "cylinder2": "-180 0 .35  180 0 .35",
    "du40": """
-4 -.054 .0411  -3 .003 .0299  -2 .009 .0198  -1 .036 .0147  0 .137 .0113  1 .292 .0118  2 .444 .0124  3 .580 .0123
4 .710 .0119  5 .841 .0125  6 .967 .0135  7 1.084 .0158  8 1.193 .0198  9 1.287 .0275  10 1.368 .0393  11 1.425 .0580
12 1.473 .0816  13 1.513 .1129  14.5 1.587 .1650  16 1.649 .2250  17 1.681 .2684  18 1.719 .3121  19 1.751 .3554
21 1.810 .4415  23 1.847 .5257  25 1.872 .6141  28 1.894 .7513  30 1.904 .8441  35 1.929 1.0722
""",
    "du35": """
-3 -.240 .0240  -2 -.091 .0160  -1 .052 .0118  0 .196 .0094  1 .335 .0098  2 .472 .0100  3 .608 .0103  4 .742 .0105
5 .875 .0108  6 1.007 .0110  7 1.134 .0115  8 1.260 .0120  9 1.368 .0133  10 1.475 .0156  11 1.570 .0194  12 1.642 .0269
13 1.700 .0398  14 1.712 .0614  15.5 1.671 .1173  16.5 1.621 .1600  18 1.549 .2316  20 1.565 .3085  22 1.563 .3820
25 1.546 .4988  30 1.522 .6978
""",
    "du30": """
-4 -.251 .0091  -3 -.120 .0089  -2 .017 .0088  -1 .152 .0088  0 .288 .0087  1 .421 .0088  2 .554 .0090  3 .685 .0092
4 .815 .0095  5 .944 .0097  6 1.072 .0101  7 1.197 .0107  8 1.305 .0125  9 1.390 .0155  10 1.458 .0192  11 1.512 .0255
12 1.549 .0370  12.5 1.558 .0452  13 1.470 .0630  14 1.354 .0931  15 1.333 .1239  17 1.321 .1903  20 1.398 .2689
""",
    "du25": """
-4 -.084 .0070  -3 .049 .0068  -2 .181 .0068  -1 .312 .0067  0 .444 .0065  1 .573 .0066  2 .701 .0068  3 .827 .0070
4 .952 .0073  5 1.062 .0079  6 1.161 .0099  7 1.254 .0132  8 1.336 .0153  9 1.400 .0181  10 1.442 .0262  11 1.374 .0420
12 1.277 .0601  13 1.246 .0785  15 1.271 .1219  17 1.304 .1649  20 1.354 .2280
""",
    "du21": """
-4 .016 .0063  -3 .145 .0058  -2 .270 .0057  -1 .396 .0057  0 .521 .0057  1 .645 .0058  2 .768 .0059  3 .888 .0063
4 .996 .0071  5 1.095 .0090  6 1.192 .0113  7 1.283 .0131  8 1.358 .0147  9 1.403 .0181  10 1.358 .0255  11 1.287 .0347
12 1.272 .0468  14 1.272 .0806  16 1.284 .1170  18 1.308 .1562  20 1.311 .1987
""",
    "naca64": """
-6 -.264 .0082  -5 -.151 .0079  -4 -.017 .0072  -3 .088 .0064  -2 .213 .0054  -1 .328 .0052  0 .442 .0052  1 .556 .0052
2 .670 .0053  3 .784 .0053  4 .898 .0054  5 1.011 .0058  6 1.103 .0091  7 1.181 .0113  8 1.257 .0124  9 1.326 .0136
10 1.382 .0150  11 1.415 .0383  12 1.434 .0613  13 1.451 .0841  15 1.445 .1287  17 1.438 .1728  20 1.428 .2379
""",
}

# fraction of the blade, degrees of twist, kg/m, flapwise and edgewise stiffness in N m2
_STRUCTURE = """
0      13.308 678.935 1.8110e10 1.8114e10
.01951 13.308 773.363 1.9425e10 1.9559e10
.05203 13.308 740.042 1.5287e10 1.9789e10
.06829 13.308 592.496 1.0782e10 1.4859e10
.08455 13.308 450.275 7.2297e9  1.0222e10
.11707 13.308 400.638 5.5284e9  8.0632e9
.13335 13.308 382.062 4.9801e9  6.8844e9
.16585 13.308 426.321 4.6917e9  7.1677e9
.19837 12.848 406.186 3.3865e9  7.0817e9
.23089 11.561 352.822 2.5690e9  5.0490e9
.26341 10.792 346.538 2.2720e9  4.8080e9
.32846  9.672 330.004 1.8283e9  4.2441e9
.39350  8.534 313.820 1.3619e9  3.7508e9
.45855  7.321 287.120 8.7580e8  3.1391e9
.49106  6.711 263.343 6.8130e8  2.7342e9
.52358  6.122 253.207 5.3472e8  2.5549e9
.55610  5.546 241.666 4.0890e8  2.3340e9
.58862  4.971 220.638 3.1454e8  1.8287e9
.62115  4.401 200.293 2.3863e8  1.5841e9
.65366  3.834 179.404 1.7588e8  1.3234e9
.68618  3.332 165.094 1.2601e8  1.1837e9
.75122  2.503 138.935 9.0880e7  7.9781e8
.81626  1.730 107.264 6.1050e7  5.1819e8
.88130   .954  90.248 3.9360e7  3.9512e8
.93008   .404  68.772 2.6520e7  2.8142e8
.95447   .216  55.914 1.6000e7  1.3788e8
.97073   .140  49.114 1.0080e7  1.0163e8
.98699   .062  41.669 4.6000e6  6.4260e7
.99512   .023  11.453 2.5000e5  6.6100e6
1      0       10.319 1.7000e5  5.0100e6
"""
_MASS_FACTOR, _DAMPING = 1.04536, 0.00477465

_ROWS = [row.split() for row in _STATIONS.split("\n") if row]
STATIONS, TWIST, CHORD = np.array([[float(v) for v in row[:3]] for row in _ROWS]).T


def polars():
    """The eight sections by name."""
    made = {}
    for name, text in _POLARS.items():
        angle, lift, drag = np.array(text.split(), dtype=float).reshape(-1, 3).T
        made[name] = mb.aero.polar(np.radians(angle), lift, drag, name=name)
    return made


def blade(ends=False, **more):
    """The blade; with ``ends`` from the hub to the tip, as the nearest station is."""
    known = polars()
    x, twist, chord, along = STATIONS, TWIST, CHORD, [known[row[3]] for row in _ROWS]
    if ends:
        x, twist, chord = np.r_[HUB, x, TIP], np.r_[twist[0], twist, twist[-1]], np.r_[chord[0], chord, chord[-1]]
        along = [along[0], *along, along[-1]]
    return mb.aero.blade(x, chord, np.radians(twist), along, **more)


def rotor():
    """The rotor without structure."""
    return mb.aero.rotor(blade(), 3, hub_radius=HUB, tip_radius=TIP, precone=PRECONE)


@lru_cache
def structure(modes=3):
    """The elastic blade from the hub to the tip."""
    x, twist, mass, flap, edge = np.array(_STRUCTURE.split(), dtype=float).reshape(-1, 5).T
    return mb.flexible.beam(
        x * (TIP - HUB), mass=_MASS_FACTOR * mass, EI_flap=flap, EI_edge=edge, twist=-np.radians(twist), modes=modes,
        damping=_DAMPING,
    )  # fmt: skip


def model(speed, wind, tilt=0.0, flexible=True, sections=30, **more):
    """The rotor on a hub that a drive turns at ``speed`` rad/s, blade 1 upwards; ``wind`` is of mb.aero.wind."""
    m = mb.Model("NREL 5 MW")
    axis = np.array([np.cos(tilt), 0.0, -np.sin(tilt)])  # the upper blade leans down the wind
    spin = {"angular_velocity": speed * axis}
    hub = m.body("hub", mass=56780.0, inertia=(1.2e5, 1.2e5, 1.2e5), at=(0, 0, 0), **spin)
    m.drive("turning", m.revolute("bearing", m.ground, hub, at=(0, 0, 0), axis=axis), mb.Ramp(speed))
    up, blades = np.cross(axis, [0.0, 1.0, 0.0]), []
    for i in range(3):
        psi = 2 * np.pi * i / 3
        radial = np.cos(psi) * up + np.sin(psi) * np.cross(axis, up)
        # coned up the wind
        out = np.cos(PRECONE) * radial - np.sin(PRECONE) * axis
        ahead = np.cross(axis, radial)
        frame = {"at": HUB * out, "orientation": np.stack([out, ahead, np.cross(out, ahead)], axis=1),
                 "velocity": np.cross(speed * axis, HUB * out), **spin}  # fmt: skip
        name = f"blade{i + 1}"
        if flexible:
            body = m.flexible_body(name, structure(), **frame)
            m.fixed(f"root{i + 1}", hub, body.node("root"))
        else:
            body = m.body(name, mass=17740.0, inertia=(1e3, 4e6, 4e6), com=(20.5, 0, 0), **frame)
            m.fixed(f"root{i + 1}", hub, body, at=HUB * out)
        blades.append(blade(ends=True, body=name, root=HUB, sections=sections))
    m.aerodynamics("air", blades, wind=wind, inflow="bem", axis=axis, **more)
    return m
