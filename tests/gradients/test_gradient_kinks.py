"""Where a motion has no derivative: kinks of laws are named with time and element, impacts of drives are refused."""

import contextlib
import warnings

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import KinkWarning


def slider(law, velocity=1.0, **given):
    """A mass that flies along x at a spring with a law. Data invented."""
    m = mb.Model("slider")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(velocity, 0, 0))
    m.prismatic("stop", m.ground, p, at=(0, 0, 0), axis="x", law=law, **given)
    return m


PSI = mb.Final(lambda s: s.position("p")[0])


@pytest.mark.parametrize("scheme", ["explicit", "radau", "bdf", "ali3p", "generalized-alpha"])
@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_a_step_ends_where_a_gap_closes(method, scheme):
    m = slider(mb.Gap(4000.0, 0.0305))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = mb.gradient(m, PSI, ["p.velocity[0]", "stop.law[1]"], t=0.05, step=1e-3, method=method, scheme=scheme)
    assert found.status == "converged"
    assert np.abs(found.t - 0.0305).min() < 1e-9
    # x = g + v/w sin w(t - g/v)
    w, g, v = np.sqrt(4000.0), 0.0305, 1.0
    exact = [np.sin(w * (0.05 - g / v)) / w + g / v * np.cos(w * (0.05 - g / v)), 1 - np.cos(w * (0.05 - g / v))]
    rtol = {"explicit": 1e-9, "radau": 1e-7, "bdf": 1e-4}.get(scheme, 2e-3)
    assert np.allclose(found.gradient, exact, rtol=rtol)


def test_what_does_not_reach_its_gap_is_silent():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = mb.gradient(slider(mb.Gap(4000.0, 0.5)), PSI, "p.mass", t=0.05, step=1e-3)
    assert found.status == "converged"
    assert found.kinks == ()


def test_a_smoothed_gap_has_a_kink_only_for_steps_that_jump_over_it():
    def kinks(step):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return mb.gradient(slider(mb.Gap(400.0, 0.0305, smoothing=0.01)), PSI, "p.mass", t=0.05, step=step).kinks

    assert kinks(1e-3) == ()
    assert [k[1] for k in kinks(0.025)] == ["stop"]


def test_friction_that_changes_its_sign_within_a_step():
    m = slider(mb.CoulombTanh(0.2, 0.02), velocity=0.5, k=50.0)
    with pytest.warns(KinkWarning, match="friction changes its sign within a step"):
        found = mb.gradient(m, PSI, "p.mass", t=0.6, step=2e-2)
    assert {k[1] for k in found.kinks} == {"stop"}
    fine = slider(mb.CoulombTanh(2.0, 0.5), velocity=0.1, k=50.0)
    assert mb.gradient(fine, PSI, "p.mass", t=0.6, step=5e-3).kinks == ()


def test_a_slider_that_begins_to_slide():
    with pytest.warns(KinkWarning, match="slider begins or ceases to slide"):
        found = mb.gradient(slider(mb.Jenkins(100.0, 3.0)), PSI, "p.mass", t=0.2, step=5e-3)
    assert found.kinks[0][0] == pytest.approx(0.03, abs=0.01)


def test_many_kinks_are_counted():
    m = slider(mb.Jenkins(4000.0, 3.0), velocity=3.0, k=3000.0)
    with pytest.warns(KinkWarning, match=r"and \d+ more"):
        found = mb.gradient(m, PSI, "p.mass", t=0.5, step=1e-3)
    assert len(found.kinks) > 5
    assert np.all(np.diff([k[0] for k in found.kinks]) > 0)


def test_a_force_that_jumps_is_named():
    m = slider(mb.FunctionLaw(lambda t, u, v: 5.0 * np.sign(u - 0.0305)))
    with pytest.warns(KinkWarning, match="its force jumps"):
        found = mb.gradient(m, PSI, "p.mass", t=0.05, step=1e-3)
    assert found.status == "kinks"


def driven(motion, velocity=(0.0, 0.0, 0.0)):
    m = mb.Model("driven")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=velocity)
    q = m.body("q", mass=1.0, inertia=(1, 1, 1), at=(0.5, 0, 0), velocity=velocity)
    rail = m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x")
    m.prismatic("spring", p, q, at=(0.5, 0, 0), axis="x", k=50.0)
    m.drive("motor", rail, motion)
    return m


@pytest.mark.parametrize(
    "motion",
    [mb.Ramp(1.0, start=0.1), mb.Table([0.0, 0.1, 0.3], [0.0, 0.0, 1.0], kind="linear")],
    ids=["ramp", "lines"],
)
@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_an_impact_is_not_differentiable(motion, method):
    m = driven(motion)
    psi = mb.Final(lambda s: s.position("q")[0])
    with pytest.raises(mb.errors.NotDifferentiableError, match=r"'motor'.* jumps .*t = 0\.1.* s: an impact"):
        mb.gradient(m, psi, "spring.k", t=0.2, step=0.01, method=method)
    # before it there is one
    assert np.isfinite(mb.gradient(m, psi, "spring.k", t=0.09, step=0.01, method=method).gradient).all()


@pytest.mark.parametrize("change, impact", [(1e-10, False), (-1e-10, False), (1e-8, True), (-1e-8, True)])
def test_a_rate_that_changes_by_rounding_is_no_impact(change, impact):
    m = driven(mb.Table([-1.0, 0.1, 1.1], [-1.0, 0.1, 1.1 + change], kind="linear"), velocity=(1.0, 0.0, 0.0))
    expected = (
        pytest.raises(mb.errors.NotDifferentiableError, match="an impact") if impact else contextlib.nullcontext()
    )
    with expected:
        mb.gradient(m, mb.Final(lambda s: s.position("q")[0]), "spring.k", t=0.2, step=0.01)


def test_loads_with_kinks_end_a_step_there():
    m = mb.Model("late")
    p = m.body("p", mass=2.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x")
    m.force("late", p, at=(0, 0, 0), value=(mb.Ramp(6.0, start=0.0513), 0, 0))
    for scheme in ("ali3p", "generalized-alpha"):
        for method in ("direct", "adjoint"):
            found = mb.gradient(m, PSI, ["p.mass"], t=0.1, step=0.01, scheme=scheme, method=method)
            # x = r (t - s)^3 / (6 m); the rule of the scheme leaves an error of second order
            assert np.abs(found.t - 0.0513).min() <= 0.0513 * jitter.level()
            assert found.gradient[0] == pytest.approx(-found.value / 2.0, rel=1e-9)
            traj = mb.simulate(m, t=0.1, step=0.01, method=scheme)
            assert found.value == pytest.approx(traj.position("p")[-1, 0], rel=1e-3)
