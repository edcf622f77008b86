"""Arrays and numbers that no argument takes: every caller names the argument and what is wrong with it, in words of one kind."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
import scipy.sparse as sp
from mbrs._lib import checks
from mbrs.errors import MbrsError, ModelError

K = np.array([[3.0, -1.0], [-1.0, 2.0]])
T = np.linspace(0.0, 1.3, 14)


def pair():
    return mb.MechanicalSystem(M=np.diag([1.3, 0.7]), K=K)


def leaning():
    m = mb.Model("pendulum", gravity=(0.3, -1.2, -9.1))
    b = m.body("bob", mass=1.7, inertia=(0.11, 0.23, 0.19), at=(0.4, -0.3, -0.7))
    m.revolute("hinge", m.ground, b, at=(0.1, 0.2, 0.3), axis=(0.5, -0.7, 0.3), k=31.0)
    return m


# what is called with junk, the name in its message, and a value that it takes
CALLERS = {
    "w": (lambda a: mb.Cubic(1.7, w=a), [0.3, 0.7]),
    "K": (lambda a: mb.MechanicalSystem(M=np.eye(2), K=a), K),
    "inputs": (lambda a: mb.frf(pair(), a, [1], omega=[0.3]), [0.3, 0.7]),
    "omega": (lambda a: mb.frf(pair(), [0], [1], omega=a), [0.3, 0.7]),
    "t": (lambda a: mb.response(pair(), a, {0: np.sin}, [1]), T),
    "the load on x0": (lambda a: mb.response(pair(), T, {0: a}, [1]), np.sin(T)),
    "x0": (lambda a: mb.response(pair(), T, {0: np.sin}, [1], x0=a), [0.3, 0.7]),
    "v0": (lambda a: mb.simulate(pair(), T, v0=a), [0.3, 0.7]),
    "shapes": (lambda a: mb.mac(a, np.eye(2)), np.eye(2)),
    "weight": (lambda a: mb.mac(np.eye(2), np.eye(2), weight=a), K),
    "dK": (lambda a: mb.eigen_sensitivity(mb.modes(pair()), dK=a), np.ones((2, 2, 1))),
    "speed=": (lambda a: mb.campbell(leaning(), speed={"hinge": a}), None),
    "t=": (lambda a: mb.simulate(leaning(), a), T),
    "mb.AtTimes": (lambda a: mb.AtTimes(a, lambda s: s.t), T),
    "x0 of root": (lambda a: mb.root(lambda x: x * x - 0.3, a), [0.7, 0.9]),
    "frequency": (lambda a: mb.harmonic_balance(pair(), force=[1.0, 0.0], frequency=a), None),
}
JUNK = {
    "text": ("soon", "must hold numbers"),
    "ragged": ([[0.1], [0.2, 0.3]], "must hold numbers"),
    "an integer too large": ([10**400, 1], "must hold numbers"),
    "a thing": ([0.1, {}], "must hold numbers"),
    "dates": (np.array(["2026-01-01"], dtype="datetime64[D]"), "must hold numbers"),
    "not a number": ([0.1, np.nan], "contains NaN or infinite entries, nan at [1]"),
    "infinite": ([0.1, -np.inf], "contains NaN or infinite entries, -inf at [1]"),
    "complex": ([0.1 + 0.3j, 0.2], "must hold real numbers and is complex"),
    "five dimensions": (np.ones((1, 2, 1, 2, 1)), "must"),
}
SHAPE_FIRST = ("dK", "weight", "the load on x0")  # of which two numbers have the wrong shape


OWN = {
    ("inputs", "text"): "no coordinate is called 'soon'",
    ("inputs", "an integer too large"): "does not exist",
    ("frequency", "five dimensions"): "solves at one frequency",
}


@pytest.mark.parametrize(("name", "junk"), [(n, j) for n in CALLERS for j in JUNK if (n, j) != ("shapes", "complex")])
def test_one_kind_of_words(name, junk):
    value, words = JUNK[junk]
    if name in SHAPE_FIRST and junk in ("not a number", "infinite"):
        words = "must"
    words = OWN.get((name, junk), words)
    with pytest.raises(MbrsError) as refused:
        CALLERS[name][0](value)
    text = str(refused.value)
    assert name.removesuffix(" of root") in text and words in text and len(text) <= 500


@pytest.mark.parametrize("name", [name for name, (_, good) in CALLERS.items() if good is not None])
def test_what_is_right_passes(name):
    call, good = CALLERS[name]
    call(good)


@pytest.mark.parametrize("kind", ["csc_matrix", "csr_array", "coo_matrix", "dok_matrix"])
def test_a_sparse_matrix_is_checked_like_a_dense_one(kind):
    make = getattr(sp, kind)
    assert mb.MechanicalSystem(M=make(np.eye(2)), K=make(K)).n == 2
    with pytest.raises(ModelError, match="K must hold real numbers and is complex"):
        mb.MechanicalSystem(M=make(np.eye(2)), K=make(K * (1 + 0.3j)))
    with pytest.raises(ModelError, match="K contains NaN"):
        mb.MechanicalSystem(M=make(np.eye(2)), K=make(np.where(K > 2.5, np.nan, K)))


def test_the_array_is_a_copy_and_the_matrix_of_the_caller_stays():
    given = np.array([0.3, 0.7])
    made = checks.real_array("x", given)
    made[0] = 5.0
    assert given[0] == 0.3
    own = sp.csr_matrix(np.array([[3, -1], [-1, 2]]))
    mb.MechanicalSystem(M=np.eye(2), K=own)
    assert own.dtype.kind == "i" and own.data.flags.writeable


@pytest.mark.parametrize("value", [True, "1.5", None, [1.5, 2.5], np.nan, 10**400, 1j, 0.7])
def test_a_number_and_its_limits(value):
    with pytest.raises(ModelError, match=r"^rho must be a finite number from 1 to 2, it is "):
        checks.real_number("rho", value, 1.0, 2.0)
    assert checks.real_number("rho", np.array(1.5), 1.0, 2.0) == checks.positive("rho", np.float32(1.5)) == 1.5


@pytest.mark.parametrize("call", [mb.frf, mb.response])
def test_kinds_are_listed(call):
    more = dict(t=T, loads={0: np.sin}) if call is mb.response else dict(inputs=[0], omega=[0.3])
    with pytest.raises(ModelError, match=r"there is no kind \['speed'\]; known are \"\w+\", \"\w+\""):
        call(pair(), outputs=[1], kind=["speed"], **more)
