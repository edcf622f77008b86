"""A model and functions of it for tests of sweeps: at the top of a module, so that workers can import them."""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
import time

import mbrs as mb
import numpy as np

AXIS = (0.31, -0.83, 0.46)
FACTOR = 0.7


def model():
    m = mb.Model("stage")
    k = m.parameter("k", 413.0, unit="N/m")
    m.parameter("mark", 0.0)
    b = m.body("b", mass=1.7, inertia=(0.1, 0.2, 0.3))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=AXIS, k=k, c=0.61)
    return m


def designs(n, seed=3):
    """Random stiffness and mass; ``mark`` counts the designs, for functions that do something at one of them."""
    found = mb.design.latin_hypercube({"k": (100.0, 900.0), "b.mass": (0.7, 2.3)}, n, seed)
    return mb.design.from_table({**{name: found[name] for name in found.names}, "mark": np.arange(n)})


def numbers(m):
    """Cheap numbers whose bits depend on every input."""
    k, mass = m.value("k"), m.value("b.mass")
    return {"f": np.sqrt(k / mass) * FACTOR, "list": np.array([k, mass, k * mass]) / 3.0, "n": int(m.value("mark"))}


def frequency(m):
    return {"f": mb.modes(m).frequency}


def awkward(m):
    """Arrays whose size and kind change, complex numbers, and errors."""
    i = int(m.value("mark"))
    if i % 7 == 3:
        raise ValueError(f"no luck with 'rail' in design {i}")
    if i % 11 == 5:
        return {"z": 1.0 + 1j * m.value("k")}
    return {"z": m.value("k"), "a": np.full((i % 4, 2), m.value("b.mass")), "flag": i % 2 == 0}


def slow(m):
    time.sleep(0.005)
    return numbers(m)


def slower(m):
    time.sleep(0.05)
    return numbers(m)


def spins(m):
    end = time.monotonic() + 60.0
    while int(m.value("mark")) == 2 and time.monotonic() < end:
        time.sleep(0.001)
    return numbers(m)


def aborts(m):
    if int(m.value("mark")) in (5, 17):
        faulthandler.disable()
        os.abort()
    return numbers(m)


def hangs(m):
    if int(m.value("mark")) in (2, 9):
        time.sleep(1e6)
    return numbers(m)


def hangs_deaf(m):
    """Does not hear the timer that would end it."""
    if int(m.value("mark")) == 2:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
        time.sleep(1e6)
    return numbers(m)


def presses_ctrl_c(m):
    if int(m.value("mark")) == 13:
        os.kill(os.getpid(), signal.SIGINT)
        if threading.current_thread() is threading.main_thread():
            time.sleep(30.0)
    time.sleep(0.002)
    return numbers(m)
