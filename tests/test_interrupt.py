"""Ctrl-C stops long calls while they run, and other Python threads go on meanwhile."""

from __future__ import annotations

import os
import pickle
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


@pytest.mark.parametrize(
    "what", ["time response", *(pytest.param(w, marks=pytest.mark.slow) for w in LONG if w != "time response")]
)
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


MODEL = """
import os, sys, time, warnings
warnings.simplefilter("ignore")
import numpy as np
import mbrs as mb

def chain(n):
    m = mb.Model("chain", gravity=(0.3, 0.2, -9.81))
    last = m.ground
    for i in range(n):
        b = m.body(f"b{i}", mass=1.0 + i, inertia=(0.1, 0.12, 0.13), at=(i + 1.0, 0.1, 0))
        m.revolute(f"j{i}", last, b, at=(i + 0.5, 0, 0.1), axis=(0.1, 1.0, 0.2), c=0.1)
        last = b
    return m

def ready():
    print("ready", flush=True)

# what the calls import is there before Ctrl-C comes
mb.simulate(chain(1), t=1e-3)
tiny = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.7, w=[1.0])])
mb.frequency_response(tiny, force=[0.3], omega=[0.3], harmonics=1)
mb.accuracy_study, mb.effect_study, mb.equilibrium, mb.parameter_response
"""

# name: a script that says when to interrupt it, and ends with 7 where it saw what it should have seen
CUT = {
    "motion": """
        ready()
        try:
            mb.simulate(chain(7), t=1e6, rtol=1e-10)
        except mb.Interrupted as cut:
            assert cut.result.status == "interrupted" and len(cut.result.t) > 1
            assert np.isfinite(cut.result.energy.total).all()
            sys.exit(7)
    """,
    "a loop over motions": """
        ready()
        for k in range(1000):
            mb.simulate(chain(3), t=1e5, rtol=1e-10)
    """,
    "accuracy study": """
        begun = []
        def motion(m, rtol):
            begun.append(rtol)
            if rtol == 1e-7:
                ready()
                return mb.simulate(m, t=1e6, rtol=rtol)
            return mb.simulate(m, t=0.1, rtol=rtol)
        try:
            mb.accuracy_study(motion, chain(2), rtol=[1e-3, 1e-5, 1e-7, 1e-9, 1e-11], repeat=1)
        except mb.Interrupted as cut:
            study = cut.result
            assert begun == [1e-3, 1e-5, 1e-7] and study.status == "interrupted" and "interrupted after 2 of 5" in str(cut)
            assert [p.settings["rtol"] for p in study.points] == ["0.001", "1e-05"] and str(study)
            sys.exit(7)
    """,
    "effect study": """
        begun = []
        def motion(m, without=()):
            begun.append(without)
            if len(begun) == 4:
                ready()
            return mb.simulate(m, t=1e6 if len(begun) >= 4 else 0.1, without=without, rtol=1e-8)
        try:
            mb.effect_study(motion, chain(2), repeat=1, effects=["gravity", "damping", "centrifugal"])
        except mb.Interrupted as cut:
            assert len(begun) == 4 and len(cut.result.runs) == 1 and cut.result.status == "interrupted"
            sys.exit(7)
    """,
    "effect study, before there is anything": """
        ready()
        try:
            mb.effect_study(mb.simulate, chain(4), t=1e6, rtol=1e-10)
        except mb.Interrupted as cut:
            assert cut.result is None
            sys.exit(7)
    """,
    "frequency response": """
        s = mb.MechanicalSystem(np.eye(2), 0.01 * np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]]), elements=[mb.Cubic(0.7, w=[1.0, 0.0])])
        ready()
        try:
            mb.frequency_response(s, force=[0.7, 0.1], omega=(0.1, 9.0), harmonics=21, step=1e-6, max_step=1e-6, max_points=10**7)
        except mb.Interrupted as cut:
            curve = cut.result
            assert curve.status == "interrupted" and len(curve.omega) > 1 and "cut by Ctrl-C" in str(curve)
            sys.exit(7)
    """,
    "frequencies one by one": """
        s = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.7, w=[1.0])])
        ready()
        try:
            mb.frequency_response(s, force=[0.3], omega=np.linspace(0.3, 0.9, 10**6), harmonics=9)
        except mb.Interrupted as cut:
            assert cut.result.status == "interrupted" and len(cut.result.omega) > 1
            sys.exit(7)
    """,
    "parameter response": """
        def family(k3):
            return mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(k3, w=[1.0])])
        ready()
        try:
            mb.parameter_response(family, value=(0.01, 10.0), force=[0.18], omega=0.9, step=1e-7, max_step=1e-7, max_points=10**7)
        except mb.Interrupted as cut:
            assert cut.result.status == "interrupted" and len(cut.result.value) > 1
            sys.exit(7)
    """,
    "a function that sleeps": """
        m = chain(70)
        def load(t):
            if t > 0:
                ready()
                time.sleep(3.0)  # on a thread of the core
            return (0.0, 0.0, 0.0)
        m.force("f", "b0", value=load)
        try:
            mb.simulate(m, t=1.0)
        except KeyboardInterrupt:
            sys.exit(7)  # with the thread still asleep in Python
    """,
    "an equilibrium with functions": """
        m = chain(5)
        started = []
        def load(t):
            if started:
                ready()
                for _ in range(10**8):
                    pass
            return (0.0, 0.0, 0.0)
        m.force("f", "b0", value=load)
        started.append(1)
        try:
            mb.equilibrium(m)
        except KeyboardInterrupt:
            sys.exit(7)
    """,
    "positions of many instants": """
        m = chain(40)
        traj = mb.simulate(m, t=np.linspace(0.0, 1e-3, 60_000), rtol=1e-3)
        ready()
        try:
            traj.energy, traj.reaction("j0")
        except KeyboardInterrupt:
            sys.exit(7)
    """,
}


def interrupted(arguments, wait=0.7, **variables):
    """Starts a program, sends SIGINT a while after it said "ready", and waits for its end: code, output, errors, seconds."""
    env = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
        "OPENBLAS_NUM_THREADS": "1",
        **variables,
    }
    with subprocess.Popen(arguments, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        if not variables:
            assert process.stdout.readline().strip() == "ready", process.stderr.read()
        time.sleep(wait)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        try:
            text, errors = process.communicate(timeout=60)
        finally:
            process.kill()
    return process.returncode, text, errors, time.monotonic() - sent


@pytest.mark.some(3)
@pytest.mark.parametrize("what", list(CUT))
def test_ctrl_c_brings_what_there_is_and_goes_no_further(what, tmp_path):
    script = tmp_path / "cut.py"
    script.write_text(MODEL + textwrap.dedent(CUT[what]))
    code, _, errors, seconds = interrupted([sys.executable, str(script)])
    print(f"{what}: ended {seconds:.3f} s after Ctrl-C")
    if what == "a loop over motions":  # nobody catches it
        assert code not in (0, 7) and "mbrs.errors.Interrupted: the motion of 'chain' was interrupted" in errors, errors
    else:
        assert code == 7, errors


@pytest.mark.slow
def test_the_shell_saves_what_there_is_and_ends_with_130(tmp_path):
    """The file is there, marked as cut, and the exit code tells scripts."""
    (tmp_path / "save.py").write_text(MODEL + f"chain(7).save({str(tmp_path / 'chain.toml')!r})")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    subprocess.run([sys.executable, str(tmp_path / "save.py")], env=env, check=True)
    out = tmp_path / "cut.json"
    command = [
        "-m",
        "mbrs.cli",
        "simulate",
        str(tmp_path / "chain.toml"),
        "--t",
        "1e6",
        "--rtol",
        "1e-9",
        "--out",
        str(out),
    ]
    code, text, errors, _ = interrupted([sys.executable, *command], wait=6.0, MBRS_PROGRESS="0")
    assert code == 130, errors
    assert "interrupted at t = " in errors and "this is the result so far" in errors and "b6.x" in text
    held = mb.load(out)
    assert held.status == "interrupted" and len(held.t) > 1


def test_an_interrupt_pickles_with_its_result():
    cut = pickle.loads(pickle.dumps(mb.Interrupted("cut", result=[1.0, 2.0])))
    assert type(cut) is mb.Interrupted and cut.result == [1.0, 2.0] and str(cut) == "cut"
    assert not isinstance(cut, Exception) and isinstance(cut, KeyboardInterrupt)


def test_other_threads_run_while_the_core_works():
    """The counting thread gets the interpreter during the solve, not only before and after it."""
    n = 350
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
        _core.SecondOrder(system.M, system.C, None, system.K, None).modes()
        inside.clear()
    finally:
        over.set()
        thread.join()
    print(f"the other thread ran {counted[0]} times during the solve")
    assert counted[0] > 10
