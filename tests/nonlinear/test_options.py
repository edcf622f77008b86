"""The three groups of options of harmonic balance: checked when made, and with the defaults that every function shows."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields
from inspect import signature

import mbrs as mb
import pytest
from mbrs.nonlinear.options import Continuation, Fourier, Newton

BRANCHES = (mb.frequency_response, mb.parameter_response, mb.quasi_periodic_response)
SINGLE = (mb.harmonic_balance, mb.quasi_periodic, mb.limit_cycle)
# A cycle needs more harmonics than a forced motion, and no forced period to be a multiple of.
OWN = {(mb.limit_cycle, "harmonics"): 15}


@pytest.mark.parametrize("function", [*SINGLE, *BRANCHES, mb.Branch], ids=lambda f: f.__name__)
def test_functions_show_the_defaults_of_the_options(function):
    shown = {name: p.default for name, p in signature(function).parameters.items()}
    groups = (Fourier, Newton if function in SINGLE else Continuation)
    known = {one.name: one.default for group in groups for one in fields(group)}
    shared = known.keys() & shown.keys()
    # what a function leaves out means nothing there: subharmonics of a torus or a cycle, stability of a torus
    assert known.keys() - shared <= {"subharmonic", "stability", "events"}
    assert {name: shown[name] for name in shared} == {name: OWN.get((function, name), known[name]) for name in shared}


@pytest.mark.parametrize(
    ("group", "wrong", "words"),
    [
        (Fourier, {"harmonics": "many"}, "harmonics must be a number, a sequence or \"auto\", it is 'many'"),
        (Fourier, {"tol": 0.0}, "tol must be a positive number, it is 0.0"),
        (Fourier, {"subharmonic": 1.5}, "subharmonic must be an integer"),
        (Newton, {"tolerance": 1.0}, "must be below 1"),
        (Newton, {"max_iterations": 0}, "max_iterations must be an integer from 1"),
        (Continuation, {"predictor": "guess"}, "there is no predictor 'guess'; known are \"tangent\""),
        (Continuation, {"corrector": None}, "there is no corrector None"),
        (Continuation, {"step": 0.2}, "min_step <= step <= max_step must hold, they are 1e-09, 0.2, 0.1"),
        (Continuation, {"max_step": 20.0}, "larger than the whole curve"),
        (Continuation, {"stability": 1}, "stability must be True or False, it is 1"),
    ],
)
def test_wrong_options_are_refused_when_they_are_made(group, wrong, words):
    with pytest.raises(mb.ModelError) as refused:
        group(**wrong)
    assert words in str(refused.value)


def test_the_tolerance_follows_from_the_harmonics():
    assert (Fourier(5).limit(), Fourier("auto").limit(), Fourier(5, tol=3e-4).limit()) == (0.1, 1e-6, 3e-4)
    assert Fourier([5, 1]).terms == (1, 5) and Fourier(2, subharmonic=3).terms == (1, 2, 3, 4, 5, 6)


def test_options_do_not_change():
    with pytest.raises(FrozenInstanceError):
        Newton().tolerance = 1.0
    assert Fourier(3).but(condense=False) == Fourier(3, condense=False)
