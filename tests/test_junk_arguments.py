"""Junk in any argument of an analysis: our own errors within seconds, or it is taken."""

from __future__ import annotations

import inspect
import signal
import warnings

import mbrs as mb
import numpy as np
import pytest
from junk import JUNK


def leaning():
    """A pendulum on a leaning hinge with a spring, 1 freedom."""
    m = mb.Model("pendulum", gravity=(0.3, -1.2, -9.1))
    b = m.body("bob", mass=1.7, inertia=(0.11, 0.23, 0.19), at=(0.4, -0.3, -0.7))
    m.revolute("hinge", m.ground, b, at=(0.1, 0.2, 0.3), axis=(0.5, -0.7, 0.3))
    m.spring_damper("spring", m.ground, b, at=((1.1, 0.2, 0.4), (0.4, -0.3, -0.7)), k=31.0, c=0.7)
    return m


def matrices():
    return dict(M=np.diag([1.3, 0.7]), C=np.diag([0.03, 0.01]), K=np.array([[3.0, -1.0], [-1.0, 2.0]]), G=None, N=None)


def pair():
    return mb.MechanicalSystem(**matrices())


CALLS = {
    "Model": (mb.Model, lambda: dict(name="m")),
    "MechanicalSystem": (mb.MechanicalSystem, matrices),
    "equilibrium": (mb.equilibrium, lambda: dict(m=leaning())),
    "linearize": (mb.linearize, lambda: dict(m=leaning())),
    "modes": (mb.modes, lambda: dict(m=pair())),
    "frf": (mb.frf, lambda: dict(m=pair(), inputs=[0], outputs=[1], frequency=[0.1, 0.2])),
    "response": (
        mb.response,
        lambda: dict(m=pair(), t=np.linspace(0, 1, 11), loads={0: lambda t: np.sin(t)}, outputs=[1]),
    ),
    "simulate": (mb.simulate, lambda: dict(m=leaning(), t=0.1)),
    "gradient": (
        mb.gradient,
        lambda: dict(
            m=leaning(), objective=mb.Final(lambda s: s.position("bob")[0]), parameters=["spring.k"], t=0.1, rtol=1e-5
        ),
    ),
}


def too_slow(*_):
    raise TimeoutError


def arguments():
    return [(name, argument) for name, (call, _) in CALLS.items() for argument in inspect.signature(call).parameters]


@pytest.mark.some(25)
@pytest.mark.parametrize(("name", "argument"), arguments())
def test_junk(name, argument):
    call, given = CALLS[name]
    usual = signal.signal(signal.SIGALRM, too_slow)
    refused = 0
    try:
        for junk in JUNK:
            signal.alarm(20)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    call(**{**given(), argument: junk})
                except mb.MbrsError as problem:
                    refused += 1
                    assert 15 < len(str(problem)) <= 500, (junk, str(problem))
                except Exception as problem:
                    raise AssertionError(f"{name}({argument}={junk!r:.60}): {type(problem).__name__}") from problem
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, usual)
    assert refused > 5
