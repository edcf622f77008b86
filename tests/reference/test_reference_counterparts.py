"""Every public analysis is computed once more by plain NumPy, and the numbers agree: this fails for one that is added without.

Each case runs an analysis of the core on a small model and gives pairs of values, the core's and the counterpart's.
"""

from __future__ import annotations

import functools
import importlib
import inspect

import mbrs as mb
import numpy as np
import pytest
from cranks import DUFFING, OSCILLATOR, TONES, bent_shaft, crank
from mbrs import reference as ref
from mbrs._lib.names import PUBLIC
from mbrs.model.directions import directions
from mbrs.model.tables import tables
from mbrs.reference import hbm_shooting
from mbrs.results import Result

# Analyses that only run others, or arrange what these computed: what they run has a counterpart.
COMPOSED = {
    "accuracy_study": "runs an analysis with several settings",
    "effect_study": "runs an analysis with each effect left out",
    "check_gradients": "runs an analysis at changed values",
    "compare": "runs an analysis in the core and in the reference, and subtracts",
    "sweep": "runs analyses at many designs",
    "pair": "matches names and places; what is paired is compared in tests/linear/test_pairing.py",
    "correlate": "compares numbers that frf and modes computed; closed forms in tests/linear/test_pairing.py",
    "update": "frf and modes at several designs; tests/design/test_update.py compares with a model by hand and SciPy",
    "from_sep005": "reads what was measured",
    "campbell": "steady_motion and modes at several speeds",
    "effects": "lists what the model contains",
    "load": "reads what an analysis computed",
    "rotor_modes": "sorts modes by their patterns over the blades, see test_multiblade",
}
# Of the largest number of a pair. Both sides end at rounding or at a residual of 1e-9; a gradient is extrapolated from two steps.
TOLERANCE = {"gradient": 1e-7}
USUAL = 1e-8


@functools.cache
def linear():
    """The crank at its equilibrium, by both sides in the same coordinates."""
    m = crank()
    lin = mb.linearize(m, at=mb.equilibrium(m))
    sys = ref.System(tables(m))
    keep = [sys.coordinates.index(name) for name in lin.coordinates]
    return m, lin, ref.linearize(sys, ref.equilibrium(sys)[0], keep)


def compared(result):
    """Where `mb.compare` knows the kind of result, it is the counterpart."""
    table = mb.compare(result)
    assert bool(table), str(table)
    return [(table.core, table.reference)]


def steady_motion():
    m = bent_shaft()
    pairs = []
    for speed in (0.0, 40.0, 300.0):
        found = mb.steady_motion(m, {"shaft": speed})
        lin, torque = ref.steady_motion(ref.System(tables(m)), {"shaft": speed})
        ours = found.linearization
        G = np.zeros_like(lin.G) if ours.G is None else ours.G
        pairs += [(ours.M, lin.M), (G, lin.G, lin.D), (ours.K, lin.K), (found.torque["shaft"], torque[0], lin.S)]
    return pairs


def response():
    t = np.linspace(0.0, 2.3, 47)
    load = np.sin(3.1 * t) + 0.3 * t
    outputs = ["coupler.motion.x", "coupler.motion.y"]
    return compared(mb.response(linear()[1], t, {"coupler.force.x": load}, outputs))


def state_space():
    m, lin, other = linear()
    found = mb.state_space(lin, inputs="coupler.force.x", outputs="coupler.motion.y")
    rows = ref.motion_rows(ref.System(tables(m)), other, "coupler")
    omega = np.array([0.7, 3.3, 11.0])
    own = [(found.C @ np.linalg.solve(1j * w * np.eye(len(found.A)) - found.A, found.B) + found.D)[0, 0] for w in omega]
    H = ref.frf(other.M, other.D, other.S, rows[0][:, None], rows[1][None], omega)[0, 0]
    return [(np.array(own), H)]


@functools.cache
def eigenvalue_slopes():
    """d(eigenvalue)/dp of the crank by the core and by a complex step, the equilibrium followed."""
    m, lin, _ = linear()
    names = ["s.k", "A.c", "coupler.mass"]
    modes = mb.modes(lin)
    t, x = tables(m), directions(m, names).dense
    keep = [ref.System(t).coordinates.index(name) for name in lin.coordinates]
    columns = []
    for i in range(len(names)):
        base, d = ref.derivative(t, x[:, i], lambda s: ref.equilibrium(s)[0], keep)
        real = ref.real_part(base)
        other = ref.modes(real.M, real.C, real.G, real.K, real.N)
        columns.append(ref.eigenvalue_derivative(real, other, d))
    return modes, names, np.array(columns).T


def sensitivity():
    modes, names, theirs = eigenvalue_slopes()
    return [(mb.sensitivity(modes, names, equilibrium="follow").eigenvalue, theirs)]


def eigen_sensitivity():
    modes, names, theirs = eigenvalue_slopes()
    d = mb.sensitivity(modes.system, names, equilibrium="follow")
    zero = np.zeros((modes.n, modes.n, len(names)))
    dM, dC, dK = (zero if a is None else a for a in (d.M, d.C, d.K))
    own = mb.eigen_sensitivity(modes, dM=dM, dC=dC, dK=dK)
    return [(own.eigenvalue, theirs)]


def gradient():
    """The end of a motion, extrapolated from two steps, against differences of motions that SciPy integrates."""
    m = crank(False)
    goal = mb.Final(lambda s: s.position("rocker")[0])
    coarse, fine = (mb.gradient(m, goal, ["A.k"], t=0.2, step=h) for h in (1e-3, 5e-4))
    t, x = tables(m), directions(m, ["A.k"]).dense[:, 0]

    def end(step):
        sys = ref.System(t, np.asarray(t["x"]) + step * x)
        return ref.simulate(sys, ref.drawn_state(sys), [0.1, 0.2], rtol=1e-12).positions(sys)[-1, 2, 0]

    h = 0.05
    slope = (8 * (end(h) - end(-h)) - (end(2 * h) - end(-2 * h))) / (12 * h)
    return [
        ((4 * fine.value - coarse.value) / 3, end(0.0)),
        ((4 * fine.gradient - coarse.gradient) / 3, np.array([slope])),
    ]


def frequency_response():
    return compared(mb.frequency_response(OSCILLATOR, force=[0.0, 0.31], omega=(0.5, 2.9), harmonics=[1, 3, 5]))


def parameter_response():
    def family(k):
        return mb.MechanicalSystem(OSCILLATOR.M, OSCILLATOR.C, OSCILLATOR.K, elements=[mb.Cubic(k, w=[1.0, -1.0])])

    options = {"force": [0.0, 0.31], "omega": 1.37, "harmonics": [1, 3, 5]}
    return compared(mb.parameter_response(family, value=(0.2, 1.1), **options))


def limit_cycle():
    system = mb.MechanicalSystem([[1.3]], [[-0.4]], [[2.1]], elements=[mb.VanDerPol(0.4, w=[1.0])])
    found = mb.limit_cycle(system, harmonics=41)
    start = np.concatenate([found.displacement(0.0), found.velocity(0.0)]).ravel()
    _, period, monodromy = hbm_shooting.cycle(system, [0.0], start, found.period)
    exponents = np.log(np.linalg.eigvals(monodromy).astype(complex)) / period
    return [(found.period, period), (np.sort(found.exponents.real), np.sort(exponents.real), 1.0 / period)]


def quasi_periodic():
    return compared(mb.quasi_periodic(DUFFING, TONES, harmonics=5))


def quasi_periodic_response():
    return compared(mb.quasi_periodic_response(DUFFING, TONES, scale=(1.0, 1.1), harmonics=5))


def root():
    from scipy.optimize import root as scipy_root

    def equations(x):
        return np.array([2.0 * x[0] + 0.3 * np.sin(x[1]) - 0.7, x[1] + 0.2 * x[0] ** 3 - x[0] + 0.4])

    start = np.array([0.6, -0.5])
    return [(mb.root(equations, start, tol=1e-13).x, scipy_root(equations, start, tol=1e-14).x)]


CASES = {
    "linearize": lambda: compared(linear()[1]),
    "equilibrium": lambda: compared(mb.equilibrium(crank())),
    "modes": lambda: compared(mb.modes(linear()[1])),
    "frf": lambda: compared(
        mb.frf(linear()[1], inputs="coupler.force.x", outputs="tip.motion.y", frequency=[0.3, 2.1])
    ),
    "simulate": lambda: compared(mb.simulate(crank(), t=0.13, rtol=1e-9)),
    "harmonic_balance": lambda: compared(mb.harmonic_balance(OSCILLATOR, force=[0.0, 0.31], omega=1.37, harmonics=9)),
    "response": response,
    "state_space": state_space,
    "sensitivity": sensitivity,
    "eigen_sensitivity": eigen_sensitivity,
    "gradient": gradient,
    "steady_motion": steady_motion,
    "frequency_response": frequency_response,
    "parameter_response": parameter_response,
    "limit_cycle": limit_cycle,
    "quasi_periodic": quasi_periodic,
    "quasi_periodic_response": quasi_periodic_response,
    "root": root,
}


def public_analyses():
    """Public functions that return a `Result` (or a union, or anything, of them)."""
    found = []
    for name in PUBLIC:
        value = getattr(mb, name)
        if not inspect.isfunction(value):
            continue
        module = importlib.import_module(value.__module__)
        returned = str(inspect.signature(value).return_annotation)
        named = getattr(module, returned, None)
        if returned == "Any" or (inspect.isclass(named) and issubclass(named, Result)):
            found.append(name)
    return found


def test_the_list_is_what_the_package_offers():
    assert {"modes", "linearize", "equilibrium", "frf", "response", "sensitivity", "steady_motion"} <= set(
        public_analyses()
    )


SLOW = {"simulate", "gradient"}  # plain NumPy integrated in time


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in SLOW else ())
        for name in sorted({*public_analyses(), *CASES} - set(COMPOSED))
    ],
)
def test_the_numbers_agree_with_the_counterpart(name):
    assert name in CASES, (
        f"mb.{name} has no counterpart: write one in plain NumPy, and a case here that compares numbers"
    )
    for core, other, *scale in CASES[name]():
        core, other = np.asarray(core), np.asarray(other)
        assert core.shape == other.shape
        size = max(np.abs(a).max(initial=0.0) for a in (core, other, *map(np.asarray, scale)))
        difference = np.abs(core - other).max(initial=0.0) / size
        print(f"{name}: {difference:.1e} of {size:.3g}")
        assert size > 0.0 and difference < TOLERANCE.get(name, USUAL)
