"""Tables dicts by hand, for the tests of the NumPy reference (docs/tables.md). Data without a source are invented."""

from __future__ import annotations

from typing import Any

import numpy as np

JOINTS = ["fixed", "revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "free"]
JOINTS += ["distance", "knife_edge", "rolling_disc"]
ELEMENTS = ["spring_damper", "bushing", "torsion"]


def quaternion(axis, angle):
    axis = np.asarray(axis, float)
    return np.r_[np.cos(angle / 2), np.sin(angle / 2) * axis / np.linalg.norm(axis)]


def random_quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def diagonal_or_full(k):
    k = np.asarray(k, float)
    return (np.diag(k) if k.ndim == 1 else k).ravel()


class Builder:
    """Collects numbers in x and writes where they are."""

    def __init__(self, gravity=None):
        self.x, self.address = [], {}
        self.t: dict[str, Any] = {"gravity_x": np.array([-1])}
        for group, keys in (
            ("body", "name x"),
            ("joint", "name type a b flags x"),
            ("element", "name type a b flags x"),
            ("load", "name type body frame x"),
            ("marker", "name body x"),
            ("law", "owner_kind owner component type n x"),
        ):
            self.t.update({f"{group}_{k}": [] for k in keys.split()})
        if gravity is not None:
            self.t["gravity_x"] = np.array([self._numbers("gravity", gravity)])

    def _numbers(self, name, *parts):
        start = len(self.x)
        for p in parts:
            self.x.extend(np.ravel(np.asarray(p, float)))
        self.address[name] = start
        return start

    def _append(self, group, **values):
        for k, v in values.items():
            self.t[f"{group}_{k}"].append(v)

    def index(self, body):
        return -1 if body is None else self.t["body_name"].index(body)

    def body(
        self,
        name,
        mass=1.0,
        inertia=(1, 1, 1, 0, 0, 0),
        at=(0, 0, 0),
        q=(1, 0, 0, 0),
        com=(0, 0, 0),
        v=(0, 0, 0),
        w=(0, 0, 0),
    ):
        inertia = np.r_[np.asarray(inertia, float), np.zeros(6)][:6]
        self._append("body", name=name, x=self._numbers(name, at, q, com, mass, inertia, v, w))
        return name

    def joint(
        self,
        name,
        kind,
        a,
        b,
        at,
        axis=(0, 0, 1),
        axis2=(1, 0, 0),
        q=None,
        k=None,
        c=None,
        preload=None,
        length=None,
        at_b=None,
    ):
        pad = lambda v: np.r_[np.zeros(0) if v is None else np.atleast_1d(v), np.zeros(6)][:6]  # noqa: E731
        flags = (
            (k is not None)
            + 2 * (c is not None)
            + 4 * (preload is not None)
            + 8 * (q is not None)
            + 16 * (length is not None)
        )
        numbers = (
            at,
            at if at_b is None else at_b,
            axis,
            axis2,
            (1, 0, 0, 0) if q is None else q,
            pad(k),
            pad(c),
            pad(preload),
        )
        start = self._numbers(name, *numbers, 0.0 if length is None else length, 0.0, 0.0)
        self._append(
            "joint", name=name, type=JOINTS.index(kind), a=self.index(a), b=self.index(b), flags=flags, x=start
        )

    def spring(self, name, a, b, at_a, at_b, k=None, c=None, length=None, preload=None):
        flags = (k is not None) + 2 * (c is not None) + 4 * (preload is not None) + 16 * (length is not None)
        start = self._numbers(name, at_a, at_b, k or 0, c or 0, length or 0, preload or 0)
        self._append("element", name=name, type=0, a=self.index(a), b=self.index(b), flags=flags, x=start)

    def bushing(self, name, a, b, at, k, c=None, preload=None, q=(1, 0, 0, 0), at_b=None):
        flags = 1 + 2 * (c is not None) + 4 * (preload is not None)
        c = np.zeros(36) if c is None else diagonal_or_full(c)
        preload = np.zeros(6) if preload is None else preload
        start = self._numbers(name, at, at if at_b is None else at_b, q, diagonal_or_full(k), c, preload)
        self._append("element", name=name, type=1, a=self.index(a), b=self.index(b), flags=flags, x=start)

    def torsion(self, name, a, b, at, axis, k, c=0.0, angle=0.0, preload=0.0):
        start = self._numbers(name, at, axis, k, c, angle, preload)
        self._append("element", name=name, type=2, a=self.index(a), b=self.index(b), flags=7, x=start)

    def load(self, name, kind, body, at, value, follower=False):
        start = self._numbers(name, at, value)
        self._append("load", name=name, type=int(kind == "torque"), body=self.index(body), frame=int(follower), x=start)

    def tables(self):
        return {**self.t, "x": np.array(self.x)}


def hanging_rod():
    b = Builder(gravity=(0, -9.81, 0))
    b.body("rod", 1.0, (1 / 12, 1e-3, 1 / 12), at=(0, -0.5, 0))
    b.joint("hinge", "revolute", None, "rod", (0, 0, 0))
    return b


def hanging_four_bar(kind="revolute"):
    b = Builder(gravity=(0, -9.81, 0))
    b.body("left", 1.0, (1 / 12, 1e-3, 1 / 12), at=(0, -0.5, 0))
    b.body("right", 1.0, (1 / 12, 1e-3, 1 / 12), at=(1, -0.5, 0))
    b.body("coupler", 1.0, (1e-3, 1 / 12, 1 / 12), at=(0.5, -1, 0))
    b.joint("A", kind, None, "left", (0, 0, 0))
    b.joint("B", kind, "left", "coupler", (0, -1, 0))
    b.joint("C", kind, "coupler", "right", (1, -1, 0))
    b.joint("D", kind, "right", None, (1, 0, 0))
    return b


def cubic_hexapod_points(edge=0.2, centre=(0, 0, 0.1)):
    """Six edges of a cube that run between the two corners on its diagonal (the platform's three corners to the
    base's three).
    """
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], float)
    z = np.ones(3) / np.sqrt(3)
    x = np.array([1, -1, 0]) / np.sqrt(2)
    A = np.stack([x, np.cross(z, x), z])
    place = {tuple(c): A @ (c - 0.5) * edge + np.asarray(centre, float) for c in corners}
    low = [c for c in corners if c.sum() == 1]
    high = [c for c in corners if c.sum() == 2]
    return [(place[tuple(p)], place[tuple(q)]) for p in low for q in high if np.abs(p - q).sum() == 1]


def cubic_hexapod():
    b = Builder()
    b.body("payload", 20.0, (0.15, 0.15, 0.15), at=(0, 0, 0.1))
    for i, (p, q) in enumerate(cubic_hexapod_points()):
        b.spring(f"leg{i}", None, "payload", p, q, k=1e5, c=30.0)
    return b


def ladder(layers, kind):
    """docs/theory.md (23.4), natural completion: two uprights per layer, a rung on top."""
    b = Builder()
    for i in range(1, layers + 1):
        for u in (1, 2):
            b.body(f"B{i},{u}", 1.0, (0.01, 0.02, 0.015), at=(0.2 * u - 0.3, 0.2 * i - 0.1, 0))
        b.body(f"B{i},3", 1.0, (0.01, 0.02, 0.015), at=(0, 0.2 * i, 0), q=quaternion((0, 0, 1), np.pi / 2))
        below = None if i == 1 else f"B{i - 1},3"
        for u in (1, 2):
            b.joint(f"low{i}{u}", kind, below, f"B{i},{u}", (0.2 * u - 0.3, 0.2 * (i - 1), 0))
            b.joint(f"high{i}{u}", kind, f"B{i},{u}", f"B{i},3", (0.2 * u - 0.3, 0.2 * i, 0))
    return b
