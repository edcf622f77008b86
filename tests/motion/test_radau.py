"""`method="radau"`: order, stiff scenes, estimates, constraints, restarts, invariances, what the choice of "auto" costs.

Truths are closed forms, equations in the fewest coordinates that SciPy solves, and tight explicit runs of the same model.
"""

from __future__ import annotations

import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from mbrs.errors import ModelError
from scipy.integrate import solve_ivp

REAL = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def oblique_four_bar(rng):
    """Four hinges about one arbitrary axis; all four of them carry rows that repeat each other."""
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.8, 0.0], [1.3, 1.1, 0.0], [1.5, -0.1, 0.0]]) + 0.1 * rng.normal(
        size=(4, 3)
    ) * [1, 1, 0]
    at = [R @ p for p in corners]
    m = mb.Model("four-bar", gravity=R @ [1.0, -9.0, 0.0])
    bars = []
    for i in range(3):
        middle = 0.5 * (at[i] + at[i + 1])
        I = np.diag(0.02 + 0.1 * rng.random(3) * 0.2)  # noqa: E741
        bars.append(m.body(f"bar{i}", mass=0.7 + rng.random(), inertia=R @ I @ R.T, at=middle))
    ends = [m.ground, *bars, m.ground]
    for i in range(4):
        m.revolute(f"hinge{i}", ends[i], ends[i + 1], at=at[i], axis=R[:, 2])
    m.marker("tip", bars[1], at=at[2])
    return m


def tilted_pendulum(rng):
    """Two rigid bodies on oblique hinges."""
    m = mb.Model("tilted pendulum", gravity=rng.normal(size=3) * 5)
    before, place = m.ground, np.zeros(3)
    for name in ("upper", "lower"):
        way = rng.normal(size=3)
        body = m.body(name, mass=1.0 + rng.random(), inertia=0.1 + 0.1 * rng.random(3), at=place + way / 2)
        m.revolute(f"{name} hinge", before, body, at=place, axis=rng.normal(size=3))
        before, place = body, place + way
    m.marker("tip", before, at=place)
    return m


def ball_and_rod(rng):
    """A body on a ball joint whose far end a rod holds: a loop with rotations that act together."""
    m = mb.Model("ball and rod", gravity=rng.normal(size=3) * 5)
    end = rng.normal(size=3)
    body = m.body(
        "body",
        mass=1.3,
        inertia=0.2 + 0.1 * rng.random(3),
        at=end / 2,
        angular_velocity=np.cross(end, rng.normal(size=3)),
    )
    m.spherical("ball", m.ground, body, at=(0, 0, 0))
    m.distance("rod", m.ground, body, at=(end + rng.normal(size=3), end))
    m.marker("tip", body, at=end)
    return m


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("make", [oblique_four_bar, tilted_pendulum, ball_and_rod], ids=lambda f: f.__name__)
def test_order_five_at_oblique_axes(make, seed):
    m = make(np.random.default_rng(seed))
    exact = mb.simulate(m, [0.6], rtol=1e-12, method="explicit").point("tip")[-1]
    errors = [
        np.abs(mb.simulate(m, [0.6], step=0.6 / n, method="radau").point("tip")[-1] - exact).max() for n in (24, 48, 96)
    ]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    print(f"{make.__name__}: {errors}, orders {slopes.round(2)}")
    # near rounding the slope says nothing
    assert errors[-1] < 1e-12 or max(slopes) > 4.6


@pytest.mark.parametrize(("order", "steps"), [(5, (16, 24, 32, 48)), (9, (3, 4, 6))])
@pytest.mark.parametrize("seed", range(6))
def test_orders_of_a_vibration(seed, order, steps):
    """A damped oscillator along any axis, in place and rate against the closed form."""
    rng = np.random.default_rng(seed)
    axis, t = rng.normal(size=3), 1.7
    axis /= np.linalg.norm(axis)
    mass, w, zeta, speed = np.exp(rng.uniform(-1, 1)), rng.uniform(2, 4), rng.uniform(0, 0.2), rng.uniform(0.5, 2)
    m, at = mb.Model("oscillator"), rng.normal(size=3)
    b = m.body("b", mass=mass, inertia=(0.1, 0.2, 0.3), at=at, velocity=speed * axis)
    m.prismatic("rail", m.ground, b, at=at, axis=axis, k=mass * w**2, c=2 * zeta * w * mass)
    root = w * complex(-zeta, np.sqrt(1 - zeta**2))
    exact = (np.array([1.0, root]) * np.exp(root * t)).imag * speed / root.imag
    errors = []
    for n in steps:
        traj = mb.simulate(m, [0.0, t], step=t / n, method="radau", order=order)
        place, rate = (traj.position(b)[-1] - traj.position(b)[0]) @ axis, traj.velocity(b)[-1] @ axis
        errors.append(np.hypot(place - exact[0], (rate - exact[1]) / w))
    slopes = np.diff(np.log(errors)) / -np.diff(np.log(steps))
    print(order, errors, slopes.round(2))
    assert np.all(np.abs(slopes - order) < 0.3)


def test_order_nine_holds_between_steps():
    problem = zoo.five_bar()
    errors = [
        problem.error_of(
            mb.simulate(problem.model, np.linspace(0, problem.t, 83)[1:], step=problem.t / n, method="radau", order=9)
        )
        for n in (5, 10)
    ]
    print(errors)
    assert errors[1] < 2e-8 and np.log2(errors[0] / errors[1]) > 6.0


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_a_stiff_governor(rtol):
    """Springs of 8e5 N/m in the place of rods: 1.3e4 1/s beside a motion of 6 rad/s."""
    problem = zoo.governor(turned=REAL)
    traj = mb.simulate(problem.model, np.linspace(0, problem.t, 11), rtol=rtol)
    error = problem.error_of(traj)
    print(f"{traj.method}: {error:.1e}, estimated {traj.error:.1e}, {len(traj.steps) - 1} steps")
    assert traj.method == "radau" and error < 10 * rtol + 1e-9 and len(traj.steps) < 300
    assert 0.1 < traj.error / error < 10


@pytest.mark.slow
def test_a_van_der_pol_oscillator():
    """x" + mu (x^2 - 1) x' + x = 0, mu = 300: long slow ways, fast jumps."""
    mu = 300.0
    m = mb.Model("van der Pol")
    b = m.body("b", mass=1.0, inertia=(0.1,) * 3, at=(0, 0, 0), velocity=REAL @ [1.0, 0.0, 0.0])
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=REAL @ [1.0, 0.0, 0.0], k=1.0, c=-mu, law=mb.VanDerPol(mu))
    times = [100.0, 230.0, 450.0]
    run = solve_ivp(
        lambda _, y: [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]],
        (0, 450.0), [0.0, 1.0], "Radau", times, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    traj = mb.simulate(m, times, rtol=1e-7, method="radau")
    error = np.abs(traj.position("b") @ REAL[:, 0] - run.y[0]).max()
    print(f"{error:.1e} in {len(traj.steps) - 1} steps; {traj.stats.counts}")
    assert error < 1e-4 and len(traj.steps) < 1500


@pytest.mark.parametrize("stiff", [1e4, 1e8, 1e12])
def test_errors_do_not_grow_with_stiffness(stiff):
    """Undamped at 4e3 to 4e7 1/s: followed where the rates show it at this tolerance (1e4), else stepped over."""
    problem = zoo.bushings(stiff=stiff, damping=1.0)
    traj = mb.simulate(problem.model, np.linspace(0, 1, 11), rtol=1e-5, method="radau")
    error = problem.error_of(traj)
    print(f"{stiff:.0e}: {error:.1e} in {len(traj.steps) - 1} steps")
    assert error < 2e-4 and len(traj.steps) < (2000 if stiff == 1e4 else 200)


@pytest.mark.parametrize(
    ("order", "tolerances"),
    [(5, [1e-6]), *(pytest.param(n, [1e-4, 1e-6, 1e-8], marks=pytest.mark.slow) for n in (5, 9))],
)
def test_estimates_tell_the_error(order, tolerances):
    ratios = []
    for name in ("double_pendulum", "free_body", "five_bar", "skate", "slider_crank", "bead_on_arm", "rolling_disc"):
        problem = zoo.SMOOTH[name]()
        for rtol in tolerances:
            traj = mb.simulate(problem.model, np.linspace(0, problem.t, 11), rtol=rtol, method="radau", order=order)
            error = problem.error_of(traj)
            ratios.append(traj.error / error)
            print(f"{name}, {rtol:.0e}: {error:.1e}, estimated over true {ratios[-1]:.2f}")
            assert error < 60 * rtol
    assert np.mean([0.1 < r < 10 for r in ratios]) >= 0.95


def test_order_nine_takes_fewer_and_larger_steps_at_tight_tolerances():
    problem = zoo.five_bar()
    counts = [
        mb.simulate(problem.model, problem.t, rtol=1e-10, method="radau", order=order).stats.counts for order in (5, 9)
    ]
    five, nine = (3 * counts[0]["iterations"], 5 * counts[1]["iterations"])
    print(counts, five, nine)
    assert counts[1]["steps"] < counts[0]["steps"] / 4 and nine < five / 2


def test_matrices_are_kept_and_the_explicit_method_has_none():
    counts = mb.simulate(zoo.governor().model, 1.0, rtol=1e-6, method="radau").stats.counts
    print(counts)
    assert 0 < counts["tangents"] < 0.8 * counts["steps"] and counts["factorisations"] < counts["iterations"]


def test_work_of_steps_that_keep_matrices_and_lengths():
    """Neither are corrections made in vain with old matrices, nor matrices and factors where old ones would do."""
    (governor, linkage), tight = (
        [mb.simulate(p.model, 1.0, rtol=1e-6, method="radau").stats.counts for p in (zoo.governor(), zoo.five_bar())],
        mb.simulate(zoo.five_bar().model, 1.0, rtol=1e-8, method="radau").stats.counts,
    )
    print(governor, linkage, tight)
    assert governor["iterations"] < 165
    assert linkage["iterations"] < 155 and linkage["factorisations"] < 25
    assert linkage["position projections"] < 1.5 * linkage["steps"]  # closed loops are not closed again
    assert tight["tangents"] < 12
    # first corrections that are small beside the tolerance are the last ones, but where rows hold they say nothing of multipliers
    for problem, most in ((zoo.double_pendulum(), 1.3), (zoo.five_bar(), 2.1)):
        short = mb.simulate(problem.model, 0.3, rtol=1e-4, method="radau", max_step=5e-3).stats.counts
        print(short["iterations"] / short["steps"])
        assert short["iterations"] < most * short["steps"]


def test_a_restart_goes_on():
    m = zoo.governor().model
    whole = mb.simulate(m, [0.4, 1.0], rtol=1e-8, method="radau")
    first = mb.simulate(m, [0.4], rtol=1e-8, method="radau")
    second = mb.simulate(m, [1.0], rtol=1e-8, method="radau", at=first.state(0.4))
    assert np.abs(whole.position("collar")[-1] - second.position("collar")[-1]).max() < 1e-7


def test_gradients_name_the_methods_that_have_them():
    with pytest.raises(ModelError, match=r"'bdf-bfgs' has no sensitivities.*'radau'"):
        mb.simulate(zoo.governor().model, 0.1, method="bdf-bfgs", parameters="collar.mass")


def test_a_free_body_that_spins_fast_is_not_lost_in_its_chart():
    """A turn of more than half a revolution in a step is no rotation vector: such steps are shortened, not accepted."""
    problem = zoo.heavy_top(t=0.1)
    traj = mb.simulate(problem.model, [0.05, 0.1], rtol=1e-3, first_step=0.05, method="radau")
    assert problem.error_of(traj) < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_stiff_part_beside_a_small_vibration_holds_no_steps(seed):
    """A mass on a spring of its own, undamped and far faster than all else, that moves less than the tolerance sees."""
    rng = np.random.default_rng(seed)

    def model(part):
        m = mb.examples.cubic_hexapod()
        m.gravity = rng_gravity
        if part:
            b = m.body("part", mass=0.7, inertia=(0.01, 0.02, 0.03), at=(3.1, 0.2, 0.4))
            m.bushing("hold", m.ground, b, at=(3.1, 0.2, 0.4), k=(0.7 * w2,) * 3 + (0.02 * w2,) * 3)
        return m

    rng_gravity, w2 = tuple(rng.normal(size=3) * 5), 10.0 ** rng.uniform(9.3, 11.0)
    alone, beside = (mb.simulate(model(part), [0.0, 0.1], method="radau", rtol=1e-8) for part in (False, True))
    off = np.abs(alone.position("payload")[-1] - beside.position("payload")[-1]).max()
    print(f"w {np.sqrt(w2):.1e} 1/s: {len(alone.steps)} and {len(beside.steps)} steps, {off:.1e} m apart")
    assert len(beside.steps) < 2 * len(alone.steps) and off < 1e-8


def test_order_is_five_or_nine_and_belongs_to_radau():
    m = zoo.double_pendulum().model
    with pytest.raises(ModelError, match="order= is 5 or 9"):
        mb.simulate(m, 0.1, method="radau", order=7)
    with pytest.raises(ModelError, match='belongs to method="radau"'):
        mb.simulate(m, 0.1, method="bdf", order=5)
    with pytest.raises(ModelError, match="order 5"):
        mb.simulate(m, 0.1, step=0.1, method="radau", order=9, parameters="upper.mass")
    five, plain = (mb.simulate(m, 0.1, rtol=1e-6, method="radau", **more) for more in ({"order": 5}, {}))
    assert np.array_equal(five.q, plain.q)
