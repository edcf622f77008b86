"""Laws given as Python functions: traced into programs, in every analysis, against closed forms, known laws and SciPy."""

from __future__ import annotations

import copy
import math
import pickle
import runpy

import mbrs as mb
import numpy as np
import pytest
from folders import EXAMPLES
from mbrs.errors import ModelError, NotDifferentiableError
from mbrs.model.tracing import program_lines, read_program, trace
from scipy.integrate import solve_ivp


def evaluated(function, m, t, u, v):
    """The values of a traced function at numbers."""
    program, numbers = trace(function, m, max(m, 1), "here")
    inputs = [t, *np.ravel(u), *np.ravel(v), *(e.value for e in numbers)]
    w = program.core.values(inputs)
    return np.array([w[r] for r in program.roots])


def piecewise(t, u, v):
    r = np.hypot(u[0], u[1])
    inside = (r < 0.5) | ~(u[2] > -0.3) & (v[0] <= 0.1)
    push = np.where(inside, np.sin(3 * t) * u, np.maximum(u, 0.2) ** 1.5 - np.sign(v) * np.abs(u % 0.7))
    return (
        push
        + np.cross(u, v)
        + np.linalg.norm(v) * np.clip(u, -0.1, 0.4)
        + np.sum(u * u)
        + (u @ v) * np.arctan2(u, 1 + v * v)
    )


def plain_functions(t, u, v):
    return np.array(
        [np.tanh(u[1]) * np.exp(-t), np.minimum(u[0], v[2]) / (2 + np.cos(u[2])), np.float64(3.0) ** u[0] // 0.4]
    )


@pytest.mark.parametrize("function", [piecewise, plain_functions])
def test_a_traced_function_has_the_values_of_the_function(function):
    rng = np.random.default_rng(1)
    for _ in range(30):
        t, u, v = rng.uniform(0, 2), rng.uniform(-0.9, 0.9, 3), rng.uniform(-0.9, 0.9, 3)
        assert np.allclose(evaluated(function, 3, t, u, v), function(t, u, v), rtol=1e-13, atol=1e-14)
        program, _ = trace(function, 3, 3, "here")
        again = read_program(program_lines(program.nodes, program.roots), 3, 0, "here")
        values = [p.core.values([t, *u, *v]) for p in (program, again)]
        assert [values[0][r] for r in program.roots] == [values[1][r] for r in again.roots]


def test_text_stays_short_where_parts_are_shared():
    def deep(t, u, v):
        for _ in range(40):
            u = np.sin(u) * u + u
        return u

    program, _ = trace(deep, 0, 1, "here")
    assert sum(map(len, program_lines(program.nodes, program.roots))) < 3000


UNTRACEABLE = {
    "if": (lambda t, u, v: u if u > 0 else 0.0, "np.where"),
    "max": (lambda t, u, v: max(u, 0.0), "np.maximum"),
    "and": (lambda t, u, v: np.where(u > 0 and v > 0, u, v), "&"),
    "math": (lambda t, u, v: math.sin(u), r"np\.sin"),
    "int": (lambda t, u, v: int(u), r"np\.floor"),
    "round": (lambda t, u, v: round(u), r"np\.floor"),
    "index": (lambda t, u, v: [1.0, 2.0][u], r"np\.where"),
    "unknown function": (lambda t, u, v: np.sinc(u) + np.nextafter(u, v), "np"),
    "two arguments": (lambda u, v: u, r"\(t, u, v\)"),
    "no number": (lambda t, u, v: "text", "finite numbers"),
    "nan": (lambda t, u, v: u * np.nan, "finite"),
    "two results": (lambda t, u, v: [u, v], "1 numbers"),
}


@pytest.mark.parametrize("name", UNTRACEABLE)
def test_what_cannot_be_traced_is_named(name):
    function, remedy = UNTRACEABLE[name]
    m = mb.Model("m")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1))
    with pytest.raises(ModelError, match=r"rail\.law has the function .*test_function_laws.py, line") as caught:
        m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", law=function)
    assert caught.match(remedy)


# --- one coordinate: a traced function against the law of the core that it repeats ---

AXIS = (0.36, -0.48, 0.8)


def sliding(law, stiffness=None, c=0.31, mass=1.37, **parameters):
    m = mb.Model("slider")
    made = {name: m.parameter(name, value) for name, value in parameters.items()}
    b = m.body("b", mass=mass, inertia=(1.1, 0.9, 1.5), at=(0.3, -0.2, 0.7), velocity=tuple(0.9 * np.array(AXIS)))
    m.prismatic(
        "rail", m.ground, b, at=(0.3, -0.2, 0.7), axis=AXIS, k=stiffness, c=c, law=law(**made) if parameters else law
    )
    return m


def pairs():
    return {
        "cubic": (lambda k3: mb.Cubic(k3), lambda k3: lambda t, u, v: k3 * u**3, {"k3": 7.3}),
        "van der pol": (lambda mu: mb.VanDerPol(mu), lambda mu: lambda t, u, v: mu * u**2 * v, {"mu": 5.1}),
        "coulomb": (
            lambda f, w: mb.CoulombTanh(f, w),
            lambda f, w: lambda t, u, v: f * np.tanh(v / w),
            {"f": 0.43, "w": 0.19},
        ),
        "smooth gap": (
            lambda k, g: mb.Gap(k, g, 0.02),
            lambda k, g: lambda t, u, v: 0.5 * k * ((u - g) + np.sqrt((u - g) ** 2 + 0.02**2)),
            {"k": 31.0, "g": 0.11},
        ),
    }


@pytest.mark.some(2)
@pytest.mark.parametrize("name", pairs())
def test_a_function_repeats_the_law_of_the_core(name):
    known, function, numbers = pairs()[name]
    a, b = (sliding(law, 2.1, **numbers) for law in (known, function))
    for method in ("bdf", "generalized-alpha", "explicit", "ali3p", "bdf-bfgs"):
        # how these two choose steps depends on trial motions, and on what a law says of its contacts
        steps = {"step": 1e-3} if method in ("generalized-alpha", "ali3p") else {"rtol": 1e-6}
        ta, tb = (mb.simulate(m, t=1.1, method=method, **steps) for m in (a, b))
        assert np.allclose(ta.position("b")[-1], tb.position("b")[-1], rtol=0, atol=1e-9), method
    for m in (a, b):
        m.force("pull", "b", value=tuple(0.37 * np.array(AXIS)))
    ea, eb = (mb.equilibrium(m) for m in (a, b))
    la, lb = (mb.linearize(m, at=e) for m, e in ((a, ea), (b, eb)))
    assert np.allclose(la.K, lb.K, rtol=1e-12) and np.allclose(la.C, lb.C, rtol=1e-12)
    sa, sb = (mb.sensitivity(mb.modes(m, at=e), [*numbers, "b.mass"]) for m, e in ((a, ea), (b, eb)))
    assert np.allclose(sa.eigenvalue, sb.eigenvalue, rtol=1e-10)


@pytest.mark.some(2)
@pytest.mark.parametrize("name", pairs())
def test_gradients_by_parameters_inside_a_function(name):
    known, function, numbers = pairs()[name]
    psi = mb.Integral(lambda s: np.sum(s.position("b") ** 2))
    for method in ("direct", "adjoint"):
        for scheme in ("generalized-alpha", "ali3p"):
            found = [
                mb.gradient(
                    sliding(law, 2.1, **numbers), psi, list(numbers), t=0.6, step=5e-3, scheme=scheme, method=method
                )
                for law in (known, function)
            ]
            assert np.allclose(found[0].gradient, found[1].gradient, rtol=1e-9, atol=1e-13), (method, scheme)
            assert np.any(np.abs(found[1].gradient) > 1e-9)


def test_stored_energy_is_the_work_of_the_function():
    m = sliding(lambda t, u, v: 3.1 * np.sinh(u), c=None)
    traj = mb.simulate(m, t=3.0, rtol=1e-9)
    u = traj.joint("rail")
    assert np.allclose(traj.energy.stored["rail"], 3.1 * (np.cosh(u) - 1), rtol=1e-10, atol=1e-13)
    assert np.ptp(traj.energy.total) < 1e-7 * traj.energy.total[0]


def test_a_function_of_time_against_scipy():
    m = sliding(lambda t, u, v: (2.0 + np.sin(3.7 * t)) * u + 0.4 * np.abs(v) * v, c=None, mass=1.37)
    traj = mb.simulate(m, t=2.3, rtol=1e-9)

    def slope(t, y):
        return [y[1], -((2.0 + np.sin(3.7 * t)) * y[0] + 0.4 * abs(y[1]) * y[1]) / 1.37]

    exact = solve_ivp(slope, (0, 2.3), [0.0, 0.9], rtol=1e-12, atol=1e-13).y[0, -1]
    assert abs(traj.joint("rail")[-1] - exact) < 1e-7


def test_harmonic_balance_of_a_function():
    def system(law):
        return mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[law])

    a = mb.harmonic_balance(system(mb.Cubic(0.1, w=[1.0])), force=[0.18], omega=0.9)
    b = mb.harmonic_balance(system(mb.FunctionLaw(lambda t, u, v: 0.1 * u**3, w=[1.0])), force=[0.18], omega=0.9)
    assert np.max(np.abs(a.X - b.X)) < 1e-10
    with pytest.raises(ModelError, match="VaryingStiffness"):
        mb.harmonic_balance(system(mb.FunctionLaw(lambda t, u, v: t * u, w=[1.0])), force=[0.18], omega=0.9)
    known, function, numbers = pairs()["cubic"]
    curves = []
    for law in (known, function):
        m = sliding(law, 2.1, **numbers)
        m.force("pull", "b", value=tuple(0.37 * np.array(AXIS)))
        eq = mb.equilibrium(m)  # displaced: the function is counted from there
        made = mb.harmonic_balance(m, inputs=m["b"].force(AXIS), amplitude=0.3, omega=1.9, at=eq)
        curves.append(made.X[:, :9])
    assert np.max(np.abs(curves[0] - curves[1])) < 1e-9


def chain(law, n=12):
    """Bodies on leaning rails, one behind the other."""
    m = mb.Model("chain")
    k3 = m.parameter("k3", 7.3)
    last = m.ground
    for i in range(n):
        b = m.body(f"b{i}", mass=1.0 + 0.1 * i, inertia=(1, 1, 1), at=(0.3 * i, 0.1, 0.2))
        m.prismatic(f"r{i}", last, b, at=(0.3 * i, 0.1, 0.2), axis=AXIS, k=50.0 + i, c=0.3, preload=1.1, law=law(k3))
        last = b
    return m


@pytest.mark.parametrize("law", [lambda k3: mb.Cubic(k3), lambda k3: lambda t, u, v: k3 * u**3])
def test_large_models_and_transfer_functions(law):
    """The lowest modes of the sparse route are those of all; transfer functions and their derivatives follow the equilibrium."""
    m = chain(law)
    eq = mb.equilibrium(m)
    few, whole = mb.modes(m, at=eq, n=3), mb.modes(m, at=eq)
    assert np.allclose(few.frequency, whole.frequency[:3], rtol=1e-9)
    h = mb.frf(m, inputs="b3.force.x", outputs="b7.motion.y", omega=[1.0, 3.0], at=eq)
    slope = mb.sensitivity(h, ["k3"]).value.ravel()
    reference = chain(lambda k3: mb.Cubic(k3))
    same = mb.frf(reference, inputs="b3.force.x", outputs="b7.motion.y", omega=[1.0, 3.0], at=mb.equilibrium(reference))
    assert np.allclose(h.value, same.value, rtol=1e-9)
    assert np.allclose(slope, mb.sensitivity(same, ["k3"]).value.ravel(), rtol=1e-8)


def test_frequency_responses_and_their_stability():
    known, function, numbers = pairs()["cubic"]
    curves = []
    for law in (known, function):
        m = sliding(law, 2.1, **numbers)
        made = mb.frequency_response(
            m, inputs="b.force.z", amplitude=0.4, omega=(0.8, 3.0), harmonics=5, at=mb.equilibrium(m)
        )
        curves.append(made)
    folds = [[e.omega for e in curve.events if e.kind == "fold"] for curve in curves]
    assert len(folds[0]) == 2 and np.allclose(*folds, rtol=1e-6)


def test_rates_in_a_function_are_damping():
    on = {name: mb.effects(sliding(law, 2.1, c=None))["damping"].on for name, law in RATES.items()}
    assert on == {"rate": True, "none": False}


RATES = {"rate": lambda t, u, v: u**3 + 0.3 * v, "none": lambda t, u, v: u**3}


# --- several coordinates ---


def rotor(law, **given):
    """A body on a bushing in a leaning frame, with a law of its y and z."""
    m = mb.Model("rotor")
    b = m.body("b", mass=2.3, inertia=(0.11, 0.23, 0.17), at=(0.1, 0.2, -0.3))
    turn = mb.rotation((0.3, -0.5, 0.7), 0.83)
    m.bushing("film", m.ground, b, at=(0.1, 0.2, -0.3), orientation=turn, law=law, **given)
    return m


def film(t, u, v):
    r2 = u @ u
    return np.array(
        [40 * u[0] * (1 + 5 * r2) + 17 * u[1] + 3 * v[0], 60 * u[1] * (1 + 5 * r2) - 17 * u[0] + 5 * v[1] + v[0]]
    )


def film_slopes(t, u, v):
    (a, b), r2 = u, u @ u
    K = np.array(
        [[40 * (1 + 5 * r2) + 400 * a * a, 400 * a * b + 17], [600 * a * b - 17, 60 * (1 + 5 * r2) + 600 * b * b]]
    )
    return K, np.array([[3.0, 0.0], [1.0, 5.0]])


SUPPORT = {"k": (55.0, 20.0, 30.0, 3.0, 4.0, 5.0), "c": (0.7, 0.6, 0.5, 0.1, 0.2, 0.1)}


def test_tangents_of_a_law_of_two_coordinates():
    """Linearised, a nonsymmetric law is the bushing with its matrices."""
    K, C = np.diag(SUPPORT["k"]), np.diag(SUPPORT["c"])
    K[1:3, 1:3] += film_slopes(0, np.zeros(2), np.zeros(2))[0]
    C[1:3, 1:3] += film_slopes(0, np.zeros(2), np.zeros(2))[1]
    for law in (mb.FunctionLaw(film), mb.FunctionLaw(film, derivatives=film_slopes)):
        a, b = mb.linearize(rotor({("y", "z"): law}, **SUPPORT)), mb.linearize(rotor(None, k=K, c=C))
        for name in "MCGKN":
            x, y = getattr(a, name), getattr(b, name)
            x, y = (np.zeros((6, 6)) if z is None else z for z in (x, y))
            assert np.allclose(x, y, rtol=1e-12, atol=1e-11), name


def test_traced_and_called_functions_move_alike():
    made = []
    for law in (mb.FunctionLaw(film), mb.FunctionLaw(film, derivatives=film_slopes)):
        m = rotor({("y", "z"): law}, **SUPPORT)
        m.force("pull", "b", value=(1.3, -2.1, 0.7))
        eq = mb.equilibrium(m)
        made.append(
            (
                mb.simulate(m, t=0.7, method="bdf", rtol=1e-6).position("b")[-1],
                eq.position("b") if hasattr(eq, "position") else 0,
            )
        )
    assert np.allclose(made[0][0], made[1][0], rtol=0, atol=1e-9)
    assert np.allclose(made[0][1], made[1][1], rtol=0, atol=1e-11)


def test_derivatives_by_parameters_refuse_called_functions():
    m = rotor({("y", "z"): mb.FunctionLaw(film, derivatives=film_slopes)}, **SUPPORT)
    with pytest.raises(NotDifferentiableError, match=r"'film'.*traced"):
        mb.sensitivity(mb.modes(m), ["b.mass"])


def test_the_order_of_coordinates_is_that_of_their_names():
    swapped = {("z", "y"): mb.FunctionLaw(lambda t, u, v: film(t, u[::-1], v[::-1])[::-1])}
    a, b = (mb.linearize(rotor(law, **SUPPORT)) for law in ({("y", "z"): mb.FunctionLaw(film)}, swapped))
    assert np.allclose(a.K, b.K, rtol=1e-13) and np.allclose(a.N, b.N, rtol=1e-13)


def test_motion_with_two_coordinates_against_scipy():
    m = mb.Model("orbit")
    b = m.body("b", mass=2.3, inertia=(1, 1, 1), at=(0.1, 0.2, 0.3), velocity=(0.4, -0.2, 0.0))
    m.planar("table", m.ground, b, at=(0.1, 0.2, 0.3), axis="z", law={("x", "y"): film})
    traj = mb.simulate(m, t=1.7, rtol=1e-9)

    def slope(t, y):
        return [*y[2:], *(-film(t, y[:2], y[2:]) / 2.3)]

    exact = solve_ivp(slope, (0, 1.7), [0, 0, 0.4, -0.2], rtol=1e-12, atol=1e-13).y[:2, -1]
    frame = traj.position("b")[-1][:2] - (0.1, 0.2)
    assert np.linalg.norm(np.linalg.norm(frame) - np.linalg.norm(exact)) < 1e-7


def test_gradients_with_two_coordinates_against_differences():
    def make(k, s):
        m = mb.Model("orbit")
        k, s = m.parameter("k", k), m.parameter("s", s)

        def law(t, u, v):
            return k * u * (1 + 5 * (u @ u)) + s * np.array([u[1], -u[0]]) + 0.3 * s * v

        b = m.body("b", mass=2.3, inertia=(1, 1, 1), at=(0.1, 0.2, 0.3), velocity=(0.4, 0.3, 0.0))
        m.planar("table", m.ground, b, at=(0.1, 0.2, 0.3), axis=(0.36, -0.48, 0.8), law={("x", "y"): law})
        return m

    psi = mb.Integral(lambda s: np.sum(s.position("b") ** 2))
    value = lambda k, s: mb.gradient(make(k, s), psi, ["k"], t=0.5, step=5e-3).value  # noqa: E731
    h = 1e-3
    differences = [
        (value(40 + h, 3) - value(40 - h, 3)) / (2 * h),
        (value(40, 3 + h) - value(40, 3 - h)) / (2 * h),
    ]
    for method in ("direct", "adjoint"):
        got = mb.gradient(make(40.0, 3.0), psi, ["k", "s"], t=0.5, step=5e-3, method=method).gradient
        assert np.allclose(got, differences, rtol=1e-5), method


@pytest.mark.parametrize(("script", "tolerance"), [("journal_bearing.py", 1e-8), ("shaft_in_hole.py", 1e-5)])
def test_examples_meet_what_they_are_checked_against(script, tolerance, capsys):
    """Closed forms of a short bearing; the orbit of a shaft that rubs by SciPy."""
    rows = runpy.run_path(str(EXAMPLES / "rotors" / script))["rows"]
    for name, ours, known, _ in rows:
        assert abs(ours - known) < tolerance * abs(known), name


# --- files ---


@pytest.mark.parametrize(
    "law",
    [lambda k: {("y", "z"): lambda t, u, v: k * u * (1 + u @ u) + v}, lambda k: {"x": lambda t, u, v: k * np.sin(u)}],
)
def test_traced_laws_are_saved_as_text(tmp_path, law):
    m = mb.Model("rotor")
    k = m.parameter("k", 40.0)
    b = m.body("b", mass=2.3, inertia=(0.11, 0.23, 0.17), at=(0.1, 0.2, -0.3))
    m.bushing("film", m.ground, b, at=(0.1, 0.2, -0.3), law=law(2 * k), **SUPPORT)
    text = m.save(tmp_path / "m.toml").read_text()
    assert "program" in text and "2*k" in text
    for again in (mb.Model.load(tmp_path / "m.toml"), pickle.loads(pickle.dumps(m)), copy.deepcopy(m)):
        assert np.array_equal(mb.linearize(again).K, mb.linearize(m).K)
        again.set({"k": 55.0})
        assert not np.allclose(mb.linearize(again).K, mb.linearize(m).K)


def test_called_laws_are_saved_by_name(tmp_path):
    m = rotor({("y", "z"): mb.FunctionLaw(film, derivatives=film_slopes)}, **SUPPORT)
    with pytest.raises(ModelError, match="Python function"):
        m.save(tmp_path / "m.toml")
        mb.linearize(mb.Model.load(tmp_path / "m.toml"))
    again = mb.Model.load(tmp_path / "m.toml", functions=True)
    assert np.array_equal(mb.linearize(again).K, mb.linearize(m).K)


def test_force_laws_push_as_their_function_says():
    """A force on a point of a body against the bushing that resists with it."""
    push = lambda t, u, v: -(1.3 + 40 * (u @ u)) * u - 0.2 * v + np.array([0.0, 0.1]) * np.sin(t)  # noqa: E731
    ends = []
    for make in ("force law", "bushing"):
        m = mb.Model("shaft in a film")
        b = m.body("shaft", mass=1.7, inertia=(0.3, 0.2, 0.4), at=(0.3, -0.1, 0.2), velocity=(0.1, 0.3, -0.2))
        m.marker("nose", b, at=(0.4, 0.2, 0.1))
        if make == "force law":
            m.force_law("film", push, ["nose.motion.y", "nose.motion.z"])
        else:
            law = {("y", "z"): lambda t, u, v: -push(t, u, v)}
            m.bushing("film", m.ground, b, at=(0.4, 0.2, 0.1), law=law)
        ends.append(mb.simulate(m, t=1.0, rtol=1e-7).position("shaft")[-1])
    assert np.array_equal(*ends)
    with pytest.raises(ModelError, match="several points"):
        m.force_law("other", push, ["nose.motion.y", "shaft.motion.z"])
    with pytest.raises(ModelError, match="along x, y, z"):
        m.force_law("other", push, [b.motion((0.6, 0.8, 0)), "shaft.motion.z"])


def test_the_force_law_of_the_contract():
    m = mb.Model("m")
    s = m.body("shaft", mass=1.0, inertia=(1, 1, 1), velocity=(0, 0.2, 0))
    m.force_law("film", mb.FunctionLaw(lambda t, u, v: -(u @ u) * u), ["shaft.motion.y", "shaft.motion.z"])
    traj = mb.simulate(m, t=2.0, rtol=1e-9)
    exact = solve_ivp(lambda t, y: [y[1], -(y[0] ** 3)], (0, 2), [0, 0.2], rtol=1e-12, atol=1e-14).y[0, -1]
    assert abs(traj.position(s)[-1, 1] - exact) < 1e-8


@pytest.mark.parametrize("seed", range(3))
def test_friction_follows_the_normal_force_of_its_contact(seed):
    """A block that slides on an elastic plane of any direction, over a bump of its own bounce: Coulomb's friction mu N against the
    equations in the plane's own axes, and the distance v^2/(2 mu g) where the block does not bounce."""
    rng = np.random.default_rng(seed)
    mass, g, mu, k, c, slow = np.exp(rng.uniform(0, 1)), rng.uniform(3, 12), rng.uniform(0.2, 0.5), 3.1e3, 57.0, 1e-3
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    n, speed = R[:, 2], rng.uniform(0.7, 1.4)

    def contact(t, u, v):
        normal = np.maximum(-k * (u @ n) - c * (v @ n), 0.0)
        along = v - (v @ n) * n
        return normal * (n - mu * along / np.sqrt(along @ along + slow**2))

    for drop in (0.0, 0.03):
        rest = -mass * g / k
        m = mb.Model("block", gravity=-g * n)
        m.body("block", mass=mass, inertia=(0.3, 0.2, 0.4), velocity=speed * R[:, 0])
        start = drop or rest
        law = lambda t, u, v, start=start: contact(t, u + start * n, v)  # noqa: E731
        m.force_law("floor", law, [f"block.motion.{axis}" for axis in "xyz"])
        t = 0.5 * speed / (mu * g)
        went = mb.simulate(m, t=[0.0, t], rtol=1e-9).position("block")[-1] @ R

        def slope(_, y, law=law):
            # along the plane and across it; the block's own equations
            push = law(0.0, R[:, 0] * y[0] + n * y[1], R[:, 0] * y[2] + n * y[3])
            return [y[2], y[3], push @ R[:, 0] / mass, push @ n / mass - g]

        exact = solve_ivp(slope, (0, t), [0, 0, speed, 0], rtol=1e-11, atol=1e-12, max_step=1e-3).y[:2, -1]
        assert np.max(np.abs(went - [exact[0], 0, exact[1]])) < 1e-6
        if not drop:
            assert went[0] == pytest.approx(speed * t - 0.5 * mu * g * t**2, abs=1e-5)


def test_a_contact_with_restitution():
    """A ball that meets a stop with damping that grows with the depth (Hunt and Crossley), against the equation by hand."""
    k, c, gap, mass, v = 2.3e4, 0.4, 0.07, 1.7, 1.3

    def law(t, u, du):
        return k * np.maximum(u - gap, 0.0) ** 1.5 * np.maximum(1.0 + c * du, 0.0)

    m = mb.Model("ball")
    rng = np.random.default_rng(12)
    axis, at = rng.normal(size=3), rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    b = m.body("ball", mass=mass, inertia=(0.1, 0.1, 0.1), at=at, velocity=v * axis)
    m.prismatic("way", m.ground, b, at=at, axis=axis, law=mb.FunctionLaw(law))
    given = dict(method="DOP853", rtol=1e-12, atol=1e-14, max_step=1e-4)
    exact = solve_ivp(lambda t, y: [y[1], -law(t, y[0], y[1]) / mass], (0, 0.15), [0.0, v], **given).y[:, -1]
    assert -v < exact[1] < -0.5 * v  # it has left the stop, slower
    for method in ("explicit", "generalized-alpha", "radau"):
        traj = mb.simulate(m, t=[0.15], method=method, rtol=1e-8)
        assert traj.velocity("ball")[-1] @ axis == pytest.approx(exact[1], abs=1e-6), method
