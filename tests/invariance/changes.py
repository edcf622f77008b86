"""Changes of a model that must not change an answer, or change it as they say: turned, moved, renamed, rounded, with parts added."""

from __future__ import annotations

import copy

import jitter
import numpy as np
from descriptions import TABLES, Change
from units import in_units

# --- quaternions, written out so that the tests do not lean on the package -----


def product(p, q):
    """Quaternion product, scalar first."""
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def matrix(q):
    """Rotation matrix of a quaternion."""
    w, v = q[0], q[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return ((w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross) / (q @ q)


def random_turn(rng):
    """A unit quaternion."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def from_columns(x, y, z):
    """The quaternion whose rotation matrix has these columns, by the eigenvector of Bar-Itzhack."""
    r = np.column_stack([x, y, z])
    k = np.array(
        [
            [np.trace(r), r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [0, r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [0, 0, r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1]],
            [0, 0, 0, r[2, 2] - r[0, 0] - r[1, 1]],
        ]
    )
    return np.linalg.eigh(k, "U")[1][:, -1]


# --- several, and none -----


def chain(*changes: Change) -> Change:
    """One after the other."""
    if not changes:
        return nothing()
    first, rest = changes[0], changes[1:]
    if not rest:
        return first
    then = chain(*rest)
    return Change(
        f"{first.name}, {then.name}",
        lambda d: then.apply(first.apply(d)),
        then.R @ first.R,
        then.R @ first.shift + then.shift / first.length,
        first.length * then.length,
        first.mass * then.mass,
        first.time * then.time,
        lambda name: then.rename(first.rename(name)),
        max(first.error, then.error),
    )


def nothing() -> Change:
    return Change("nothing", lambda d: d)


# --- places -----


def turned(rng, distance=0.0) -> Change:
    """The world turned at random, and moved by ``distance`` in a random direction."""
    q = random_turn(rng)
    way = rng.normal(size=3)
    return _placed(q, distance * way / np.linalg.norm(way), distance)


def moved(shift) -> Change:
    """The world moved."""
    return _placed(np.array([1.0, 0.0, 0.0, 0.0]), np.asarray(shift), float(np.linalg.norm(shift)))


def _placed(q, shift, distance) -> Change:
    R = matrix(q)

    def point(p):
        return _each(p, lambda v: R @ v + shift)

    def vector(v):
        return (R @ np.array(v, float)).tolist()

    def apply(d):
        d = d.copy()
        if "gravity" in d.data["model"]:
            d.data["model"]["gravity"] = vector(d.data["model"]["gravity"])
        for b in d["body"]:
            b["at"] = point(b["at"])
            b["orientation"] = _turn(q, b.get("orientation"))
            for key in ("velocity", "angular_velocity"):
                if key in b:
                    b[key] = vector(b[key])
            if "pose" in b:
                b["pose"] = [point(b["pose"][0]), _turn(q, b["pose"][1])]
        for item in (*d["joint"], *d["element"], *d["marker"], *d["load"]):
            if "at" in item:
                item["at"] = point(item["at"])
        for j in d["joint"]:
            if j["type"] in ("planar", "spherical", "free") and "axis" in j:
                j["orientation"] = _frame_by_axis(np.array(j.pop("axis"), float))
            if "orientation" in j:
                j["orientation"] = _turn(q, j["orientation"])
            elif "axis" in j:
                j["axis"] = vector(j["axis"])
                if "axis2" in j:
                    j["axis2"] = vector(j["axis2"])
            elif j["type"] in ("spherical", "free"):
                j["orientation"] = q.tolist()
        for e in d["element"]:
            if e["type"] == "bushing":
                e["orientation"] = _turn(q, e.get("orientation"))
            elif e["type"] == "torsion":
                e["axis"] = vector(e["axis"])
        for load in d["load"]:
            if load["type"] != "modal_force":
                load["value"] = vector(load["value"])  # motions among the components cannot be turned: TypeError
        for marker in d["marker"]:
            marker["orientation"] = _turn(q, marker.get("orientation"))
        return d

    # noise on the numbers of the model is relative to them, and they are as large as the distance
    error = distance * jitter.level()
    return Change("turned" if not distance else f"turned and moved by {distance:g}", apply, R, shift, error=error)


def _turn(q, orientation):
    return q.tolist() if orientation is None else product(q, np.array(orientation, float)).tolist()


def _each(p, function):
    """A function of one point on one, or on each of two."""
    p = np.array(p, float)
    return (function(p) if p.ndim == 1 else np.array([function(one) for one in p])).tolist()


def _frame_by_axis(axis):
    """The joint frame that docs/tables.md makes of an axis."""
    z = axis / np.linalg.norm(axis)
    e = np.eye(3)[np.argmin(np.abs(z))]
    x = e - (e @ z) * z
    x /= np.linalg.norm(x)
    return from_columns(x, np.cross(z, x), z).tolist()


# --- order, names, digits -----


def reordered(rng) -> Change:
    """Everything defined in another order."""
    seed = int(rng.integers(2**31))

    def apply(d):
        d, order = d.copy(), np.random.default_rng(seed)
        for kind in TABLES:
            if kind in d.data:
                d.data[kind] = [d.data[kind][i] for i in order.permutation(len(d.data[kind]))]
        return d

    return Change("another order", apply)


def reversed_joints(rng) -> Change:
    """Every joint without springs of its own from the second body to the first."""

    def apply(d):
        d = d.copy()
        for j in d["joint"]:
            if j["type"] not in ("universal", "knife_edge", "rolling_disc") and not {"k", "c", "preload", "law"} & set(
                j
            ):
                j["a"], j["b"] = j["b"], j["a"]
                if np.ndim(j["at"]) == 2:
                    j["at"] = j["at"][::-1]
        return d

    return Change("joints reversed", apply)


def renamed(rng) -> Change:
    """Every object with another name, which sorts otherwise."""
    seed = int(rng.integers(2**31))

    def new(name):
        head, dot, node = name.partition(".")
        if head == "ground":
            return name
        code = np.random.default_rng([seed, *head.encode()]).integers(10**9)
        return f"n{code}_{head[::-1]}{dot}{node}"

    def apply(d):
        d = d.copy()
        for kind in TABLES:
            for item in d[kind]:
                for key in ("name", "a", "b", "body", "joint", "first", "second"):
                    if key in item:
                        item[key] = new(item[key])
        return d

    return Change("other names", apply, rename=new)


def rounded(digits) -> Change:
    """Points, axes and orientations written with so many digits (of the largest number of each)."""

    def cut(value):
        value = np.array(value, float)
        size = np.abs(value).max()
        if size == 0:
            return value.tolist()
        place = digits - 1 - int(np.floor(np.log10(size)))
        return np.round(value, place).tolist()

    def apply(d):
        d = d.copy()
        for kind in ("body", "joint", "element", "marker", "load"):
            for item in d[kind]:
                for key in ("at", "axis", "axis2", "orientation", "com"):
                    if key in item and not (kind == "element" and key == "axis"):
                        item[key] = cut(item[key])
        return d

    return Change(f"{digits} digits", apply, error=10.0 ** (1 - digits))


def tilted(rng, angle) -> Change:
    """Axes of joints tilted at random by up to an angle in radians."""
    seed = int(rng.integers(2**31))

    def apply(d):
        d, random = d.copy(), np.random.default_rng(seed)
        for j in d["joint"]:
            q = np.concatenate([[1.0], 0.5 * angle * random.uniform(-1, 1, 3) / np.sqrt(3)])
            if "orientation" in j:
                j["orientation"] = _turn(q, j["orientation"])
            for key in ("axis", "axis2"):
                if key in j:
                    j[key] = (matrix(q) @ np.array(j[key], float)).tolist()
        return d

    return Change(f"axes tilted by {angle:g}", apply, error=angle)


# --- parts -----


def with_part(stiffness, mass, name) -> Change:
    """Another body on a rail of its own, not connected to the rest; it vibrates at sqrt(stiffness/mass).

    A soft one has its rail across gravity, or it would sag for miles.
    """

    def apply(d):
        d = d.copy()
        inertia = [mass, mass, mass]
        d.put("body", name="extra part", mass=mass, inertia=inertia, at=[0.7, -0.4, 0.3])
        axis = np.array([0.48, -0.6, 0.64])
        down = np.array(d.data["model"].get("gravity", [0.0, 0.0, 0.0]))
        if stiffness < 10 * mass * np.linalg.norm(down):
            axis = np.cross(axis, down) / np.linalg.norm(np.cross(axis, down))
        d.put(
            "joint",
            type="prismatic",
            name="extra rail",
            a="ground",
            b="extra part",
            at=[0.7, -0.4, 0.3],
            axis=axis.tolist(),
        )
        d["joint"][-1]["k"] = stiffness
        return d

    return Change(name, apply)


def split(share) -> Change:
    """Every rigid body as two in one place, welded together."""

    def apply(d):
        d = d.copy()
        for b in list(d["body"]):
            if "modal_body" in b:
                continue
            other = copy.deepcopy(b)
            other["name"] = b["name"] + " twin"
            for one, part in ((b, share), (other, 1 - share)):
                one["mass"] = one["mass"] * part
                one["inertia"] = (np.array(one["inertia"]) * part).tolist()
            d["body"].append(other)
            d.put("joint", type="fixed", name=b["name"] + " weld", a=b["name"], b=other["name"], at=list(b["at"]))
        return d

    return Change("bodies split", apply)


def repeated(rng) -> Change:
    """Every joint once more, without springs; hinges and loose bearings elsewhere on their axis."""
    seed = int(rng.integers(2**31))

    def apply(d):
        d, random = d.copy(), np.random.default_rng(seed)
        for j in list(d["joint"]):
            if j["type"] in ("distance", "knife_edge", "rolling_disc", "point_on_line", "free"):
                continue
            twin = {k: v for k, v in j.items() if k not in ("k", "c", "preload", "law")}
            twin["name"] = j["name"] + " again"
            if j["type"] in ("revolute", "cylindrical"):
                axis = matrix(np.array(j["orientation"]))[:, 2] if "orientation" in j else np.array(j["axis"], float)
                far = random.uniform(0.3, 1.0) * axis / np.linalg.norm(axis)
                twin["at"] = _each(j["at"], lambda p, far=far: p + far)
            d["joint"].append(twin)
        return d

    return Change("joints repeated", apply)


# --- matrices -----


def scaled_system(system_matrices, scale):
    """M, C, G, K, N in coordinates x = D y with D = diag(scale)."""
    D = np.diag(scale)
    return {key: None if A is None else D @ A @ D for key, A in system_matrices.items()}


def noisy(system_matrices, rng, size=1e-16):
    """Rounding added to every entry: ``size`` of sqrt(a_ii a_jj), symmetric for M, C, K and antisymmetric for G, N."""
    out = {}
    for key, A in system_matrices.items():
        if A is None:
            out[key] = None
            continue
        A = np.array(A, float)
        diagonal = np.sqrt(np.abs(np.diag(system_matrices["K"] if key in ("K", "N") else A)))
        noise = size * np.outer(diagonal, diagonal) * rng.normal(size=A.shape)
        out[key] = A + (noise - noise.T if key in ("G", "N") else noise + noise.T)
    return out


def general(rng, distance=0.0, length=1.0, digits=None) -> Change:
    """A random frame, unit of length, order and direction of joints: what linkages go through before anything is asked."""
    first = turned(rng, distance)
    more = [reordered(rng), reversed_joints(rng)]
    if length != 1.0:
        more.append(in_units(length))
    if digits is not None:
        more.append(rounded(digits))
    return chain(first, *more)
