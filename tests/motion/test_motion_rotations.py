"""Rotations in time: the commutator of a step, short steps, BDF with ball joints in loops. Bodies, axes and units are random; truths
are SciPy's integration of minimal equations and, for orders of magnitude, a trapezoidal rule of a few lines."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

METHODS = [("generalized-alpha", 0.8), ("generalized-alpha", 1.0), ("generalized-alpha", 0.4), ("ali3p", None)]


class Top:
    """A body on a ball joint, of random shape, place, axes and units; ``fast``: one that spins about its own axis."""

    def __init__(self, seed, fast=False):
        rng = np.random.default_rng(seed)
        self.length, self.mass = 10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-2, 2)
        turn = Rotation.random(random_state=seed).as_matrix()
        # a flat body: principal inertias obey the triangle inequality with room
        principal = self.mass * self.length**2 * rng.uniform(0.3, 0.5, 3)
        if fast:
            principal[1] = principal[0]
        self.inertia = turn @ np.diag(principal) @ turn.T
        self.arm = self.length * (turn[:, 2] if fast else rng.normal(size=3))
        self.pivot = self.length * rng.normal(size=3)
        self.gravity = self.length * 30.0 * rng.normal(size=3)
        self.w = rng.normal(size=3) + 150.0 * turn[:, 2] if fast else 20.0 * rng.normal(size=3)
        self.about = self.inertia + self.mass * (self.arm @ self.arm * np.eye(3) - np.outer(self.arm, self.arm))
        self.reversed = bool(seed % 2)

    def model(self):
        m = mb.Model("top", gravity=tuple(self.gravity))
        b = m.body(
            "b",
            mass=self.mass,
            inertia=self.inertia,
            at=self.pivot + self.arm,
            velocity=np.cross(self.w, self.arm),
            angular_velocity=self.w,
        )
        m.spherical("pivot", *((b, m.ground) if self.reversed else (m.ground, b)), at=self.pivot)
        return m

    def acceleration(self, R, w):
        inertia = R @ self.about @ R.T
        torque = np.cross(R @ self.arm, self.mass * self.gravity)
        return np.linalg.solve(inertia, torque - np.cross(w, inertia @ w))

    def place(self, R):
        return self.pivot + R @ self.arm

    def truth(self, t):
        def slope(_, y):
            R, w = y[:9].reshape(3, 3), y[9:]
            return np.concatenate([np.cross(w, R.T).T.ravel(), self.acceleration(R, w)])

        start = np.concatenate([np.eye(3).ravel(), self.w])
        end = solve_ivp(slope, (0, t), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:9, -1]
        return self.place(end.reshape(3, 3))

    def by_the_trapezoidal_rule(self, t, n, term):
        """With or without the commutator, by repetition."""
        R, w, h = np.eye(3), self.w, t / n
        for _ in range(n):
            a = self.acceleration(R, w)
            v, turned = w + h * a, R
            for _ in range(40):
                turned = Rotation.from_rotvec(h / 2 * (w + v) - term * h * h / 12 * np.cross(w, v)).as_matrix() @ R
                v = w + h / 2 * (a + self.acceleration(turned, v))
            R, w = turned, v
        return self.place(R)

    def error(self, place, t):
        return np.abs(place - self.truth(t)).max() / self.length


@pytest.mark.some(4)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("method", "rho"), METHODS)
def test_methods_of_order_two_have_it_for_tops(method, rho, seed):
    top, t, n = Top(seed), 0.2, 200
    m = top.model()
    errors = [top.error(mb.simulate(m, t, step=t / k, method=method, rho=rho).position("b")[-1], t) for k in (n, 2 * n)]
    order = np.log2(errors[0] / errors[1])
    print(f"{method} {rho}, top {seed}: errors {errors[0]:.1e}, {errors[1]:.1e}, order {order:.2f}")
    assert abs(order - 2.0) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_increment_of_a_step_has_its_commutator(seed):
    """ALI3-P without rows is the trapezoidal rule; generalised-alpha is as accurate."""
    top, t, n = Top(seed, fast=True), 0.2, 400
    rule, without = top.by_the_trapezoidal_rule(t, n, 1.0), top.by_the_trapezoidal_rule(t, n, 0.0)
    errors = top.error(rule, t), top.error(without, t)
    assert errors[0] < 0.5 * errors[1]
    for method, rho in METHODS:
        place = mb.simulate(top.model(), t, step=t / n, method=method, rho=rho).position("b")[-1]
        error, apart = top.error(place, t), np.abs(place - rule).max() / top.length
        print(f"top {seed}, {method} {rho}: error {error:.2e} of {errors}, apart {apart:.1e}")
        assert error < (3.0 if rho == 0.4 else 1.2) * errors[0]
        assert method != "ali3p" or apart < 1e-9


def heavy_top_error(t, **options):
    """Largest distance of the centre of mass of the top of Bruls and Cardona from DOP853."""
    import motion_problems as zoo

    problem = zoo.heavy_top(t=t)
    traj = mb.simulate(problem.model, [t], **options)
    return problem.error(traj.t, problem.places(traj))


@pytest.mark.slow
def test_the_heavy_top_over_two_seconds():
    for rho, most in ((0.8, 2e-4), (1.0, 2e-4)):
        fine = heavy_top_error(2.0, step=1e-4, method="generalized-alpha", rho=rho)
        coarse = heavy_top_error(2.0, step=2e-4, method="generalized-alpha", rho=rho)
        print(f"rho {rho}: {coarse:.2e}, {fine:.2e} m")
        assert fine < most and abs(np.log2(coarse / fine) - 2.0) < 0.05
    fine = heavy_top_error(2.0, step=1e-4, method="ali3p")
    print(f"ali3p: {fine:.2e} m")
    assert fine < 2e-4


@pytest.mark.some(1)
@pytest.mark.parametrize("method", ["generalized-alpha", "ali3p"])
def test_shorter_steps_are_more_accurate(method):
    """Newton's method stops by relative progress: a step that moves little is solved as well as a long one."""
    steps = [1e-4, 1e-5, 1e-6]
    errors = [heavy_top_error(0.05, step=h, method=method) for h in steps]
    print(method, errors)
    assert errors[1] < errors[0] / 50 and errors[2] < 1e-8


def ball_and_rod(rod=True, slender=25.0):
    """A body on a ball joint, and a rod from it to the ground."""
    m = mb.Model("ball and rod", gravity=(0.7, -1.3, -9.6))
    turn = Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()
    inertia = turn @ np.diag([0.05, 0.052, 0.05 / slender]) @ turn.T
    at = np.array([0.31, 0.42, -0.17])
    b = m.body("b", mass=1.7, inertia=inertia, at=at)
    m.spherical("ball", m.ground, b, at=(0, 0, 0))
    if rod:
        m.distance("rod", b, m.ground, at=((0.43, -0.28, 0.36), (1.1, 0.6, 0.8)))
    return m


@pytest.mark.slow
def test_newton_of_bdf_does_not_depend_on_the_angle_of_the_chart():
    counts = []
    for t in (0.02, 0.05, 0.1, 0.2):
        traj = mb.simulate(ball_and_rod(), t, step=1e-4, method="bdf")
        counts.append(traj.stats.counts["iterations"] / (len(traj.steps) - 1))
    print("iterations a step", counts)
    assert max(counts) < 4.0


def spatial_slider_crank(order):
    """A crank about a leaning axis, a rod on a ball joint and a universal joint, a slider on a leaning rail."""
    m = mb.Model("spatial slider-crank", gravity=(0.4, -0.8, -9.7))
    axis, rail = np.array([1.0, 0.2, -0.1]), np.array([0.1, 1.0, 0.15])
    tip, pin = np.array([0.0, 0.06, 0.11]), np.array([0.12, 0.34, 0.06])
    w = 9.0 * axis / np.linalg.norm(axis)
    crank = m.body(
        "crank", mass=0.6, inertia=(2e-3, 1e-3, 1.5e-3), at=tip / 2, velocity=np.cross(w, tip / 2), angular_velocity=w
    )
    rod = m.body("rod", mass=0.9, inertia=(1.14e-2, 1.1e-2, 8e-4), at=(tip + pin) / 2)
    slider = m.body("slider", mass=1.1, inertia=(2e-3, 2e-3, 2e-3), at=pin)
    joints = {
        "crank": lambda: m.revolute("pivot", m.ground, crank, at=(0, 0, 0), axis=axis),
        "ball": lambda: m.spherical("ball", crank, rod, at=tip),
        "cross": lambda: m.universal("cross", rod, slider, at=pin, axis=(1.0, 0.2, 0.2), axis2=(-0.2, 0.1, 0.9)),
        "rail": lambda: m.prismatic("rail", m.ground, slider, at=pin, axis=rail),
    }
    for name in order:
        joints[name]()
    return m


ORDERS = [("crank", "ball", "cross", "rail"), ("rail", "cross", "ball", "crank"), ("ball", "rail", "crank", "cross")]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the initial")
def test_steps_of_bdf_grow_as_its_order_says():
    steps = {}
    for order in ORDERS:
        m = spatial_slider_crank(order)
        truth = mb.simulate(m, [1.0], rtol=1e-11, method="explicit").position("slider")[-1]
        for rtol in (1e-5, 1e-6, 1e-7, 1e-8):
            traj = mb.simulate(m, 1.0, rtol=rtol, method="bdf")
            error = np.abs(traj.position("slider")[-1] - truth).max()
            steps.setdefault(rtol, []).append(len(traj.steps) - 1)
            print(order[0], rtol, len(traj.steps) - 1, traj.stats.counts, f"{error:.1e}")
            assert error < 300 * rtol
    for a, b in ((1e-5, 1e-6), (1e-6, 1e-7), (1e-7, 1e-8)):
        # between orders 3 and 5: 1.8 and 1.5 a decade
        assert max(steps[b]) < 2.2 * max(steps[a])
    assert all(max(n) < 1.5 * min(n) for n in steps.values())
