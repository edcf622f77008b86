"""Requests that cannot fit into memory: an error with sizes and remedy, and the process lives.

Every case runs in a process of its own with a limit on its address space, where an allocation that fails would end it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import textwrap

import mbrs as mb
import numpy as np
import pytest
from mbrs import _core
from mbrs.errors import RouteError

PRELUDE = """
    import resource, warnings
    warnings.simplefilter("ignore")
    import numpy as np
    import mbrs as mb
    from mbrs.errors import RouteError

    def bodies(n):
        m = mb.Model("bodies")
        last = m.ground
        for i in range(n):
            b = m.body(f"b{i}", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(i + 1.0, 0, 0))
            m.prismatic(f"j{i}", m.ground, b, at=(i + 1.0, 0, 0), axis=(1.0, 0.3, 0.2))
            m.bushing(f"k{i}", last, b, at=(i + 0.5, 0, 0), k=(1e4,) * 6, c=(1.0,) * 6)
            last = b
        mb.System(m)  # compiled before the limit
        return m

    def limited(bytes):
        pages = int(open("/proc/self/statm").read().split()[0])
        most = pages * resource.getpagesize() + int(bytes)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
"""

# name: what is made before the limit, the call, what the message has to name, and what helps
CALLS = {
    "all modes of a model": ("m = bodies(n)", "mb.modes(m)", "linearisation|modes", r"mb\.modes\(m, n=\.\.\.\)|\(n=\)"),
    "equilibrium": (
        "m = bodies(n)",
        "mb.equilibrium(m)",
        "equilibrium",
        r"drawn in balance.*mb\.modes\(m, n=\.\.\.\).*divide the model",
    ),
    "transfer function of a model": (
        "m = bodies(n)",
        "mb.frf(m, inputs=['b0.force.x'], outputs=['b1.motion.x'], frequency=[1.0, 2.0])",
        "linearisation|reduction",
        "divide the model|reduce the system",
    ),
    "motion": (
        "m = bodies(n)",
        "mb.simulate(m, t=1e-4, step=1e-4, method='generalized-alpha')",
        "motion",
        "divide the model",
    ),
    "modes of matrices": (
        "s = mb.MechanicalSystem(np.eye(n), np.diag(np.arange(1.0, n + 1)), np.diag(np.arange(1.0, n + 1)))",
        "mb.modes(s)",
        "modes",
        r"\(n=\) of sparse matrices|give them sparse",
    ),
    "reduction": (
        "s = mb.MechanicalSystem(np.eye(n), None, np.diag(np.arange(1.0, n + 1)))",
        "mb.frf(s, 0, 0, omega=[0.3, 0.7])",
        "reduction",
        "give sparse matrices|give them sparse",
    ),
}
# the same by what is proposed
REMEDIES = {
    "equilibrium": ("m = bodies(n)", "mb.modes(m, n=3)"),
    "reduction": (
        "import scipy.sparse as sp; s = mb.MechanicalSystem(sp.eye(n).tocsr(), None, sp.diags(np.arange(1.0, n + 1)).tocsr())",
        "mb.frf(s, 0, 0, omega=[0.3, 0.7])",
    ),
}


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits the address space by setrlimit")
@pytest.mark.parametrize("part", [0.02, 0.3, 0.6])
@pytest.mark.parametrize("what", list(CALLS))
def test_a_route_that_does_not_fit_is_refused_in_time(what, part):
    """Limits below what the route asks for: refused at any of them. ``part`` is that of 60 square matrices."""
    n = 1500
    made, call, named, remedy = CALLS[what]
    code = f"""
        n = {n}
        {made}
        limited({part} * 60 * 8 * n * n)
        try:
            {call}
        except RouteError as refused:
            print("refused", refused)
        else:
            print("granted")
    """
    text = _run(code)
    print(text)
    if not text.startswith("granted"):
        sizes = rf"({named}).* would take about [\d.]+ [kMGTP]B of memory, of which [\d.]+ "
        assert re.search(sizes, text) or "a stack of 64 MB, which could not be started" in text, text
        assert re.search(remedy, text) or "raise the limits" in text, text
    assert text.startswith("refused") or part > 0.1


@pytest.mark.parametrize("what", list(REMEDIES))
def test_what_a_refusal_proposes_fits_where_the_call_does_not(what):
    """In 100 MB, of which a square matrix takes a fifth."""
    n = 1500
    for made, call, text in ((*CALLS[what][:2], "refused"), (*REMEDIES[what], "granted")):
        code = f"""
            n = {n}
            {made}
            try:
                {call}
                print("granted")
            except RouteError:
                print("refused")
        """
        assert _run(code, MBRS_MEMORY="1e8") == text, call


@pytest.mark.slow
def test_the_refusal_is_not_a_habit():
    """The same routes with room are granted."""
    for what, (made, call, *_) in CALLS.items():
        assert _run(f"n = 60\n{made}\nlimited(1.2e9)\n{call}\nprint('granted')", indent=False) == "granted", what


# what is asked for, and what the message has to name; each would end in an array of Python's own
ARRAYS = {
    "mb.frf(big, list(range(300)), list(range(300)), omega=np.linspace(0.1, 0.9, 40))": "inputs: 300 directions of 300000 coordinates",
    "mb.frf(small, [0], [1], omega=np.broadcast_to(0.3, (10**9,)))": "omega of 1000000000 numbers",
    "mb.response(big, np.linspace(0, 1, 99), {0: np.sin}, list(range(300)))": "outputs: 300 directions",
    "mb.response(small, np.linspace(0, 1.3, 900_000), {0: np.sin}, [0, 1, 2] * 9)": "a response of 27 outputs to 1 loads",
    "mb.harmonic_balance(big, force=np.ones(300_000), omega=0.3, harmonics=200)": "200 harmonics of 300000 coordinates",
    "mb.simulate(small, np.linspace(0, 1.3, 950_000), x0=[1, 0, 0])": "a motion with 950000 outputs",
    "mb.simulate(leaning, 1.3, step=1e-6)": "a motion with 1300000 outputs",
    "mb.gradient(leaning, mb.Final(lambda s: s.position('bob')[0]), 'hinge.k', t=1.3, step=1e-6)": "a gradient over 1300000 steps",
    "mb.eigen_sensitivity(mb.modes(small), dK=np.broadcast_to(1.0, (3, 3, 10**8)))": "dK of 900000000 numbers",
}


def test_arrays_of_python_are_refused_before_they_are_made():
    code = f"""
        import scipy.sparse as sp
        n = 300_000
        chain = sp.diags([np.full(n - 1, -1.0), np.full(n, 2.1), np.full(n - 1, -1.0)], [-1, 0, 1], format="csc")
        big = mb.MechanicalSystem(M=sp.eye(n, format="csc"), K=chain)
        small = mb.MechanicalSystem(M=np.diag([1.3, 0.7, 0.9]), K=np.diag([1.0, 2.0, 3.0]))
        leaning = mb.Model("pendulum", gravity=(0.3, -1.2, -9.1))
        bob = leaning.body("bob", mass=1.7, inertia=(0.11, 0.23, 0.19), at=(0.4, -0.3, -0.7))
        leaning.revolute("hinge", leaning.ground, bob, at=(0.1, 0.2, 0.3), axis=(0.5, -0.7, 0.3), k=31.0)
        for call in {list(ARRAYS)!r}:
            try:
                eval(call)
            except RouteError as refused:
                print(refused)
            else:
                print("granted")
    """
    for line, (call, named) in zip(_run(code, MBRS_MEMORY="3e8").splitlines(), ARRAYS.items(), strict=True):
        assert re.match(
            rf"{named}.* would take about [\d.]+ [MG]B of memory, of which 300.0 MB are available; \w", line
        ), (call, line)


@pytest.mark.slow
def test_what_no_machine_has():
    ports, points = list(range(150)), np.linspace(0.7, 1.9, 10**8)
    s = mb.MechanicalSystem(np.eye(150), np.eye(150), np.diag(np.arange(1.0, 151.0)))
    with pytest.raises(RouteError, match=r"150 x 150 x 100000000 values.*TB.*fewer ports or frequencies"):
        mb.frf(s, ports, ports, omega=points)
    huge = np.broadcast_to(0.0, (2**24, 2**24))  # 2 PB that are stored as one number
    with pytest.raises(RouteError, match=r"a dense M of 16777216 coordinates.*PB.*sparse"):
        mb.MechanicalSystem(huge, K=huge)


def test_sizes_are_told_and_small_requests_pass():
    free = _core.available_memory()
    assert 1e7 < free < 1e16
    _core.require_memory(0.0, "nothing", "")
    _core.require_memory(0.5 * free, "half", "")
    for size in (1.5 * free, np.inf, np.nan):
        with pytest.raises(_core.CoreRouteError, match=r"all of it would take about .*; take less"):
            _core.require_memory(size, "all of it", "take less")


def test_the_variable_takes_the_place_of_the_machine():
    code = """
        from mbrs import _core
        print(_core.available_memory())
    """
    assert float(_run(code, MBRS_MEMORY="3.7e8")) == 3.7e8
    assert float(_run(code, MBRS_MEMORY="no number")) > 1e7


def _run(code, indent=True, **variables):
    body = textwrap.dedent(code) if indent else code
    env = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
        "OPENBLAS_NUM_THREADS": "1",
        **variables,
    }
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(PRELUDE) + body],
        env=env,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, f"ended with {done.returncode}: {done.stderr[-2000:]}"
    return done.stdout.strip()
