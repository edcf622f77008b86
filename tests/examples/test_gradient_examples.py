"""Examples of gradients: their models and derivatives against the plain reference, differences and known values."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.examples import _car
from mbrs.model.directions import directions
from mbrs.model.tables import tables
from oracles.ali3p import Scheme
from oracles.ali3p_tree import TreeMechanism


@pytest.fixture(scope="module")
def car():
    return mb.examples.car()


def test_the_car_rests_as_drawn(car):
    """Preloads carry the weight: until the bump nothing accelerates."""
    traj = mb.simulate(car, t=0.02, step=0.01, method="ali3p")
    print(f"accelerations of the car at rest: {np.abs(traj.acceleration).max():.1e}")
    assert np.abs(traj.acceleration).max() < 1e-6
    assert np.allclose(traj.velocity("chassis"), [_car.SPEED, 0.0, 0.0], atol=1e-9)


def test_the_car_is_alike_on_both_sides(car, monkeypatch):
    """The same bump under both sides: it neither rolls nor swerves."""
    monkeypatch.setattr(_car, "BUMP_TIME", 0.0)
    monkeypatch.setattr(_car, "BUMP_HEIGHTS", {"left": 0.05, "right": 0.05})
    traj = mb.simulate(car, t=0.3, step=0.01, method="ali3p")
    turned = np.abs(traj.rotation("chassis")[:, [0, 2], [1, 1]]).max()
    print(f"lateral {np.abs(traj.position('chassis')[:, 1]).max():.1e} m, turned {turned:.1e}")
    assert np.abs(traj.position("chassis")[:, 1]).max() < 1e-11
    assert turned < 1e-11
    assert np.ptp(traj.position("chassis")[:, 2]) > 1e-3


def test_road_is_its_own_derivative():
    for road in _car.ROADS.values():
        for t in np.linspace(_car.BUMP_TIME - 0.05, _car.BUMP_TIME + 0.6, 14):
            h = 1e-4
            low, here, high = road(t - h), road(t), road(t + h)
            assert (high[0] - low[0]) / (2 * h) == pytest.approx(here[1], rel=1e-4, abs=1e-5)
            assert (high[1] - low[1]) / (2 * h) == pytest.approx(here[2], rel=1e-4, abs=1e-3)


@pytest.mark.oracle
def test_car_against_the_complex_step_of_the_reference(monkeypatch):
    """Two steps on to the bump, from a start out of balance, through joints, loops, couplers, drives, springs and tyres: all
    numbers of the design changed at once along a random direction."""
    monkeypatch.setattr(_car, "BUMP_TIME", 0.0)
    m = mb.examples.car()
    m.set({"front left spring.preload": -4500.0})
    names, n, h = list(m.parameters), 2, 0.02
    t, along = tables(m), directions(m, names)
    bodies = ["chassis", "front left upright"]
    places = [list(t["body_name"]).index(b) for b in bodies]
    goals = [mb.Final(lambda s, b=b, i=i: s.position(b)[i]) for b in bodies for i in range(3)]
    options = {"t": n * h, "step": h, "weight": "mass"}
    direct = mb.gradient(m, goals, names, method="direct", **options)
    adjoint = mb.gradient(m, goals, names, method="adjoint", **options)
    # a centimetre for points, a hundredth of stiffnesses and dampings, so that all of them count
    size = np.array(
        [
            0.01 if label.endswith("]") else 0.01 * where
            for label, where in zip(direct.labels, direct.where, strict=True)
        ]
    )
    way = size * np.random.default_rng(3).uniform(-1.0, 1.0, along.n)
    end = Scheme(TreeMechanism(t, t["x"] + 1j * 1e-40 * along.dense @ way), np.zeros(1), h, "mass").run(n)[-1]
    mech = TreeMechanism(t)
    found = np.concatenate([end.q.r[i] - end.q.R[i] @ mech.sys.bodies[i].com for i in places])
    exact = found.imag / 1e-40
    errors = [
        float(np.abs(np.asarray(g.gradient) @ way - exact).max() / np.abs(exact).max()) for g in (direct, adjoint)
    ]
    # the real part of a complex step is the motion itself
    position = np.abs(direct.value - found.real).max()
    print(f"car: position {position:.1e}, direct {errors[0]:.1e}, adjoint {errors[1]:.1e}")
    assert position < 1e-11
    assert max(errors) < 1e-9


@pytest.mark.slow
def test_car_by_every_number_over_the_bump(monkeypatch, car):
    """All 54 numbers at once: adjoint against direct, and a choice of them against differences of four points."""
    monkeypatch.setattr(_car, "BUMP_TIME", 0.05)
    psi = mb.Integral(lambda s: s.point_acceleration("driver")[2] ** 2)
    names, options = list(car.parameters), {"t": 0.4, "step": 1e-2}
    adjoint = mb.gradient(car, psi, names, method="adjoint", **options)
    direct = mb.gradient(car, psi, names, method="direct", **options)
    # hard points in m and stiffnesses in N/m: what a change by a hundredth of a metre or by one per cent does
    size = np.array(
        [
            0.01 if label.endswith("]") else 0.01 * where
            for label, where in zip(adjoint.labels, adjoint.where, strict=True)
        ]
    )
    scale = np.abs(direct.gradient * size).max()
    agreement = np.abs((adjoint.gradient - direct.gradient) * size).max() / scale
    print(f"{len(adjoint.labels)} numbers, adjoint - direct {agreement:.1e} of the largest effect")
    assert len(adjoint.labels) == 54
    assert agreement < 1e-11
    for name in ("front_spring_k", "rear_spring_c", "tyre_k", "front_lower_ball[2]"):
        now, values, i = car.value(name), [], adjoint.labels.index(name)
        e = 1e-3 * now
        for side in (1, -1, 2, -2):
            car.set({name: now + side * e})
            values.append(mb.gradient(car, psi, name, method="direct", **options).value)
        car.set({name: now})
        slope = (8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * e)
        error = abs(slope - adjoint.gradient[i]) * size[i] / scale
        print(
            f"  by {name}: differences {abs(slope / adjoint.gradient[i] - 1):.1e} of it, {error:.1e} of the largest effect"
        )
        assert error < 1e-9
    # a hinge that moves along itself changes nothing
    for i, label in enumerate(adjoint.labels):
        if label.endswith("_inner[0]") and "rod" not in label:
            assert abs(adjoint.gradient[i]) * size[i] < 1e-13 * scale


# docs/theory.md (23.13): value and derivatives by k, m and b
PARTICLE = np.array([3.89396846, 0.02152155, -0.21521547, 0.29491657])


@pytest.mark.slow
def test_nonholonomic_particle_has_the_known_gradient():
    """Second order in the step; what extrapolation leaves."""
    m = mb.examples.nonholonomic_particle()
    psi = mb.Integral(lambda s: np.sum(s.position("point") ** 2))
    runs = []
    for h in (5e-3, 2.5e-3):
        direct = mb.gradient(m, psi, ["k", "m", "b"], t=5.0, step=h, method="direct")
        adjoint = mb.gradient(m, psi, ["k", "m", "b"], t=5.0, step=h, method="adjoint")
        agreement = np.abs(adjoint.gradient - direct.gradient).max()
        print(f"h = {h}: adjoint - direct {agreement:.1e}")
        assert agreement < 1e-10 * np.abs(direct.gradient).max()
        runs.append(np.array([direct.value, *direct.gradient]))
    ratio = (runs[0] - PARTICLE) / (runs[1] - PARTICLE)
    left = np.abs((4 * runs[1] - runs[0]) / 3 - PARTICLE)
    print(f"particle: errors fall by {ratio}, extrapolated {left}")
    assert np.all(np.abs(ratio - 4) < 0.3)
    assert np.all(left < 2e-6)
