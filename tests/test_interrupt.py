"""Ctrl-C stops any call soon, and other Python threads run meanwhile.

Each case is work of seconds; an alarm raises KeyboardInterrupt in its midst, as Ctrl-C does. Delays are printed: what is
asserted is that the call ends long before its work would.
"""

import signal
import threading
import time
import warnings

import mbrs as mb
import numpy as np
import pytest


def _dense(n):
    rng = np.random.default_rng(n)
    a, c = rng.standard_normal((n, n)), rng.standard_normal((n, n))
    return mb.MechanicalSystem(np.eye(n), c @ c.T / n, a @ a.T + np.eye(n))


def _modes():
    system = _dense(900)
    return lambda: mb.modes(system)


def _transfer_function():
    system = _dense(900)
    return lambda: mb.frf(system, inputs=[0], outputs=[0], frequency=np.linspace(0.1, 10.0, 4000))


def _response():
    system = _dense(900)
    t = np.linspace(0.0, 100.0, 200_001)
    return lambda: mb.response(system, t=t, loads={0: np.sin(t)}, outputs=[0])


def _sparse_modes():
    chain = mb.examples.chain(20_000, joint="revolute", springs=1)
    mb.System(chain)
    return lambda: mb.modes(chain, n=20)


def _equilibrium():
    chain = mb.examples.chain(300, joint="spherical", springs=1)
    chain.gravity = (0.0, -9.81, 0.0)
    mb.System(chain)
    return lambda: mb.equilibrium(chain)


def _branch():
    rng = np.random.default_rng(1)
    n = 60
    a = rng.standard_normal((n, n))
    elements = [mb.Cubic(0.1, w=np.eye(n)[i]) for i in range(n)]
    system = mb.MechanicalSystem(np.eye(n), 0.05 * np.eye(n), a @ a.T + np.eye(n), elements=elements)
    force = np.ones(n)
    return lambda: mb.frequency_response(system, force=force, omega=(0.5, 30.0), harmonics=15)


def _motion():
    m = mb.examples.chain(30, joint="spherical", springs=1)
    m.gravity = (0.0, -9.81, 0.0)
    mb.System(m)
    return lambda: mb.simulate(m, t=1e4, rtol=1e-10)


CASES = {
    "modes": _modes,
    "transfer function": _transfer_function,
    "response": _response,
    "sparse modes": _sparse_modes,
    "equilibrium": _equilibrium,
    "branch": _branch,
}


def _interrupted(call, after):
    """Seconds from the alarm to the end of the call; None where the call was done before."""
    rung = []

    def ring(signum, frame):
        rung.append(time.perf_counter())
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, after)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mb.MbrsWarning)
            call()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        return None
    except KeyboardInterrupt:
        return time.perf_counter() - rung[0]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("name", CASES)
def test_ctrl_c_ends_a_call(name):
    call = CASES[name]()
    start = time.perf_counter()
    delay = _interrupted(call, 0.1)
    print(f"{name}: {time.perf_counter() - start - 0.1 if delay is None else delay:.3f} s after Ctrl-C")
    assert delay is not None, "the case is too small to be interrupted"


def test_other_threads_run_during_a_solve():
    system, ticks, done = _dense(250), [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.005)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    mb.modes(system)
    end = time.perf_counter()
    done.set()
    thread.join()
    inside = [t for t in ticks if start < t < end]
    print(f"{len(inside)} ticks of 5 ms in {end - start:.2f} s")
    assert len(inside) > 0.2 * (end - start) / 0.005
