"""Gradients of motions: direct and adjoint against each other, against complex steps of the reference and differences."""

import mbrs as mb
import numpy as np
import pytest
from agreement import all_addresses
from mbrs.examples import five_bar
from mbrs.model.directions import directions
from mbrs.model.tables import tables
from motion_models import blade, open_chain, silent, spatial_loop
from oracles.ali3p import Scheme
from oracles.ali3p_tree import TreeMechanism

R0 = np.array([0.5, -2.0, 0.0])
LENGTHS = ["spring1.length", "spring2.length"]
# docs/theory.md (23.12): converged, Runge-Kutta and DOP853 agree
FIVE_BAR = {1.0: (0.1144363742, (-0.62560973, 0.47715465)), 2.0: (0.2384041958, (-1.33084740, 0.99780747))}

SOME = {
    five_bar: ["spring1.length", "spring2.k", "left.mass", "left.at[0]", "A.at[0]"],
    open_chain: [
        "a.mass",
        "S.at[1]",
        "U.axis",
        "bush.k[1]",
        "P.axis",
        "a.angular_velocity[1]",
        "b.com[0]",
        "pull.value[2]",
    ],
    spatial_loop: ["R1.at[0]", "rod.at_a[1]", "spring.c", "crank.inertia[0,1]", "spring.length"],
    blade: ["edge.at[0]", "spring.k", "blade.velocity[0]", "blade.angular_velocity[2]", "blade.mass"],
}


def drift(s):
    """How far point 2 of the five-bar is from where it was drawn."""
    return np.sum((s.point("P2") - R0) ** 2)


def everything(m):
    """An objective that reads every kind of quantity."""
    body, joint = m.bodies[-1].name, m.joints[0].name

    def g(s):
        out = np.sum(s.position(body) * [1.0, -2.0, 0.5]) + 0.1 * np.sum(s.velocity(body) ** 2)
        out = (
            out
            + 0.01 * np.sum(s.acceleration(body) * [1.0, 0.3, -0.2])
            + np.sum(s.rotation(body) * np.arange(9).reshape(3, 3))
        )
        out = out + 0.1 * s.angular_velocity(body)[2] + 0.01 * s.angular_acceleration(body)[1]
        out = out + np.sum(s.joint(joint)) + np.sum(s.point((0.1, 0.2, 0.3), of=body) ** 2)
        return out + 0.02 * np.sum(s.reaction(joint))

    return g


def differences(m, psi, parameters, part=1e-3, **options):
    """Central differences of four points through the whole motion."""
    rows = []
    for p in parameters:
        now = m.value(p)
        e = part * max(1.0, abs(float(now)))
        values = []
        for side in (1, -1, 2, -2):
            m.set({p: now + side * e})
            values.append(mb.gradient(m, psi, parameters[:1], method="direct", **options).value)
        m.set({p: now})
        rows.append((8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * e))
    return np.array(rows)


def worst(a, b):
    """Largest difference over the largest entry."""
    return float(np.max(np.abs(np.asarray(a) - np.asarray(b))) / np.max(np.abs(b)))


def three_ways(make, title, **variant):
    """Direct and adjoint gradients of a short motion, how far apart they are, and the first from differences."""
    m = silent(make)
    single = [p for p in SOME[make] if not p.endswith("axis")]
    psi = mb.Integral(everything(m))
    options = {"t": 0.2, "step": 0.02, **variant}
    direct = mb.gradient(m, psi, SOME[make], method="direct", **options)
    adjoint = mb.gradient(m, psi, SOME[make], method="adjoint", **options)
    agreement = worst(adjoint.gradient, direct.gradient)
    kept = [i for i, label in enumerate(direct.labels) if label in single]
    error = worst(np.asarray(direct.gradient)[kept], differences(m, psi, single, **options))
    print(f"{make.__name__}, {title}: adjoint - direct {agreement:.1e}, direct - differences {error:.1e}")
    return direct, adjoint, agreement, error


@pytest.mark.some(1)
@pytest.mark.parametrize("t", [1.0, 2.0])
def test_five_bar_has_the_known_gradient(t):
    errors = []
    for h in (0.01, 0.005, 0.0025):
        value, grad = mb.gradient(silent(five_bar), mb.Integral(drift), LENGTHS, t=t, step=h, method="direct")
        errors.append([abs(value - FIVE_BAR[t][0]), np.abs(grad - FIVE_BAR[t][1]).max()])
    ratios = np.divide(errors[1], errors[2])
    print(f"T = {t}: errors of value and gradient at h = .0025: {errors[-1]}, ratios {ratios}")
    assert np.all(np.abs(ratios - 4.0) < 0.2)
    assert np.all(np.array(errors[-1]) < [1e-4, 1e-3])
    # Richardson extrapolation takes the h^2 term out
    fine = [np.array(e) for e in errors]
    assert np.all(np.abs((4 * fine[2] - fine[1]) / 3) < [1e-7, 2e-6])


def read_of_reference(mech, end):
    """Position, velocity and acceleration of the last body's origin by the reference, (9,)."""
    state, T, _ = mech._maps(end.q, end.v)
    body = slice(6 * (len(mech.sys.bodies) - 1), 6 * len(mech.sys.bodies))
    linear, turning = np.split((T.value @ end.a + T.derivative(1) @ end.v)[body], 2)
    arm, spin = -end.q.R[-1] @ mech.sys.bodies[-1].com, state.w[-1]
    velocity = state.v[-1] + np.cross(spin, arm)
    return np.concatenate(
        [end.q.r[-1] + arm, velocity, linear + np.cross(turning, arm) + np.cross(spin, np.cross(spin, arm))]
    )


def mixtures(gradient, count=4):
    """Random sums of the parameters, each weighed by what it does: a wrong column shows in all of them, and four runs of the
    reference do for a dozen numbers."""
    size = np.linalg.norm(np.asarray(gradient), axis=0)
    weights = (
        np.random.default_rng(2).choice([-1.0, 1.0], (len(size), count)) * np.linspace(1.0, 2.0, len(size))[:, None]
    )
    return weights / np.where(size > 0.0, size, size.max())[:, None]


def against_the_reference(make, end_of, n=4, h=0.01, **variant):
    """Distances of motion and gradients, direct and adjoint, from complex steps of the reference; a number for each kind."""
    m = silent(make)
    t, along, body = tables(m), directions(m, SOME[make]), m.bodies[-1].name

    def run(x):
        mech = TreeMechanism(t, x)
        return read_of_reference(mech, end_of(mech, h, n))

    kinds = ("position", "velocity", "acceleration")
    goals = [mb.Final(lambda s, k=k, i=i: getattr(s, k)(body)[i]) for k in kinds for i in range(3)]
    direct, adjoint = (
        mb.gradient(m, goals, SOME[make], t=n * h, step=h, method=k, **variant) for k in ("direct", "adjoint")
    )
    value = run(t["x"])
    eps, ways = 1e-40, mixtures(direct.gradient)
    exact = np.array([run(t["x"] + 1j * eps * way).imag / eps for way in (along.dense @ ways).T]).T
    motion = [
        np.abs(direct.value - value)[i : i + 3].max() / max(1.0, np.abs(value[i : i + 3]).max()) for i in (0, 3, 6)
    ]
    errors = [
        max(worst(np.asarray(g.gradient)[i : i + 3] @ ways, exact[i : i + 3]) for g in (direct, adjoint))
        for i in (0, 3, 6)
    ]
    print(f"{make.__name__}: motion {motion}, gradients of {', '.join(kinds)}: {errors}")
    return motion, errors


@pytest.mark.oracle
@pytest.mark.parametrize("make", list(SOME), ids=lambda f: f.__name__)
def test_gradients_are_the_complex_step_of_the_reference(make):
    """Positions, velocities and accelerations after 4 steps and their derivatives, through assembly, start and all steps."""
    motion, errors = against_the_reference(
        make, lambda mech, h, n: Scheme(mech, np.zeros(1), h, "mass").run(n)[-1], weight="mass"
    )
    assert max(motion) < 1e-9
    assert max(errors) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("weight", ["tangent", "mass"])
@pytest.mark.parametrize("make", list(SOME), ids=lambda f: f.__name__)
def test_adjoint_is_direct_and_both_are_the_differences(make, weight):
    direct, adjoint, agreement, error = three_ways(make, weight, weight=weight)
    assert adjoint.value == pytest.approx(direct.value, rel=1e-14)
    assert agreement < 1e-9
    assert error < 1e-7


@pytest.mark.parametrize("make", [open_chain, spatial_loop, blade], ids=lambda f: f.__name__)
def test_every_number_of_a_model(make):
    """Each address in turn: adjoint against direct, all at once."""
    m = silent(make)
    body = m.bodies[-1].name
    addresses = [a for a in all_addresses(m) if not a.startswith("tip")]
    psi = mb.Final(lambda s: np.sum(s.position(body) * [1.0, 2.0, 3.0]) + np.sum(s.velocity(body)))
    direct = mb.gradient(m, psi, addresses, t=0.05, step=0.01, method="direct")
    adjoint = mb.gradient(m, psi, addresses, t=0.05, step=0.01, method="adjoint")
    scale = np.abs(direct.gradient).max()
    error = np.abs(adjoint.gradient - direct.gradient).max() / scale
    moved = np.count_nonzero(direct.gradient)
    print(f"{make.__name__}: {len(direct.labels)} numbers, {moved} of them matter, largest difference {error:.1e}")
    assert error < 1e-10
    assert moved > 20


def test_values_at_times_and_array_parameters():
    m = mb.Model("masses")
    V = m.parameter("V", np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    for i in range(2):
        b = m.body(f"b{i}", mass=V[i, 0], inertia=(1, 1, 1), at=(i, 0, 0))
        m.prismatic(f"p{i}", m.ground, b, at=(i, 0, 0), axis="x", k=V[i, 1], preload=V[i, 2])
    psi = mb.AtTimes([0.1, 0.25, 0.4], lambda s: (s.index + 1) * s.position("b0")[0] * s.position("b1")[0] + s.t)
    direct = mb.gradient(m, psi, "V", t=0.4, step=0.02, method="direct")
    adjoint = mb.gradient(m, psi, "V", t=0.4, step=0.02, method="adjoint")
    assert direct.gradient.shape == (2, 3)
    assert np.allclose(direct.gradient, adjoint.gradient, rtol=1e-10, atol=1e-14)
    entries = [f"V[{i},{j}]" for i in range(2) for j in range(3)]
    assert worst(np.ravel(direct.gradient), differences(m, psi, entries, t=0.4, step=0.02)) < 1e-8
    assert np.array_equal(direct.gradient.vetter(), np.asarray(direct.gradient))
    traj = mb.simulate(m, t=0.4, step=0.02, parameters="V")
    d = traj.sensitivity("b0.position")
    assert d.shape == (21, 3, 2, 3)
    assert d.vetter().shape == (21, 6, 3)
    assert np.array_equal(d.vetter()[:, 3:6, 1], d[:, :, 1, 1])


def test_trajectory_sensitivity_is_the_derivative_of_the_trajectory():
    m = silent(spatial_loop)
    names = [
        "rocker.position",
        "rocker.velocity",
        "rocker.acceleration",
        "rocker.angular_velocity",
        "R1",
        "R2.reaction",
    ]
    read = {
        "rocker.position": lambda t: t.position("rocker"),
        "rocker.velocity": lambda t: t.velocity("rocker"),
        "rocker.angular_velocity": lambda t: t.angular_velocity("rocker"),
        "R1": lambda t: t.joint("R1"),
        "R2.reaction": lambda t: t.reaction("R2"),
    }
    options = {"t": 0.2, "step": 0.01, "method": "ali3p"}
    traj = mb.simulate(m, parameters=["spring.k", "R1.at[0]"], **options)
    exact = {name: traj.sensitivity(name) for name in names}
    for k, p in enumerate(["spring.k", "R1.at[0]"]):
        now = m.value(p)
        e = 1e-3 * max(1.0, now)
        ends = []
        for side in (1, -1, 2, -2):
            m.set({p: now + side * e})
            ends.append(mb.simulate(m, parameters=[p], **options))
        m.set({p: now})
        for name, f in read.items():
            a, b, c, d = (f(traj) for traj in ends)
            error = worst(np.asarray(exact[name])[..., k], (8 * (a - b) - (c - d)) / (12 * e))
            print(f"{name} by {p}: {error:.1e}")
            assert error < 1e-7
    with pytest.raises(mb.errors.ModelError, match="changed after this motion"):
        traj.sensitivity("R1")


def test_objectives_that_read_the_model_itself():
    m = silent(spatial_loop)
    both = ["spring.k", "crank.mass"]
    psi = mb.Final(lambda s: s.position("rocker")[0] + 1e-3 * s.value("spring.k") ** 2)
    grad = mb.gradient(m, psi, both, t=0.1, step=0.01).gradient
    plain = mb.gradient(m, mb.Final(lambda s: s.position("rocker")[0]), both, t=0.1, step=0.01).gradient
    assert np.allclose(grad - plain, [2e-3 * 60.0, 0.0], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_reactions_of_redundant_loops(scheme):
    """Hinges of a flat loop share forces by the smallest norm: the derivative is that of what mb.simulate reports."""
    m = silent(five_bar)
    names, parameters = (
        ["A.reaction", "H2.reaction", "B.reaction"],
        ["spring1.length", "left.mass", "A.at[0]", "H1.at[1]"],
    )
    options = {"t": 0.1, "step": 0.02, "method": scheme}
    traj = mb.simulate(m, parameters=parameters, **options)
    exact = {name: np.asarray(traj.sensitivity(name)) for name in names}
    for k, p in enumerate(parameters):
        now = m.value(p)
        e = 1e-3
        ends = []
        for side in (1, -1, 2, -2):
            m.set({p: now + side * e})
            ends.append(silent(lambda: mb.simulate(m, **options)))
        m.set({p: now})
        for name in names:
            a, b, c, d = (np.array(t.reaction(name.split(".")[0])) for t in ends)
            error = worst(exact[name][..., k], (8 * (a - b) - (c - d)) / (12 * e))
            print(f"{scheme}, {name} by {p}: {error:.1e}")
            assert error < 1e-7
    psi = mb.Integral(lambda s: np.sum(s.reaction("A") * [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) + s.acceleration("left")[0])
    direct, adjoint = (
        mb.gradient(m, psi, parameters, t=0.1, step=0.02, scheme=scheme, method=k) for k in ("direct", "adjoint")
    )
    assert worst(adjoint.gradient, direct.gradient) < 1e-9


def test_start_at_an_equilibrium_moves_along():
    m = mb.Model("hanging", gravity=(0, -9.81, 0))
    p = m.body("p", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1, 0, 0))
    m.revolute("A", m.ground, p, at=(0, 0, 0), axis="z", k=20.0, c=0.5)
    psi = mb.Final(lambda s: s.position("p")[1] + s.position("p")[0])

    def run(method):
        return mb.gradient(m, psi, ["p.mass", "A.k"], t=0.3, step=0.03, at=mb.equilibrium(m), method=method)

    found = run("direct")
    assert np.allclose(run("adjoint").gradient, found.gradient, rtol=1e-9, atol=1e-15)
    for i, name in enumerate(["p.mass", "A.k"]):
        now = m.value(name)
        ends = []
        for side in (1, -1):
            m.set({name: now * (1 + side * 1e-4)})
            ends.append(run("direct").value)
        m.set({name: now})
        assert found.gradient[i] == pytest.approx((ends[0] - ends[1]) / (2e-4 * now), rel=1e-6)


def test_methods_count_their_work():
    m = silent(five_bar)
    psi = mb.Integral(drift)
    run = {
        p: mb.gradient(m, psi, ["spring1.length"] * 1, t=0.1, step=0.01, method=p).stats.counts
        for p in ("direct", "adjoint")
    }
    assert run["direct"]["steps"] == run["adjoint"]["steps"] == 10
    assert run["direct"]["tangent linear steps"] == 10
    assert run["adjoint"]["adjoint steps"] == 10
    many = [f"{b.name}.{f}" for b in m.bodies for f in ("mass", "at[0]", "at[1]")]
    counts = mb.gradient(m, psi, many, t=0.1, step=0.01, method="direct").stats.counts
    assert counts["tangent linear steps"] == 10  # all parameters in one pass
    assert mb.gradient(m, psi, many, t=0.1, step=0.01).method == "adjoint"
    assert mb.gradient(m, psi, many[:2], t=0.1, step=0.01).method == "direct"


def test_numbers_that_move_no_body_cost_their_parts_alone():
    m = silent(five_bar)
    psi = mb.Integral(drift)

    def counts(name):
        return mb.gradient(m, psi, [name], t=0.1, step=0.01, method="direct").stats.counts

    spring, mass, hinge = counts("spring1.k"), counts("left.mass"), counts("A.at[0]")
    # one part, in the equations and in the metric of the projections
    assert spring["parts differentiated"] == mass["parts differentiated"] == 2 * 10
    assert "parts differentiated" not in hinge
    assert spring["force evaluations"] == mass["force evaluations"] == hinge["force evaluations"] - 2 * 10
    assert spring["tangents"] == hinge["tangents"]


@pytest.mark.parametrize("effect", ["preload-stiffness", "constraint-force-stiffness", "gyroscopic"])
@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_stiffness_that_a_linearisation_leaves_out_stays_in_the_derivative(effect, method):
    """Such effects are no forces: the motion is the same, and so is its derivative."""
    m = silent(spatial_loop)
    psi = mb.Final(lambda s: np.sum(s.position(m.bodies[-1].name) * [1.0, -2.0, 0.5]))

    def run(without):
        return mb.gradient(m, psi, SOME[spatial_loop], t=0.1, step=0.01, method=method, without=without).gradient

    assert np.allclose(run([effect]), run([]), rtol=1e-10, atol=1e-15)
