"""What is wrong in the input of a nonlinear analysis is an error that names it and says what to do; nothing panics,
hangs, or comes back as if it were right."""

from __future__ import annotations

import inspect
import signal
import warnings

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import MbrsError, ModelError

DIRECTION = [1.0]
PAIR = [dict(force=[0.1], omega=2.0), dict(force=[0.1], omega=2 * 2**0.5)]


def duffing(k3=0.1, **changes):
    given = dict(M=[[1.0]], C=[[0.05]], K=[[1.0]], elements=[mb.Cubic(k3, w=DIRECTION)]) | changes
    return mb.MechanicalSystem(**given)


def van_der_pol():
    return mb.MechanicalSystem([[1.0]], [[-1.0]], [[1.0]], elements=[mb.VanDerPol(1.0, w=DIRECTION)])


def one(**changes):
    given = dict(force=[0.18], omega=0.9, harmonics=3) | changes
    system = given.pop("system", None) or duffing()
    return mb.harmonic_balance(system, **given)


def curve(**changes):
    return mb.frequency_response(**(dict(system=duffing(), force=[0.18], omega=(0.5, 0.7)) | changes))


def rail():
    m = mb.Model("rail")
    b = m.body("mass", mass=2.0, inertia=(1e-2, 1e-2, 1e-2))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=8e3, c=8.0, law=mb.Cubic(4e7))
    return m


def nan_law(t, u, v):
    return np.where(np.abs(u) > 0.1, np.nan, u**3)


# Each error names the object (first word) and the remedy (second).
LISTED = {
    "force of a wrong shape": (lambda: one(force=[0.1, 0.2]), "force of harmonic 1", r"shape \(1,\)"),
    "damping of a wrong shape": (lambda: duffing(C=np.eye(2)), "C is 2 x 2", "M is 1 x 1"),
    "mass that is not square": (lambda: duffing(M=[[1.0, 0.0]]), "M must be", "square"),
    "direction of a wrong length": (
        lambda: one(system=duffing(elements=[mb.Cubic(1.0, w=[1.0, 0.0])])), r"elements\[0\], Cubic", "1 coordinates"),
    "guess of a wrong shape": (lambda: one(x0=[[1.0, 2.0]]), "x0", r"\(dof, 2h\+1\)"),
    "force that is not finite": (lambda: one(force=[np.inf]), "force of harmonic 1", "infinite"),
    "stiffness that is not finite": (lambda: duffing(K=[[np.nan]]), "K contains", "NaN"),
    "law that is not finite": (lambda: mb.Cubic(np.nan, w=DIRECTION), "Cubic: k3", "finite"),
    "guess that is not finite": (lambda: one(x0=[[np.nan, 0, 0]]), "x0 contains", "NaN"),
    "frequency that is not finite": (lambda: one(omega=np.inf), "omega", "finite"),
    "direction of zeros": (lambda: mb.Cubic(1.0, w=[0.0, 0.0]), "Cubic: w is zero", "name the coordinate"),
    "harmonics below those of the forcing": (
        lambda: one(force={5: [1.0]}, harmonics=3), "force acts in harmonic 5", "add it to harmonics"),
    "samples too few": (lambda: one(n_samples=5), "n_samples = 5 aliases", "at least 13"),
    "samples that alias on a torus": (
        lambda: mb.quasi_periodic(duffing(), PAIR, harmonics=3, n_samples=8), r"n_samples\[0\] = 8 aliases", "at least"),
    "set that lacks a force": (
        lambda: mb.quasi_periodic(duffing(), PAIR, indices=[[1, 0]]), r"lack the term of forces\[1\]", r"\[0, 1\]"),
    "set that holds a term twice": (
        lambda: mb.quasi_periodic(duffing(), PAIR, indices=[[1, 0], [0, 1], [0, -1]]), "twice", "same term"),
    "two frequencies that are one": (
        lambda: mb.quasi_periodic(duffing(), [dict(force=[1.0], omega=w) for w in (1.0, 1.5)]),
        "commensurable", "harmonic_balance"),
}  # fmt: skip

# What users get wrong besides.
MORE = {
    "ports for matrices": (lambda: one(force=None, inputs="mass.force.x"), "inputs=", "takes force"),
    "no force": (lambda: one(force=None), "force=", "exactly one"),
    "force and ports": (lambda: one(inputs="mass.force.x"), "force=", "exactly one"),
    "port that is not there": (
        lambda: mb.frequency_response(rail(), inputs="mas.force.x", frequency=(1, 2)), "mas", "mass"),
    "motion as a force": (
        lambda: mb.frequency_response(rail(), inputs="mass.motion.x", frequency=(1, 2)), "mass.motion.x", "inputs are"),
    "base motion": (
        lambda: mb.frequency_response(rail(), inputs="base.x", frequency=(1, 2)), "base.x", "forces and torques"),
    "amplitudes of another number of ports": (
        lambda: mb.harmonic_balance(rail(), inputs="mass.force.x", amplitude=[1.0, 2.0], frequency=2.0), "amplitude",
        "one for each"),
    "amplitude that is text": (
        lambda: mb.harmonic_balance(rail(), inputs="mass.force.x", amplitude="2", frequency=2.0), "amplitude", "number"),
    "range for one solution": (lambda: one(omega=(0.5, 1.0)), "one frequency", "frequency_response"),
    "no range for a curve": (lambda: curve(omega=0.5), "range", "level="),
    "empty range": (lambda: curve(omega=(0.5, 0.5)), "range of frequencies is empty", "0.5"),
    "omega and frequency": (lambda: one(frequency=1.0), "omega", "exactly one"),
    "a million harmonics": (lambda: one(harmonics=10**6), "harmonics up to 1000000", "take at most"),
    "a far harmonic": (lambda: one(harmonics=[1, 10**12]), "harmonics up to 1000000000000", "sequence"),
    "a million samples": (lambda: one(n_samples=10**7), "n_samples", "262144"),
    "a million samples in two dimensions": (
        lambda: mb.quasi_periodic(duffing(), PAIR, harmonics=3, n_samples=10**5), "samples are too many", "fewer"),
    "a torus of a million orders": (lambda: mb.quasi_periodic(duffing(), PAIR, harmonics=10**6), "harmonics", "fewer"),
    "twenty frequencies": (
        lambda: mb.quasi_periodic(duffing(), [dict(force=[0.1], omega=p**0.5) for p in (2, 3, 5, 7, 11, 13, 17, 19)] * 2),
        "16 frequencies", "fewer"),
    "direction misspelt": (lambda: curve(predictor="tangents"), "predictor", '"tangent"'),
    "corrector misspelt": (lambda: curve(corrector="newton"), "corrector", '"arclength"'),
    "step above its limit": (lambda: curve(step=0.5), "min_step <= step", "0.1"),
    "steps as long as the curve": (lambda: curve(max_step=1e3), "max_step", "take 0.1"),
    "stability as text": (lambda: curve(stability="yes"), "stability", "True or False"),
    "no points": (lambda: curve(max_points=0), "max_points", "from 1"),
    "no iterations": (lambda: one(max_iterations=-1), "max_iterations", "from 1"),
    "effects as a number": (
        lambda: mb.harmonic_balance(rail(), inputs="mass.force.x", frequency=2.0, without=3), "without", "list of names"),
    "effect that is not there": (
        lambda: mb.harmonic_balance(rail(), inputs="mass.force.x", frequency=2.0, without=["frictoin"]), "frictoin",
        "friction"),
    "frequency beyond squares": (lambda: one(omega=1e200), "omega", "other units"),
    "periodic force on a limit cycle": (
        lambda: mb.limit_cycle(van_der_pol(), force={1: [1.0]}), "static forces", "harmonic_balance"),
    "guess without its frequency": (
        lambda: mb.limit_cycle(van_der_pol(), x0=[[0.0, 2.0, 0.0]]), "omega", "needed beside x0"),
    "one frequency on a torus": (lambda: mb.quasi_periodic(duffing(), PAIR[:1]), "at least two", "harmonic_balance"),
    "memory on a torus": (
        lambda: mb.quasi_periodic(duffing(elements=[mb.Jenkins(1.0, 1.0, w=DIRECTION)]), PAIR), r"elements\[0\], Jenkins",
        "without"),
    "parameter that is not there": (
        lambda: mb.parameter_response(rail(), "stiffness", value=(1, 2), inputs="mass.force.x", frequency=2.0),
        "stiffness", ""),
    "law without direction": (lambda: one(system=duffing(elements=[mb.Cubic(1.0)])), r"elements\[0\]", "give w"),
    "element that is no law": (lambda: one(system=duffing(elements=[3.0])), r"elements\[0\]", "mb.Cubic"),
    "no system": (lambda: one(system="duffing"), "MechanicalSystem", "str"),
    "negative gap on both sides": (lambda: mb.Gap(1.0, -1.0, bilateral=True), "Gap", "one-sided"),
    "table out of order": (lambda: mb.TableLaw([0, 2, 1], [0, 1, 2]), "TableLaw: u must ascend", "sort"),
    "slip force of zero": (lambda: mb.Jenkins(1.0, 0.0), "Jenkins: f_slip", "positive"),
    "law that is not callable": (lambda: mb.FunctionLaw(3.0), "FunctionLaw", "callable"),
}  # fmt: skip


@pytest.mark.parametrize("name", [*LISTED, *MORE])
def test_error_names_object_and_remedy(name):
    run, what, remedy = (LISTED | MORE)[name]
    with pytest.raises(ModelError, match=what) as caught:
        run()
    assert caught.match(remedy)


def test_law_that_returns_nan_is_named():
    system = duffing(elements=[mb.FunctionLaw(nan_law, lambda t, u, v: (3 * u**2, 0 * u), w=DIRECTION)])
    with pytest.raises(mb.errors.ConvergenceError, match=r"elements\[0\], FunctionLaw\(nan_law") as caught:
        mb.harmonic_balance(system, force=[0.18], omega=0.9)
    assert caught.match("not finite") and caught.value.result is not None


class Unprintable:
    def __repr__(self):
        raise RuntimeError("no text")


JUNK = ["x", np.nan, -np.inf, -1, 1.5, 10**30, 1e308, 1e-308, True, [], {}, [[]], [None], [np.nan], np.zeros((3, 3)),
        np.zeros(0), np.array(2.0), 1j, {1: None}, {-1: [1.0]}, (1, 2, 3), (1.0, np.nan), [1, 10**12], {1, 2},
        np.ma.masked, Unprintable()]  # fmt: skip
CALLS = {
    "harmonic_balance": dict(system=duffing(), force=[0.18], omega=0.9, harmonics=3),
    "frequency_response": dict(
        system=duffing(), force=[0.18], omega=(0.5, 0.55), harmonics=3, step=0.05, max_points=5, stability=False
    ),
    "limit_cycle": dict(system=van_der_pol(), harmonics=3, method="harmonic-balance", omega=1.0, x0=[[0.0, 2.0, 0.0]]),
    "quasi_periodic": dict(system=duffing(), forces=PAIR, harmonics=2),
    "quasi_periodic_response": dict(system=duffing(), forces=PAIR, harmonics=2, scale=(1.0, 0.95)),
    "parameter_response": dict(
        system=duffing, value=(0.1, 0.12), force=[0.18], omega=0.9, harmonics=3, step=0.05, max_points=5
    ),
}
ALTERNATIVES = {"frequency": "omega", "inputs": "force"}


def _too_slow(*_):
    raise TimeoutError


@pytest.mark.some(38)
@pytest.mark.parametrize(
    ("analysis", "argument"),
    [(name, argument) for name in CALLS for argument in inspect.signature(getattr(mb, name)).parameters],
)
def test_junk_in_any_argument_is_refused_or_harmless(analysis, argument):
    signal.signal(signal.SIGALRM, _too_slow)
    for junk in JUNK:
        given = {key: value for key, value in CALLS[analysis].items() if key != ALTERNATIVES.get(argument)}
        given[argument] = junk
        signal.alarm(20)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = getattr(mb, analysis)(**given)
        except MbrsError as problem:
            assert len(str(problem)) > 20, f"{argument}: says too little: {problem}"
            continue
        except TypeError as problem:
            # a user's own function that cannot be called as a family of systems is the user's error as it stands
            assert analysis == "parameter_response" and argument == "system", problem
            continue
        finally:
            signal.alarm(0)
        assert np.all(np.isfinite(found.X)), f"{argument} = {type(junk)}: not finite, but no error"
        assert not np.any(np.isnan(np.asarray(found.error, float)))


@pytest.mark.some(8)
@pytest.mark.parametrize("seed", [*range(4, 30), *range(4)])
def test_random_systems_end_in_a_solution_or_an_error(seed):
    rng = np.random.default_rng(seed)
    system, force, omega = random_system(rng)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = mb.frequency_response(
                system, force=force, omega=(omega, 1.5 * omega), harmonics=int(rng.integers(1, 8)), max_points=25
            )
        except MbrsError as problem:
            assert len(str(problem)) > 20
            return
    assert np.all(np.isfinite(found.X)) and not np.any(np.isnan(found.error)) and np.all(found.error >= 0)
    i = int(np.argmin(found.error))
    point = found.point(i)
    if found.error[i] < 1e-6 and not any(law.has_memory for law in system.elements):
        # what calls itself accurate must satisfy the equations in the reference as well
        from mbrs.reference import hbm_balance

        h = range(1, (point.X.shape[1] - 1) // 2 + 1)
        R = hbm_balance.residual(system, point.X.T.ravel(), point.force, point.omega, h, max(point.n_samples, 64))[0]
        assert np.max(np.abs(R)) <= 1e-6 * _forces(system, point), np.max(np.abs(R)) / _forces(system, point)


def random_system(rng):
    """Matrices of any scale, definite or not, with up to three laws of any kind."""
    n = int(rng.integers(1, 5))
    scale = 10.0 ** rng.uniform(-9, 9)
    A, B = rng.normal(size=(2, n, n))
    K = scale * (A @ A.T + (rng.random() < 0.8) * np.eye(n))
    M = 10.0 ** rng.uniform(-6, 6) * (B @ B.T + 0.1 * np.eye(n))
    C = rng.choice([0.0, 1e-6, 0.05]) * np.sqrt(np.trace(K) / np.trace(M)) * M
    x = 10.0 ** rng.uniform(-6, 6)

    def law():
        w, k = rng.normal(size=n), scale * 10.0 ** rng.uniform(-2, 2)
        match rng.integers(7):
            case 0:
                return mb.Cubic(k / x**2, w=w)
            case 1:
                return mb.Gap(k, 0.5 * x, bilateral=bool(rng.integers(2)), w=w)
            case 2:
                return mb.CoulombTanh(k * x, np.sqrt(scale) * x, w=w)
            case 3:
                return mb.Hertz(k / np.sqrt(x), gap=0.5 * x, w=w)
            case 4:
                return mb.Jenkins(k, 0.3 * k * x, w=w)
            case 5:
                return mb.Polynomial1D([0.0, 0.0, k / x, k / x**2], w=w)
            case _:
                return mb.TableLaw([-2 * x, -x, x, 2 * x], [-3 * k * x, -k * x, k * x, 3 * k * x], w=w)

    laws = [law() for _ in range(rng.integers(1, 4))]
    force = scale * x * rng.normal(size=n) * 10.0 ** rng.uniform(-3, 1)
    return (
        mb.MechanicalSystem(M, C, K, elements=laws),
        force,
        float(np.sqrt(np.trace(K) / np.trace(M))) * rng.uniform(0.3, 1.5),
    )


def _forces(system, point):
    """Size of the forces that are in balance."""
    x, v = (np.max(np.abs(s(np.linspace(0, point.period, 64)))) for s in (point.displacement, point.velocity))
    size = max(np.max(np.abs(system.K)) * x, np.max(np.abs(system.M)) * v * point.omega, np.max(np.abs(point.force)))
    return max(
        [
            size,
            *(
                np.max(np.abs(law.force(law.w @ point.displacement(np.linspace(0, point.period, 64)))))
                for law in system.elements
            ),
        ]
    )


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1e6, 1e12])
def test_units_do_not_matter(scale):
    """The same oscillator in other units of length, force and time has the same curve."""
    plain = mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6))
    length, time = scale, scale**0.5
    m, c, k, k3 = 1.0, 0.05 / time, 1.0 / time**2, 0.1 / (time * length) ** 2
    system = mb.MechanicalSystem([[m]], [[c]], [[k]], elements=[mb.Cubic(k3, w=DIRECTION)])
    found = mb.frequency_response(system, force=[0.18 * length / time**2], omega=(0.5 / time, 1.6 / time))
    assert found.status == plain.status == "converged"
    gaps = [abs(a.omega * time / b.omega - 1) for a, b in zip(found.events, plain.events, strict=True)]
    print(f"scale {scale:g}: folds differ by {max(gaps):.1e}")
    assert max(gaps) < 1e-9 and found.peak().amplitude() / length == pytest.approx(plain.peak().amplitude(), rel=1e-9)
