"""The zoo's models that move, for tests, docs and benches. Numbers without a source are invented."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mbrs as mb
import motion_truths as true
import numpy as np
from mbrs.examples._links import rod
from problems import Problem

G = true.G


@dataclass
class MotionProblem(Problem):
    """A model that moves for ``t`` seconds. Its answer is a function of times (n_t,): positions (n_t, 3) in the world of some bodies'
    origins and of markers, by name.
    """

    answer: Callable[[np.ndarray], dict[str, np.ndarray]]
    name: str = field(kw_only=True)
    t: float = field(kw_only=True)
    smooth: bool = True
    conserves: bool = True
    length: float = 1.0

    def error(self, times, places) -> float:
        """Largest distance of places (name -> (n_t, 3)) from the answer at the times, m."""
        exact = self.answer(np.asarray(times, dtype=float))
        return max(float(np.max(np.abs(places[name] - exact[name]))) for name in exact)

    def places(self, traj) -> dict[str, np.ndarray]:
        """What a trajectory says about the places of which the answer is known."""
        known = markers(self.model)
        return {name: traj.point(name) if name in known else traj.position(name) for name in self.answer(np.zeros(1))}

    def error_of(self, traj) -> float:
        """Largest distance of a trajectory from the answer over its outputs, in characteristic lengths."""
        return self.error(traj.t, self.places(traj)) / traj.snapshot.system.characteristic_length


def markers(model) -> set[str]:
    """Names of a model's markers."""
    from mbrs.model.tables import tables

    return set(tables(model)["marker_name"])


def ball(m, name, mass, at, **more):
    """A body whose rotation does not matter."""
    return m.body(name, mass=mass, inertia=(0.1 * mass,) * 3, at=at, **more)


# --- one degree of freedom -----


def rod_pendulum():
    m = mb.Model("rod pendulum", gravity=(0, -G, 0))
    b = rod(m, "rod", [(0, 0), (1, 0)], 1.0)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis="z")

    def truth(t):
        phi = true.rod_pendulum(t)
        return {"rod": 0.5 * true.plane(np.sin(phi), -np.cos(phi))}

    return MotionProblem(m, truth, "closed form, Jacobi's sn", name="rod pendulum", t=2.0)


def duffing():
    m = mb.Model("Duffing")
    b = ball(m, "mass", 2.0, (0, 0, 0))
    # drawn at the amplitude, so the law's zero lies A before it
    m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis="x", law=mb.Polynomial1D(_shifted(30.0, 200.0, 0.5)))
    return MotionProblem(
        m,
        lambda t: {"mass": true.plane(true.duffing(t, 30.0, 200.0, 2.0, 0.5) - 0.5, 0 * t)},
        "closed form, Jacobi's cn",
        name="Duffing",
        t=3.0,
    )


def _shifted(k, k3, a):
    """Coefficients in u of k (u + a) + k3 (u + a)^3."""
    return [k * a + k3 * a**3, k + 3 * k3 * a**2, 3 * k3 * a, k3]


def four_bars(n=1, t=1.5, speed=1.0):
    """Falls through the pose in which all links align."""

    def truth(times):
        phi = true.four_bars(times, n, speed)
        return {"tip": true.plane(np.sin(phi), np.cos(phi))}

    return MotionProblem(
        mb.examples.four_bars(n, speed),
        truth,
        "one angle, DOP853 1e-13",
        name=f"{n} four-bar{'s' if n > 1 else ''}",
        t=t,
    )


def slider_crank():
    r, rod_length, angle, speed = 0.15, 0.35, 0.3, 12.0

    def truth(t):
        a = true.slider_crank(t, r, rod_length, angle, speed)
        x = r * np.cos(a) + np.sqrt(rod_length**2 - (r * np.sin(a)) ** 2)
        return {"pin": r * true.plane(np.cos(a), np.sin(a)), "slider": true.plane(x, 0 * x)}

    m = mb.examples.slider_crank(r, rod_length, speed, angle)
    return MotionProblem(m, truth, "one angle, DOP853 1e-13", name="slider-crank", t=1.0, length=0.35)


def gap(stop=1e4):
    m = mb.examples.gap_problem(stop=stop)
    return MotionProblem(
        m,
        lambda t: {"mass": true.plane(true.against_stop(t, 1.0, 100.0, stop, 0.05, 2.0), 0 * t)},
        "harmonic pieces",
        name="gap",
        t=2.0,
        smooth=False,
    )


# --- planes -----


def double_pendulum(ratio=1.0, t=1.0):
    """Two rods let go level; ``ratio``: the second's mass over the first's."""
    m = mb.Model("double pendulum", gravity=(0, -G, 0))
    a = rod(m, "upper", [(0, 0), (1, 0)], 1.0)
    b = rod(m, "lower", [(1, 0), (1.8, 0)], ratio)
    m.revolute("h0", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("h1", a, b, at=(1, 0, 0), axis="z")
    m.marker("end", b, at=(1.8, 0, 0))
    lengths = np.array([1.0, 0.8])

    def truth(times):
        return {"end": true.rod_chain_end(true.rod_chain(times, lengths, [1.0, ratio], [0.0, 0.0]), lengths)}

    return MotionProblem(m, truth, "two angles, DOP853 1e-13", name="double pendulum", t=t)


def chain(n=5, t=0.6):
    def truth(times):
        lengths = np.full(n, 2.0 / n)
        return {"end": true.rod_chain_end(true.rod_chain(times, lengths, np.full(n, 2.0 / n), np.zeros(n)), lengths)}

    m = mb.examples.pendulum_chain(n)
    return MotionProblem(m, truth, f"{n} angles, DOP853 1e-13", name=f"chain of {n}", t=t, length=2.0)


def bead_on_arm():
    """A prismatic joint that turns: Coriolis and centrifugal forces."""
    m = mb.Model("bead on an arm")
    w, r0 = 5.0, 0.4
    a = m.body("arm", mass=1.0, inertia=(0.04, 0.05, 0.08), at=(0, 0, 0), angular_velocity=(0, 0, w))
    b = m.body(
        "bead", mass=0.7, inertia=(1e-3, 1e-3, 2e-3), at=(r0, 0, 0), velocity=(0, w * r0, 0), angular_velocity=(0, 0, w)
    )
    m.revolute("hinge", m.ground, a, at=(0, 0, 0), axis="z")
    m.prismatic("slot", a, b, at=(r0, 0, 0), axis="x", k=60.0)

    def truth(t):
        r, phi = true.bead_on_arm(t, 0.08, 0.7, 2e-3, 60.0, r0, w)
        return {"bead": true.plane(r * np.cos(phi), r * np.sin(phi))}

    return MotionProblem(m, truth, "distance and angle, DOP853 1e-13", name="bead on an arm", t=1.5)


def spring_pendulum():
    """A free body on a spring, from its centre of mass to ground."""
    start, v = np.array([0.9, -0.6, 0.2]), np.array([0.3, 0.0, 1.0])
    m = mb.Model("spring pendulum", gravity=(0, -G, 0))
    b = ball(m, "mass", 1.5, start, velocity=v)
    m.spring_damper("spring", m.ground, b, at=((0, 0, 0), start), k=80.0, length=1.0)
    return MotionProblem(
        m,
        lambda t: {"mass": true.spring_pendulum(t, 1.5, 80.0, 1.0, start, v)},
        "Cartesian coordinates, DOP853 1e-13",
        name="spring pendulum",
        t=2.0,
    )


def spherical_pendulum():
    """A free body at a constant distance from ground, by a distance joint."""
    start, v = np.array([0.8, 0.0, -0.6]), np.array([0.0, 2.0, 0.0])
    m = mb.Model("spherical pendulum", gravity=(0, 0, -G))
    b = ball(m, "mass", 1.5, start, velocity=v)
    m.distance("wire", m.ground, b, at=((0, 0, 0), start))
    return MotionProblem(
        m,
        lambda t: {"mass": true.spherical_pendulum(t, start, v)},
        "Cartesian coordinates, DOP853 1e-13",
        name="spherical pendulum",
        t=2.0,
    )


def five_bar(t=1.0):
    """docs/theory.md (23.12): layout and natural lengths reconstructed there, uniform bars."""
    m = mb.examples.five_bar(G)

    def truth(times):
        points = true.five_bar(times)
        return {f"P{i + 1}": true.plane(points[:, i, 0], points[:, i, 1]) for i in range(3)}

    return MotionProblem(
        m, truth, "natural coordinates, DOP853 1e-13; docs/theory.md (23.12)", name="five-bar", t=t, length=2.0
    )


def bushings(stiff=1.0, damping=1.0):
    """Three masses in a row on bushings that act along x; ``stiff`` multiplies the middle one."""
    k, c, start = (
        np.array([400.0, 900.0 * stiff, 250.0]),
        damping * np.array([2.0, 1.0, 3.0]),
        np.array([0.1, 0.1, -0.2]),
    )
    masses = [1.0, 0.8, 1.5]
    m = mb.Model("bushings")
    before = m.ground
    for i in range(3):
        at = (0.5 * i, 0, 0)
        b = ball(m, f"m{i}", masses[i], at)
        # not stretched where the displacement is zero, which lies `start` before the drawn place
        stretch = start[i] - (start[i - 1] if i else 0.0)
        m.bushing(
            f"b{i}", before, b, at=at, k=(k[i], k[i], k[i], 50, 50, 50), c=(c[i], c[i], c[i], 1, 1, 1),
            preload=(k[i] * stretch, 0, 0, 0, 0, 0),
        )  # fmt: skip
        before = b

    def truth(t):
        u = true.linear_chain(t, masses, k, c, start) - start
        return {f"m{i}": true.plane(0.5 * i + u[:, i], 0 * u[:, i]) for i in range(3)}

    return MotionProblem(m, truth, "modes of three masses", name="bushings", t=1.0, conserves=damping == 0.0)


def governor(t=1.0, k=8e5, c=4e4, turned=None, unit=1.0):
    """A flyball governor whose springs of 8e5 N/m and 4e4 Ns/m take the place of rods.

    After the IFToMM benchmark (Gonzalez, Dopico, Lugris, Cuadrado, Multibody Syst. Dyn. 16 (2006) 65-83): balls of 5 kg on rods of
    1 m that lean by 30 degrees, 2 pi rad/s; rods, shaft and collar of 3000 kg/m^3. ``turned``: a rotation of everything; ``unit``: of
    length, over a metre.
    """
    R = np.eye(3) if turned is None else np.asarray(turned)
    ball_mass, rod_mass, collar_mass, lean, speed = 5.0, 0.3, 3.0, np.pi / 6, 2 * np.pi
    b, natural = 0.5, 0.5
    s = 2 * b * np.cos(lean)
    at = lambda *x: R @ np.array(x, dtype=float) / unit  # noqa: E731
    m = mb.Model("governor", gravity=R @ np.array([0, 0, -G]) / unit)
    axis, spin = R @ [0.0, 0.0, 1.0], R @ np.array([0.0, 0.0, speed])
    turn = dict(angular_velocity=spin)
    square = 1.0 / unit**2
    shaft_inertia, collar_inertia = 5e-3, 5e-3
    inertia = lambda *x: R @ np.diag(x) @ R.T * square  # noqa: E731
    shaft = m.body("shaft", mass=0.3, inertia=inertia(0.025, 0.025, shaft_inertia), at=at(0, 0, -0.5), **turn)
    m.revolute("bearing", m.ground, shaft, at=at(0, 0, 0), axis=axis)
    collar = m.body("collar", mass=collar_mass, inertia=inertia(0.005, 0.005, collar_inertia), at=at(0, 0, -s), **turn)
    m.prismatic("slide", shaft, collar, at=at(0, 0, -s), axis=axis)
    mass, centre = ball_mass + rod_mass, (ball_mass + 0.5 * rod_mass) / (ball_mass + rod_mass)
    about_centre = ball_mass * (1 - centre) ** 2 + rod_mass / 12 + rod_mass * (centre - 0.5) ** 2
    for name, side in (("left", -1.0), ("right", 1.0)):
        along = np.array([side * np.sin(lean), 0.0, -np.cos(lean)])
        thick = 1e-3
        own = about_centre * np.eye(3) + (thick - about_centre) * np.outer(along, along)
        middle = centre * along
        arm = m.body(
            f"{name} arm", mass=mass, inertia=R @ own @ R.T * square, at=at(*middle), velocity=np.cross(spin, at(*middle)), **turn
        )  # fmt: skip
        m.revolute(f"{name} hinge", shaft, arm, at=at(0, 0, 0), axis=R @ [0.0, 1.0, 0.0])
        ends = (at(*(b * along)), at(0, 0, -s))
        m.spring_damper(f"{name} spring", arm, collar, at=ends, k=k, c=c, length=natural / unit)
        m.marker(f"{name} ball", arm, at=at(*along))
    across = about_centre + mass * centre**2
    arms = (across, thick, mass * centre)

    def truth(times):
        y = true.governor(
            times, arms, collar_mass, shaft_inertia + collar_inertia, (k, c, natural, b), G, (speed, lean, s)
        )
        turned, lean_now, way = y.T
        away, down = np.sin(lean_now), np.cos(lean_now)
        right = np.stack([away * np.cos(turned), away * np.sin(turned), -down], axis=1)
        left = right * [-1.0, -1.0, 1.0]
        places = {"collar": np.stack([0 * way, 0 * way, -way], axis=1), "right ball": right, "left ball": left}
        return {name: p @ R.T / unit for name, p in places.items()}

    return MotionProblem(
        m, truth, "three coordinates, LSODA 1e-13", name="governor", t=t, conserves=False, length=1.0 / unit
    )


# --- rotations -----


def heavy_top(spin=150.0, t=0.5):
    def truth(times):
        across, along = 15.234375, 0.46875
        rate = np.cross([0.0, spin, -4.61538], [0.0, 1.0, 0.0])
        return {"top": true.symmetric_top_axis(times, 15.0, 1.0, across, along, spin, (0, 1, 0), rate)}

    m = mb.examples.heavy_top(spin)
    return MotionProblem(m, truth, "axis and moment of momentum, DOP853 1e-13", name="heavy top", t=t)


FREE_INERTIA, FREE_SPIN = np.array([0.2, 0.3, 0.45]), np.array([1.5, 0.0, 4.0])


def free_body():
    """Turns about an axis between the second and the third, and flies along a parabola."""
    m = mb.Model("free body", gravity=(0, 0, -G))
    v = np.array([1.0, 0.5, 3.0])
    b = m.body("stone", mass=2.0, inertia=FREE_INERTIA, at=(0, 0, 0), velocity=v, angular_velocity=FREE_SPIN)
    m.marker("corner", b, at=(0.3, 0.2, -0.1))

    def truth(times):
        t = np.asarray(times)[:, None]
        centre = v * t + 0.5 * t**2 * np.array([0, 0, -G])
        R = true.free_rotation(times, FREE_INERTIA, FREE_SPIN)
        return {"stone": centre, "corner": centre + R @ np.array([0.3, 0.2, -0.1])}

    return MotionProblem(m, truth, "quaternion, DOP853 1e-13; spin by Jacobi's functions", name="free body", t=1.5)


def bricard(t=1.0):
    """The orthogonal Bricard linkage along the edges of a cube: six hinges, one freedom that Gruebler does not count.

    Geometry of the IFToMM benchmark (Gonzalez et al., Multibody Syst. Dyn. 16 (2006) 65-83): rods of 1 m and 1 kg,
    weight along -y. No closed form here: `mbrs.reference.simulate` is the truth.
    """
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 0, -1), (1, 1, -1), (0, 1, -1), (0, 1, 0)], dtype=float)
    m = mb.Model("Bricard", gravity=(0, -G, 0))
    bodies = []
    for i in range(5):
        along = corners[i + 1] - corners[i]
        inertia = (1 - along**2) / 12 + along**2 * 1e-3
        bodies.append(m.body(f"rod{i}", mass=1.0, inertia=inertia, at=(corners[i] + corners[i + 1]) / 2))
    for i in range(6):
        before, after = corners[i] - corners[i - 1], corners[(i + 1) % 6] - corners[i]
        one, two = ([m.ground, *bodies][i], [*bodies, m.ground][i])
        m.revolute(f"j{i}", one, two, at=corners[i], axis=np.cross(before, after))
    return MotionProblem(m, lambda times: reference_positions(m, times), "mbrs.reference.simulate", name="Bricard", t=t)


def reference_positions(m, times) -> dict[str, np.ndarray]:
    """Origins of all bodies by mbrs.reference.simulate."""
    from mbrs import reference as ref
    from mbrs.model.tables import tables

    s = ref.System(tables(m))
    times = np.asarray(times, dtype=float)
    dense = np.unique(np.concatenate([np.linspace(0.0, times.max(), 1 + int(np.ceil(times.max() / 0.1))), times]))
    found = ref.simulate(s, ref.drawn_state(s), dense[dense > 0], rtol=1e-12)
    at = np.searchsorted(found.t, times)
    return {b.name: found.positions(s)[at, i] for i, b in enumerate(s.bodies)}


def skate():
    """A blade under the centre of mass of a body on a tilted plane: a knife edge."""
    tilt, speed, spin = 0.4, 1.0, 3.0
    m = mb.Model("skate", gravity=(0, -G * np.sin(tilt), -G * np.cos(tilt)))
    b = ball(m, "skate", 1.0, (0, 0, 0), velocity=(speed, 0, 0), angular_velocity=(0, 0, spin))
    m.planar("ice", m.ground, b, at=(0, 0, 0), axis="z")
    # the blade lies along x as drawn: no velocity along the body's y
    m.knife_edge("blade", m.ground, b, at=(0, 0, 0), axis="y")
    return MotionProblem(m, lambda t: {"skate": true.skate(t, tilt, speed, spin)}, "closed form", name="skate", t=2.0)


def swing(t=2.0):
    """A driven hinge, and a check value (docs/theory.md (23.11))."""
    length, rate = 2.0, np.pi / 3

    def truth(times):
        b, a = true.swing(times, length, 336.14, rate), rate * np.asarray(times)
        tip = true.plane(length * np.cos(a), length * np.sin(a))
        return {"A": 0.5 * tip, "end": tip + true.plane(length * np.cos(b), length * np.sin(b))}

    m = mb.examples.swing(length)
    return MotionProblem(m, truth, "one angle, DOP853 1e-13", name="swing", t=t, conserves=False, length=4.0)


def rolling_disc():
    mass, radius, lean, spin, turn = 1.5, 0.25, 0.35, 8.0, 0.6
    axis, up = np.array([0, np.cos(lean), np.sin(lean)]), np.array([0, -np.sin(lean), np.cos(lean)])
    w, across = spin * axis + turn * np.array([0, 0, 1.0]), mass * radius**2 / 4

    def truth(t):
        return {"disc": true.rolling(t, mass, radius, across, 2 * across, axis, radius * up, w)}

    m = mb.examples.rolling_disc(mass, radius, lean, spin, turn)
    return MotionProblem(m, truth, "axis and spin, DOP853 1e-13", name="rolling disc", t=1.5)


def quarter_car(t=1.0):
    """The road's acceleration jumps where the bump ends."""
    from mbrs.examples._quarter_car import BUMP_HEIGHT, BUMP_TIME

    def truth(times):
        u = true.over_bump(times, (40.0, 350.0), (1.9e5, 2.2e4), (100.0, 1.4e3), BUMP_HEIGHT, BUMP_TIME)
        z = np.array([0.3, 0.8, 0.0]) + u
        names = ("wheel", "body", "road")
        return {name: np.stack([0 * z[:, i], 0 * z[:, i], z[:, i]], axis=1) for i, name in enumerate(names)}

    m = mb.examples.quarter_car()
    return MotionProblem(m, truth, "matrix exponentials", name="quarter car", t=t, smooth=False, conserves=False)


SMOOTH: dict[str, Callable[[], MotionProblem]] = {
    f.__name__: f
    for f in (
        rod_pendulum,
        duffing,
        four_bars,
        slider_crank,
        double_pendulum,
        chain,
        bead_on_arm,
        spring_pendulum,
        spherical_pendulum,
        five_bar,
        bushings,
        heavy_top,
        free_body,
        skate,
        swing,
        rolling_disc,
    )
}
