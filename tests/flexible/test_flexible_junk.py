"""Junk in any argument of what makes flexible bodies and their loads: our own errors, or it is taken."""

from __future__ import annotations

import inspect
import warnings

import mbrs as mb
import numpy as np
import pytest
from junk import JUNK
from mbrs.flexible import ModalBody, beam, craig_bampton


def spring():
    k, m = np.eye(6), np.diag([1.0, 1, 1, 0.1, 0.1, 0.1])
    return dict(
        M=np.kron(np.eye(2), m),
        K=np.block([[k, -k], [-k, k]]),
        nodes={"a": 0, "b": 1},
        positions=np.zeros((2, 3)),
        modes=0,
    )


def bar():
    P1, P2 = np.zeros((1, 3, 3)), np.zeros((1, 1, 3, 3))
    P1[0, 0, 2], P2[0, 0, 2, 2] = 0.25, 0.2
    given = dict(mass=1.0, com=(0.5, 0, 0), inertia=np.diag([1e-4, 0.0834, 0.0834]), S=np.array([[0], [0], [1 / 3]]))
    return dict(**given, P1=P1, P2=P2, K=np.array([[80.0]]))


def wing():
    m = mb.Model("wing")
    m.flexible_body("wing", beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=2.0, modes=2, elements=4))
    return m


MAKERS = {
    "beam": (beam, lambda: dict(length=1.0, mass=1.0, EI_flap=1.0, EI_edge=2.0, modes=2, elements=4)),
    "craig_bampton": (craig_bampton, spring),
    "ModalBody": (ModalBody, bar),
    "multiblade": (mb.multiblade, lambda: dict(values=[1.0, 2.0], azimuth=[0.0, np.pi])),
    "section_load": (
        mb.Model.section_load,
        lambda: dict(self=wing(), body="wing", stations=[0.0, 1.0], table=np.ones((2, 2, 3)), times=[0.0, 1.0]),
    ),
    "modal_force": (mb.Model.modal_force, lambda: dict(self=wing(), name="push", body="wing", mode=1, value=1.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MAKERS)
def test_junk(name):
    make, given = MAKERS[name]
    make(**given())
    refused = taken = 0
    for argument in inspect.signature(make).parameters:
        for junk in JUNK if argument != "self" else ():
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    make(**{**given(), argument: junk})
            except mb.MbrsError:
                refused += 1
            except Exception as reason:
                raise AssertionError(f"{argument}={junk!r} gave {type(reason).__name__}: {reason}") from reason
            else:
                taken += 1
    print(f"{name}: {refused} refused, {taken} taken")
    assert refused > 20
