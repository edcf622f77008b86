"""Events of response curves against multipliers computed here, and curves that do not depend on how they are run through."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic, Gap, VaryingStiffness
from mbrs.nonlinear.frequency_response import frequency_response


def monodromy(stiffness, c, period, steps=4000):
    """Of x" + c x' + k(t) x = 0 by the exact motion of each step with the stiffness at its middle."""
    h = period / steps
    out = np.eye(2)
    for i in range(steps):
        k = stiffness((i + 0.5) * h)
        w = np.sqrt(complex(k - c * c / 4))
        cosine, sine = np.cos(w * h), (np.sin(w * h) / w if w else h)
        decay = np.exp(-c * h / 2)
        step = decay * np.array([[cosine + c / 2 * sine, sine], [-k * sine, cosine - c / 2 * sine]])
        out = step.real @ out
    return out


def border(a, b, growth):
    """Where the sign of a function changes, by bisection."""
    first = growth(a) > 0
    for _ in range(45):
        middle = 0.5 * (a + b)
        if (growth(middle) > 0) == first:
            a = middle
        else:
            b = middle
    return 0.5 * (a + b)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("damped", [False, True])
def test_both_borders_of_parametric_resonance(seed, damped):
    rng = np.random.default_rng(90 + seed)
    k, m = np.exp(rng.uniform(-2, 3)), np.exp(rng.uniform(-2, 2))
    depth, phase = rng.uniform(0.25, 0.45), rng.uniform(-3, 3)
    w0 = np.sqrt(k / m)
    zeta = rng.uniform(0.01, 0.03) if damped else 0.0

    def growth(W):
        phi = monodromy(lambda t: k / m * (1 + depth * np.cos(W * t + phase)), 2 * zeta * w0, 2 * np.pi / W)
        return float(np.max(np.abs(np.linalg.eigvals(phi)))) - 1 - 1e-9

    low, high = border(1.3 * w0, 2.0 * w0, growth), border(2.0 * w0, 2.8 * w0, growth)
    system = MechanicalSystem(
        [[m]], [[2 * zeta * w0 * m]], [[k]], elements=[VaryingStiffness(depth * k, phase=phase, w=[1.0])]
    )
    for omega in ((1.3 * w0, 2.8 * w0), (2.8 * w0, 1.3 * w0)):
        curve = frequency_response(system, force=[0.0], omega=omega, harmonics=5, max_step=0.07)
        kinds = [e.kind for e in curve.events]
        assert kinds == ["period-doubling"] * 2, kinds
        found = sorted(e.omega for e in curve.events)
        assert np.allclose(found, [low, high], rtol=3e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_one_freedom_with_damping_has_no_neimark_sacker_points(seed):
    # the product of its multipliers is exp(-c T / m): none of a pair on the unit circle
    rng = np.random.default_rng(7 + seed)
    k, m, gap = np.exp(rng.uniform([-1, -1, -1], 1))
    w0 = np.sqrt(k / m)
    stop = Gap(rng.uniform(300, 1200) * k, gap, bilateral=True, w=[1.0])
    system = MechanicalSystem([[m]], [[rng.uniform(0.05, 0.12) * m * w0]], [[k]], elements=[stop])
    for omega in ((0.6 * w0, 3.1 * w0), (3.1 * w0, 0.6 * w0)):
        curve = frequency_response(
            system, force=[0.5 * k * gap], omega=omega, harmonics=list(range(1, 42, 2)), max_points=150
        )
        assert not [e for e in curve.events if e.kind == "neimark-sacker"]
        for event in curve.events:
            if event.kind == "period-doubling":
                assert abs(event.exponent.real) <= 1e-3 * event.omega


def test_events_are_those_of_the_other_direction():
    rng = np.random.default_rng(3)
    for _ in range(3):
        n = 2
        M = np.diag(rng.uniform(0.5, 2, n))
        K = np.diag(rng.uniform(1, 40, n))
        K[0, 1] = K[1, 0] = -0.4
        w = rng.normal(size=n)
        system = MechanicalSystem(M, 0.04 * M, K, elements=[Cubic(0.3, w=w)])
        w0 = float(np.sqrt(K[0, 0] / M[0, 0]))
        ends = (0.5 * w0, 2.0 * w0)
        up = frequency_response(system, force=[0.2, 0.1], omega=ends, harmonics=3)
        down = frequency_response(system, force=[0.2, 0.1], omega=ends[::-1], harmonics=3)
        assert [e.kind for e in up.events] == [e.kind for e in down.events][::-1]
        assert np.allclose([e.omega for e in up.events], [e.omega for e in down.events][::-1], rtol=1e-8)


def beam_with_a_stop():
    """A cantilever whose tip meets a stop: around 9 Hz its motion loses stability over a band of .15 Hz."""
    beam = mb.flexible.beam(
        1.0, E=2.1e11, rho=7800.0, area=2e-4, I_flap=1.6667e-9, I_edge=6.667e-9, modes=8, attach=["tip"], damping=0.01
    )
    m = mb.Model("beam")
    body = m.flexible_body("beam", beam)
    m.fixed("clamp", m.ground, body.node("root"))
    tip = body.node("tip")
    m.bushing("stop", m.ground, tip, at=(1, 0, 0), law={"z": mb.Gap(5e3, 1e-3)})
    return m, tip.force("z")


@pytest.mark.slow
@pytest.mark.parametrize("harmonics", [9, 15])
def test_a_band_without_stability_between_two_points_is_found(harmonics):
    """Steps of the sweep downwards reach over the whole band, at whose ends the motion is stable."""
    m, force = beam_with_a_stop()
    bands = []
    for ends in ((8.6, 9.6), (15.0, 5.0)):
        curve = mb.frequency_response(m, inputs=force, amplitude=0.3, frequency=ends, harmonics=harmonics)
        bands.append(sorted(e.omega for e in curve.events if e.kind == "neimark-sacker"))
    assert len(bands[0]) == len(bands[1]) == 2 and np.allclose(*bands, rtol=1e-6), bands


@pytest.mark.slow
def test_a_fold_at_a_stop_is_not_told_again_as_a_branch_point():
    """The multipliers of odd motions, integrated in time, pass 1 beside the fold, behind the next point of the curve; where they
    pass 1 without a fold, the symmetry breaks, as even harmonics show by the sign of the determinant."""
    stop = Gap(1e3, 1.0, bilateral=True, w=[1.0])
    system = MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[stop])
    curve = frequency_response(system, force=[0.5], omega=(0.5, 6), harmonics=list(range(1, 102, 2)))
    assert [e.kind for e in curve.events] == ["branch-point", "branch-point", "fold", "fold"]
    top = curve.events[2].index
    assert np.isnan(np.asarray(curve.stable, float)[top])  # the multipliers call it stable, the fold does not
    broken = frequency_response(system, force=[0.5], omega=(0.9, 1.05), harmonics=101)
    (event,) = (e for e in broken.events if e.exponent is None)
    assert event.kind == "branch-point" and abs(event.omega - curve.events[1].omega) < 1e-3


@pytest.mark.parametrize("seed", [2, 9, 11])
def test_a_spring_without_a_contact_does_not_graze(seed):
    """Softening springs with few harmonics, which leave open how exponents pass the axis."""
    rng = np.random.default_rng([7, seed])
    A, B = rng.normal(size=(2, 2)), rng.normal(size=(2, 2))
    M, K = A @ A.T + np.eye(2), B @ B.T + 0.3 * np.eye(2)
    force, w = 0.1 * rng.normal(size=2), rng.normal(size=2)
    first = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.min())
    spring = Cubic(-rng.uniform(0.05, 0.2), w=w)
    system = MechanicalSystem(M, 0.01 * (K + M), K, elements=[spring])
    curve = frequency_response(system, force=force, omega=(0.5 * first, 2.5 * first), harmonics=3, max_points=300)
    assert "grazing" not in [e.kind for e in curve.events]
    assert all(e.status == "unresolved" for e in curve.events if e.kind == "unresolved")
    assert seed != 2 or "unresolved" in [e.kind for e in curve.events]
