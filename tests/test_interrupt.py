"""Ctrl-C stops long calls while they run, and other Python threads go on meanwhile."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import mbrs as mb
import numpy as np
import pytest

# each of them would take far longer than the test waits
LONG = {
    "all modes, dense": """
        n = 3000
        rng = np.random.default_rng(0)
        a = rng.normal(size=(n, n))
        s = mb.MechanicalSystem(np.eye(n), np.diag(rng.random(n)), a + a.T + 200.0 * np.eye(n))
        call = lambda: mb.modes(s)
    """,
    "transfer function, direct": """
        n = 200
        rng = np.random.default_rng(0)
        a = rng.normal(size=(n, n))
        s = mb.MechanicalSystem(np.eye(n), np.diag(rng.random(n)), a @ a.T)
        omega = np.linspace(1.0, 2.0, 4_000_000)
        call = lambda: mb.frf(s, 0, list(range(40)), omega=omega)
    """,
    "time response": """
        n = 200
        rng = np.random.default_rng(0)
        a = rng.normal(size=(n, n))
        s = mb.MechanicalSystem(np.eye(n), np.diag(rng.random(n)), a @ a.T)
        t = np.cumsum(rng.uniform(1e-4, 2e-4, 100_000))
        call = lambda: mb.response(s, t=t, loads={0: np.sin(t)}, outputs=0)
    """,
    "lowest modes, sparse": """
        import scipy.sparse as sp
        n = 400
        k = sp.diags([2.0 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1])
        one = sp.eye(n)
        K = (sp.kron(k, one) + sp.kron(one, k)).tocsc()
        call = lambda: mb.modes(mb.MechanicalSystem(sp.eye(n * n, format="csc"), None, K), n=200)
    """,
}


@pytest.mark.parametrize("what", list(LONG))
def test_ctrl_c_stops_a_call_that_runs(what, tmp_path):
    """SIGINT in the middle: KeyboardInterrupt, long before the call could have ended. The delay is printed, not judged."""
    script = tmp_path / "long.py"
    script.write_text(
        textwrap.dedent("import os, sys, time\nimport numpy as np\nimport mbrs as mb\n")
        + textwrap.dedent(LONG[what])
        + textwrap.dedent("""
            print("ready", flush=True)
            try:
                call()
            except KeyboardInterrupt:
                print(f"interrupted {time.monotonic()}", flush=True)
                os._exit(7)  # the abandoned worker is not waited for
            os._exit(0)
        """)
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen([sys.executable, str(script)], env=env, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline().strip() == "ready"
        time.sleep(0.7)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        try:
            text, _ = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 7, f"{what} ended by itself or went on"
    print(f"{what}: interrupted after {float(text.split()[-1]) - sent:.3f} s")


def test_other_threads_run_while_the_core_works():
    """The counting thread gets the interpreter during the solve, not only before and after it."""
    n = 500
    rng = np.random.default_rng(1)
    a = rng.normal(size=(n, n))
    system = mb.MechanicalSystem(np.eye(n), np.diag(rng.random(n)), a @ a.T + np.eye(n))
    counted, inside, over = [0], threading.Event(), threading.Event()

    def count():
        while not over.is_set():
            if inside.is_set():
                counted[0] += 1
            time.sleep(0.0005)

    from mbrs import _core

    thread = threading.Thread(target=count)
    thread.start()
    try:
        inside.set()
        _core.dense_modes(system.M, system.C, None, system.K, None, None)
        inside.clear()
    finally:
        over.set()
        thread.join()
    print(f"the other thread ran {counted[0]} times during the solve")
    assert counted[0] > 10
