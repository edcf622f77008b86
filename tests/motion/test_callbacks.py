"""Functions of the user inside the core: what they raise comes out as it is, and they may use the model that they belong to."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import traceback

import mbrs as mb
import numpy as np
import pytest


class Mine(Exception):
    """An exception that mbrs does not know."""


def raising(kind, when):
    """A function of time or of arrays that raises ``kind`` once ``when`` is true of its first argument."""

    def the_function_of_the_user(t, *_):
        if when(t):
            raise kind("a reason of its own")
        return np.zeros_like(t)

    return the_function_of_the_user


def plain(load=None, drive=None, n=1):
    """Bodies on bushings, along no axis; ``n`` = 80 takes the route of large models, which runs on another thread."""
    m = mb.Model("bodies")
    for i in range(n):
        b = m.body(f"b{i}", mass=1.3 + i, inertia=(1.1, 0.9, 1.5), at=(0.3 * i, 0.2, 0.7))
        m.bushing(f"k{i}", m.ground, b, at=(0.3 * i, 0.1, 0.4), k=(113.0, 71.0, 257.0, 31.0, 53.0, 17.0), c=(0.3,) * 6)
    if load is not None:
        m.force("wind", "b0", value=lambda t: (0.0, float(load(t)), 0.3))
    if drive is not None:
        arm = m.body("arm", mass=0.7, inertia=(0.3, 0.2, 0.5), at=(0.1, -1.0, 0.3))
        m.revolute("hinge", m.ground, arm, at=(0, -1, 0), axis=(0.3, -0.5, 0.8))
        m.drive("motor", "hinge", lambda t: (float(drive(t)), 0.0, 0.0))
    return m


def late(t):
    return t > 0.137


class OnlyOnce:
    """True from the second call on: a model calls its functions once when they are defined."""

    def __init__(self):
        self.calls = 0

    def __call__(self, _):
        self.calls += 1
        return self.calls > 1


def slopes(t, u, v):
    return np.zeros_like(u), np.zeros_like(v)


def oscillator(law):
    return mb.MechanicalSystem(
        [[1.0]], [[0.07]], [[1.3]], elements=[mb.FunctionLaw(lambda t, u, v: law(u, v), derivatives=slopes, w=[1.0])]
    )


def swept(kind):
    def family(k3):
        if k3 > 0.07:
            raise kind("a reason of its own")
        return mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(k3, w=[1.0])])

    return family


CALLS = {
    "motion, explicit": lambda kind: mb.simulate(plain(raising(kind, late)), t=0.3, method="explicit"),
    "motion, bdf": lambda kind: mb.simulate(plain(raising(kind, late)), t=0.3, method="bdf"),
    "motion, generalised alpha": lambda kind: mb.simulate(
        plain(raising(kind, late)), t=0.3, method="generalized-alpha"
    ),
    "motion, bdf-bfgs": lambda kind: mb.simulate(plain(raising(kind, late)), t=0.3, step=0.01, method="bdf-bfgs"),
    "motion, ali3p": lambda kind: mb.simulate(plain(raising(kind, late)), t=0.3, step=0.01, method="ali3p"),
    "motion with a drive": lambda kind: mb.simulate(plain(drive=raising(kind, late)), t=0.3),
    "motion of many bodies": lambda kind: mb.simulate(plain(raising(kind, late), n=80), t=0.3),
    "definition": lambda kind: plain(raising(kind, lambda t: True)),
    "linearisation": lambda kind: mb.linearize(plain(raising(kind, OnlyOnce()))),
    "linearisation of many bodies": lambda kind: mb.linearize(plain(raising(kind, OnlyOnce()), n=80)),
    "equilibrium": lambda kind: mb.equilibrium(plain(raising(kind, OnlyOnce()))),
    "modes": lambda kind: mb.modes(plain(raising(kind, OnlyOnce()))),
    "lowest modes": lambda kind: mb.modes(plain(raising(kind, OnlyOnce()), n=80), n=3),
    "degrees of freedom": lambda kind: mb.System(plain(drive=raising(kind, OnlyOnce()))),
    "gradient": lambda kind: mb.gradient(
        plain(raising(kind, late)), mb.Final(lambda s: s.position("b0")[0]), ["b0.mass"], t=0.3, step=0.01
    ),
    "harmonic balance": lambda kind: mb.harmonic_balance(oscillator(raising(kind, np.any)), force=[0.3], omega=0.9),
    "frequency response": lambda kind: mb.frequency_response(
        oscillator(raising(kind, lambda u: np.max(np.abs(u)) > 0.5)), force=[0.1], omega=(0.5, 1.4)
    ),
    "family": lambda kind: mb.parameter_response(swept(kind), value=(0.01, 0.1), force=[0.18], omega=0.9),
    "root": lambda kind: mb.root(raising(kind, lambda x: True), np.array([0.3, 0.7])),
}


SWEEPS = ("frequency response", "family")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", [Mine, KeyboardInterrupt, SystemExit, ZeroDivisionError], ids=lambda k: k.__name__)
@pytest.mark.parametrize("what", list(CALLS))
def test_what_a_function_raises_comes_out_as_it_is(what, kind):
    """Type, text and traceback down to the user's own line."""
    with pytest.raises(kind) as caught:
        CALLS[what](kind)
    if what in SWEEPS and kind is KeyboardInterrupt:  # Ctrl-C within the function: the sweep so far
        assert isinstance(caught.value, mb.Interrupted) and len(caught.value.result.omega) > 0
        return
    assert type(caught.value) is kind and caught.value.args == ("a reason of its own",)
    frames = [frame.name for frame in traceback.extract_tb(caught.value.__traceback__)]
    assert frames[-1] in ("the_function_of_the_user", "family")


def test_the_core_goes_on_after_a_function_has_raised():
    """Nothing of the call that was left remains: the same model gives the same motion as one that never raised."""
    broken = [True]

    def load(t):
        if broken[0] and late(t):
            raise Mine
        return np.sin(7.0 * t)

    m = plain(load)
    with pytest.raises(Mine):
        mb.simulate(m, t=0.3)
    broken[0] = False
    again, fresh = mb.simulate(m, t=0.3), mb.simulate(plain(load), t=0.3)
    assert np.array_equal(again.position("b0"), fresh.position("b0"))


def test_a_branch_goes_on_where_its_law_raised():
    allowed = [0.4]

    def law(t, u, v):
        if np.max(np.abs(u)) > allowed[0]:
            raise Mine
        return 0.1 * u**3

    def slope(t, u, v):
        return 0.3 * u**2, np.zeros_like(u)

    def system(f):
        return mb.MechanicalSystem([[1.0]], [[0.07]], [[1.3]], elements=[mb.FunctionLaw(f, derivatives=slope, w=[1.0])])

    branch = mb.Branch(system(law), force=[0.1], omega=(0.5, 1.4), harmonics=5)
    with pytest.raises(Mine):
        branch.run(500)
    before = len(branch.chunks)
    allowed[0] = np.inf
    branch.run(500)
    assert branch.status != "going" and len(branch.chunks) > before


OWN_MODEL = {
    "modes of itself": "lambda t: (mb.modes(m).frequency[0] if t > 0 else 0.0, 0.0, 0.0)",
    "its own motion": "lambda t: (mb.simulate(m, t=0.005).position('b')[-1, 0] if t > 0.017 else 0.0, 0.0, 0.0)",
    "its own equilibrium": "lambda t: (mb.equilibrium(m).position('b')[0] if t > 0 else 0.0, 0.0, 0.0)",
}


@pytest.mark.some(1)
@pytest.mark.parametrize("n", [0, pytest.param(40, marks=pytest.mark.slow)])
@pytest.mark.parametrize("what", list(OWN_MODEL))
def test_a_load_may_use_its_own_model(what, n):
    """In a process of its own, since what is tested for is waiting without end."""
    code = f"""
        import warnings; warnings.simplefilter("ignore")
        import mbrs as mb
        m = mb.Model("own")
        b = m.body("b", mass=1.3, inertia=(1, 2, 2), at=(0.1, 0.2, 0.7))
        m.bushing("k", m.ground, b, at=(0, 0, 0.3), k=(113.0, 71.0, 257.0, 31.0, 53.0, 17.0))
        for i in range({n}):
            c = m.body(f"c{{i}}", mass=1.0, inertia=(1, 1, 1), at=(i, 1, 0))
            m.bushing(f"l{{i}}", m.ground, c, at=(i, 1, 0.3), k=(100.0,) * 6)
        m.force("f", b, value={OWN_MODEL[what]})
        print(mb.simulate(m, t=0.02, rtol=1e-4).status, mb.modes(m).status)
    """
    assert _run(code) == "finished converged"


def test_a_function_that_calls_itself_without_end_is_pythons_own_error():
    code = """
        import warnings; warnings.simplefilter("ignore")
        import mbrs as mb
        m = mb.Model("own")
        b = m.body("b", mass=1.3, inertia=(1, 2, 2), at=(0.1, 0.2, 0.7))
        m.bushing("k", m.ground, b, at=(0, 0, 0.3), k=(113.0, 71.0, 257.0, 31.0, 53.0, 17.0))
        going = []
        m.force("f", b, value=lambda t: (mb.modes(m).frequency[0] if going else 0.0, 0.0, 0.0))
        going.append(1)
        m.set({"b.mass": 1.4})
        try:
            mb.modes(m)
        except RecursionError as error:
            print(type(error).__name__)
    """
    assert _run(code) == "RecursionError"


def _run(code):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], env=env, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()
