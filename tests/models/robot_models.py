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


def orientation(rng):
    """One of MJCF's ways to give an orientation, angles in degrees."""
    return str(
        rng.choice(
            [
                f'quat="{text(rng.normal(size=4))}"',
                f'axisangle="{text(*rng.normal(size=3), 180 * rng.random())}"',
                f'euler="{text(100 * rng.normal(size=3))}"',
                f'xyaxes="{text(rng.normal(size=6))}"',
                f'zaxis="{text(rng.normal(size=3))}"',
            ]
        )
    )


def geoms(rng):
    """One or two solids, by mass or density, placed or from point to point."""
    out = ""
    for kind in rng.choice(["sphere", "capsule", "cylinder", "ellipsoid", "box"], size=1 + int(rng.random() < 0.4)):
        mass = f'mass="{0.5 + rng.random()!r}"' if rng.random() < 0.5 else f'density="{500 + 900 * rng.random()!r}"'
        size = 0.05 + 0.1 * rng.random(3)
        if kind in ("capsule", "cylinder", "box", "ellipsoid") and rng.random() < 0.4:
            place = f'fromto="{text(0.3 * rng.normal(size=6))}" size="{float(size[0])!r}"'
        else:
            place = f'pos="{text(0.2 * rng.normal(size=3))}" size="{text(size)}" {orientation(rng)}'
        out += f'<geom type="{kind}" {mass} {place}/>'
    return out


def inertia_element(rng):
    """An <inertial>, diagonal in its own frame or full in the body's axes."""
    mass = 0.5 + rng.random()
    i = tensor(rng, mass)
    place = f'mass="{float(mass)!r}" pos="{text(0.2 * rng.normal(size=3))}"'
    if rng.random() < 0.5:
        full = text(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
        return f'<inertial {place} fullinertia="{full}"/>'
    return f'<inertial {place} {orientation(rng)} diaginertia="{text(np.linalg.eigvalsh(i))}"/>'


def joint(rng, kind, name, forces=True):
    """Springs with rest positions, dampers; drawn at a reference that is not zero."""
    given = ""
    if kind in ("hinge", "slide"):
        given = f' axis="{text(rng.normal(size=3))}"'
        if forces:
            given += f' springref="{float(rng.normal())!r}" ref="{float(rng.normal())!r}"'
    if forces:
        given += f' stiffness="{5 + 20 * float(rng.random())!r}" damping="{0.1 + float(rng.random())!r}"'
    return f'<joint name="{name}" type="{kind}" pos="{text(0.2 * rng.normal(size=3))}"{given}/>'


def random_mjcf(rng, n=6, kinds=("hinge", "slide"), extra="", forces=True, compiler=""):
    """A tree of n bodies, inertias from geoms or given, orientations of every kind; children of body i are nested in it."""
    children = {i: [] for i in range(-1, n)}
    for i in range(n):
        children[int(rng.integers(max(-1, i - 3), i))].append(i)

    def body(i):
        inner = "".join(body(j) for j in children[i])
        mass = geoms(rng) if rng.random() < 0.6 else inertia_element(rng)
        made = joint(rng, str(rng.choice(kinds)), f"joint{i}", forces)
        site = f'<site name="site{i}" pos="{text(0.2 * rng.normal(size=3))}" {orientation(rng)}/>'
        return f'<body name="body{i}" pos="{text(0.4 * rng.normal(size=3))}" {orientation(rng)}>{made}{mass}{site}{inner}</body>'

    bodies = "".join(body(i) for i in children[-1])
    gravity = f'<option gravity="{text(rng.normal(size=3) * (1, 2, 9))}"/>'
    return f'<mujoco model="random">{compiler}{gravity}<worldbody>{bodies}</worldbody>{extra}</mujoco>'
