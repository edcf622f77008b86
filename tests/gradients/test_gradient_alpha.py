"""Gradients of generalised-alpha: the discrete solution of mb.simulate, direct and adjoint, against complex steps and differences."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.examples import five_bar
from motion_models import blade, open_chain, silent, spatial_loop
from oracles.generalized_alpha_gradient import AlphaScheme
from test_gradient import FIVE_BAR, LENGTHS, SOME, against_the_reference, differences, drift, three_ways, worst

ALPHA = {"scheme": "generalized-alpha"}


@pytest.mark.parametrize("make", [five_bar, open_chain, spatial_loop, blade], ids=lambda f: f.__name__)
@pytest.mark.parametrize("rho", [0.8, 1.0, 0.3])
def test_the_values_are_those_of_the_simulation(make, rho):
    m = silent(make)
    body = m.bodies[-1].name
    traj = mb.simulate(m, t=0.3, step=0.02, method="generalized-alpha", rho=rho)
    for i in range(3):
        for what, found in (("position", traj.position(body)), ("velocity", traj.velocity(body))):
            psi = mb.AtTimes(traj.t[1:], lambda s, i=i, what=what: getattr(s, what)(body)[i])
            value = mb.gradient(m, psi, "gravity", t=0.3, step=0.02, rho=rho, method="direct", **ALPHA).value
            # mb.simulate stops Newton's method at 1e-9 h^2 a; gradients go on to rounding
            assert value == pytest.approx(found[1:, i].sum(), rel=1e-8, abs=1e-8)


@pytest.mark.oracle
@pytest.mark.parametrize("make", list(SOME), ids=lambda f: f.__name__)
def test_gradients_are_the_complex_step_of_the_reference(make):
    """Positions, velocities and accelerations after 4 steps and their derivatives, through assembly, start and all steps."""
    motion, errors = against_the_reference(
        make, lambda mech, h, n: AlphaScheme(mech, np.zeros(1), h).run(n)[-1], **ALPHA
    )
    assert max(motion) < 1e-9
    assert max(errors) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.8, 0.0, 1.0])
@pytest.mark.parametrize("make", list(SOME), ids=lambda f: f.__name__)
def test_adjoint_is_direct_and_both_are_the_differences(make, rho):
    direct, adjoint, agreement, error = three_ways(make, f"rho {rho}", rho=rho, **ALPHA)
    assert adjoint.value == pytest.approx(direct.value, rel=1e-13)
    assert agreement < 1e-9
    assert error < 1e-7


def test_steps_of_different_lengths():
    """The algorithmic acceleration is shifted where the step changes: that is differentiated, too."""
    m = silent(spatial_loop)
    times = [0.05, 0.083, 0.2]
    psi = mb.AtTimes(times, lambda s: s.position("rocker")[0] + 0.1 * s.acceleration("crank")[2])
    options = {"t": 0.25, "step": 0.02, **ALPHA}
    names = ["spring.k", "R1.at[0]", "crank.mass"]
    direct = mb.gradient(m, psi, names, method="direct", **options)
    adjoint = mb.gradient(m, psi, names, method="adjoint", **options)
    error = worst(direct.gradient, differences(m, psi, names, **options))
    agreement = worst(adjoint.gradient, direct.gradient)
    print(f"uneven steps: adjoint - direct {agreement:.1e}, differences {error:.1e}")
    assert len(set(np.round(np.diff(direct.t), 6))) > 1
    assert agreement < 1e-9
    assert error < 1e-7


def test_the_five_bar_converges_with_second_order():
    errors = []
    for h in (0.01, 0.005, 0.0025):
        value, grad = mb.gradient(
            silent(five_bar), mb.Integral(drift), LENGTHS, t=1.0, step=h, method="direct", **ALPHA
        )
        errors.append([abs(value - FIVE_BAR[1.0][0]), np.abs(grad - FIVE_BAR[1.0][1]).max()])
    ratios = np.divide(errors[1], errors[2])
    print(f"errors of value and gradient at h = .0025: {errors[-1]}, ratios {ratios}")
    assert np.all(np.abs(ratios - 4.0) < 0.5)
    assert np.all(np.array(errors[-1]) < [1e-4, 1e-3])


def test_trajectories_and_checkpoints():
    m = silent(five_bar)
    traj = mb.simulate(m, t=0.2, step=0.01, method="generalized-alpha", parameters=LENGTHS, rho=0.6)
    d = traj.sensitivity("P2")
    goals = [mb.Final(lambda s, i=i: s.point("P2")[i]) for i in range(3)]
    whole = mb.gradient(m, goals, LENGTHS, t=0.2, step=0.01, rho=0.6, method="adjoint", **ALPHA)
    again = mb.gradient(m, goals, LENGTHS, t=0.2, step=0.01, rho=0.6, method="adjoint", keep=0, **ALPHA)
    assert np.allclose(d[-1], whole.gradient, rtol=1e-9, atol=1e-12)
    assert np.allclose(again.gradient, whole.gradient, rtol=1e-9, atol=1e-12)
    assert again.stats.counts["stored states"] < 20
    assert whole.stats.counts["stored states"] > 20


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rho": 1.5}, "rho= must be a finite number from 0 to 1"),
        ({"rho": "x"}, "rho= must be"),
        ({"weight": "mass"}, "belongs to scheme='ali3p'"),
        ({"scheme": "ali3p", "rho": 0.5}, "rho= belongs to"),
    ],
)
def test_wrong_variants_are_named(change, message):
    with pytest.raises(mb.errors.ModelError, match=message):
        mb.gradient(silent(five_bar), mb.Integral(drift), LENGTHS, t=0.1, **{**ALPHA, **change})
