"""Random robots as URDF and MJCF text, nothing along x, y, z, and what other programs make of them."""

from __future__ import annotations

import numpy as np

KINDS = ("revolute", "continuous", "prismatic")


def text(*values):
    return " ".join(repr(float(v)) for v in np.ravel(values))


def tensor(rng, mass):
    """Inertia of six points, always physical, rounded to nothing."""
    points = 0.3 * rng.normal(size=(6, 3))
    points -= points.mean(axis=0)
    return mass / 6 * sum((p @ p) * np.eye(3) - np.outer(p, p) for p in points)


def urdf_link(rng, name):
    mass = 0.3 + 2.0 * rng.random()
    i = tensor(rng, mass).tolist()
    return (
        f'<link name="{name}"><inertial><origin xyz="{text(0.2 * rng.normal(size=3))}" rpy="{text(rng.normal(size=3))}"/>'
        f'<mass value="{float(mass)!r}"/><inertia ixx="{i[0][0]!r}" ixy="{i[0][1]!r}" ixz="{i[0][2]!r}" iyy="{i[1][1]!r}" '
        f'iyz="{i[1][2]!r}" izz="{i[2][2]!r}"/></inertial></link>'
    )


def random_urdf(rng, n=6, kinds=KINDS, extra=""):
    """A tree of n links with mass on a base without."""
    parts = ['<link name="base"/>']
    names = ["base"]
    for i in range(n):
        kind = str(rng.choice(kinds))
        parts.append(urdf_link(rng, f"link{i}"))
        parent = names[int(rng.integers(max(0, len(names) - 3), len(names)))]
        limit = (
            '<limit lower="-1.5" upper="1.25" effort="10" velocity="2"/>' if kind in ("revolute", "prismatic") else ""
        )
        parts.append(
            f'<joint name="joint{i}" type="{kind}"><parent link="{parent}"/><child link="link{i}"/>'
            f'<origin xyz="{text(0.5 * rng.normal(size=3))}" rpy="{text(rng.normal(size=3))}"/>'
            f'<axis xyz="{text(rng.normal(size=3))}"/>{limit}</joint>'
        )
        names.append(f"link{i}")
    return f'<robot name="random">{"".join(parts)}{extra}</robot>'


def mbrs_dynamics(m, rates):
    """M and M^-1 h of a model at its drawn pose, rows by joint name, with the rates of bodies {name: (v, w)}."""
    import mbrs as mb

    m = m.copy()
    for name, (v, w) in rates.items():
        m.set({f"{name}.velocity": v, f"{name}.angular_velocity": w})
    traj = mb.simulate(m, t=[0.0, 1e-9], method="explicit", step=1e-9)
    return traj.acceleration[0]
