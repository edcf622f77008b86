"""The folder of a sweep: going on, refusing what is another sweep, one client at a time, damage, full disks, dead processes."""

from __future__ import annotations

import errno
import importlib
import io
import json
import linecache
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import mbrs as mb
import numpy as np
import pytest
import sweep_scenes as scenes
from mbrs.design import isolation, store
from mbrs.design.chunk import Task, pack, run, unpacked
from mbrs.design.pools import local_scene
from test_sweep import bits

N = 24
CALLS: list[int] = []


def counted(m):
    CALLS.append(int(m.value("mark")))
    return scenes.numbers(m)


def forked(function, *arguments):
    """A client in a process of its own, with everything imported already."""
    process = multiprocessing.get_context("fork").Process(target=function, args=arguments, daemon=False)
    process.start()
    return process


def test_the_same_call_goes_on_where_it_was(tmp_path):
    m, designs = scenes.model(), scenes.designs(N)
    CALLS.clear()
    first = mb.sweep(m, designs, counted, store=tmp_path / "runs", n=7, chunk=3)
    assert list(range(7)) == CALLS and first.states.tolist() == ["done"] * 7 + ["waiting"] * (N - 7)
    m.set({"k": 7.7})  # every design sets it anyway
    whole = mb.sweep(m, designs, counted, store=str(tmp_path / "runs"), chunk=5)
    assert list(range(N)) == CALLS and bits(whole) == bits(mb.sweep(m, designs, scenes.numbers))
    again = mb.sweep(m, designs, counted, store=tmp_path / "runs")
    assert len(CALLS) == N and bits(again) == bits(whole) and np.array_equal(again.seconds, whole.seconds)
    names = sorted(p.name for p in (tmp_path / "runs").iterdir())
    assert names[0] == "chunk-0000000000-00000003.npz" and {"designs.npy", "lock", "sweep.json"} < set(names)
    assert np.array_equal(np.load(tmp_path / "runs" / "designs.npy"), designs.values)
    kept = json.loads((tmp_path / "runs" / "sweep.json").read_text())
    assert kept["names"] == ["k", "b.mass", "mark"] and len(kept["hash"]) == 64


def test_another_sweep_is_refused_with_what_differs(tmp_path):
    m, designs = scenes.model(), scenes.designs(N)
    mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs", n=3)
    before = {p.name: p.read_bytes() for p in (tmp_path / "runs").iterdir() if p.name != "lock"}

    def refused(model, designs, outputs):
        with pytest.raises(mb.StoreError, match="take another folder") as problem:
            mb.sweep(model, designs, outputs, store=tmp_path / "runs")
        return str(problem.value)

    other = scenes.model()
    other.set({"rail.c": 0.73})
    text = refused(other, designs, scenes.numbers)
    assert "another model" in text and "0.61" in text and "c = 0.73" in text
    text = refused(m, scenes.designs(N + 1), scenes.numbers)
    assert "another designs" in text and "- 24 designs" in text and "+ 25 designs" in text
    assert "of other values" in refused(m, scenes.designs(N, seed=4), scenes.numbers)
    text = refused(m, designs, scenes.slow)
    assert "another outputs" in text and "slow" in text
    text = refused(m, designs, mb.outputs.modes())
    assert "another outputs" in text and "modes" in text
    assert before == {p.name: p.read_bytes() for p in (tmp_path / "runs").iterdir() if p.name != "lock"}


def test_a_function_is_known_by_what_it_does(tmp_path, monkeypatch):
    """Also through a constant and a function of its module; comments and layout do not count."""
    text = (
        "FACTOR = 2.0\ndef inner(x):\n    return x * FACTOR\ndef outputs(m):\n    return {'x': inner(m.value('k'))}\n"
    )
    same = (
        "# a remark\nFACTOR = 2.0\n\ndef inner(x):\n    # another\n    return x*FACTOR\n"
        "def outputs(m):\n  return {'x': inner(m.value('k'))}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)

    def outputs(source, i):
        (tmp_path / f"module{i}.py").write_text(source)
        module = __import__(f"module{i}")
        module.outputs.__module__ = module.inner.__module__ = "module"
        return module.outputs

    m, designs = scenes.model(), scenes.designs(3)
    mb.sweep(m, designs, outputs(text, 0), store=tmp_path / "runs")
    mb.sweep(m, designs, outputs(same, 1), store=tmp_path / "runs")
    for i, changed in enumerate((text.replace("2.0", "3.0"), text.replace("x * FACTOR", "x + FACTOR"))):
        with pytest.raises(mb.StoreError, match="another outputs"):
            mb.sweep(m, designs, outputs(changed, 2 + i), store=tmp_path / "runs")


def test_functions_without_source_are_known_by_their_code(tmp_path):
    def outputs(text):
        space = {"__name__": "made"}
        exec(text, space)
        return space["outputs"]

    m, designs = scenes.model(), scenes.designs(3)
    text = "def outputs(m):\n    return {'x': m.value('k') * 2.0}\n"
    mb.sweep(m, designs, outputs(text), store=tmp_path / "runs")
    mb.sweep(m, designs, outputs(text), store=tmp_path / "runs")
    with pytest.raises(mb.StoreError, match="another outputs"):
        mb.sweep(m, designs, outputs(text.replace("2.0", "3.0")), store=tmp_path / "runs")


def waits(m):
    (Path(os.environ["SWEEP_STORE"]) / "ready").touch()
    time.sleep(60.0)
    return {}


def client_that_waits(folder):
    mb.sweep(scenes.model(), scenes.designs(N), waits, store=folder)


def test_a_second_client_is_refused_while_the_first_one_runs(tmp_path, monkeypatch):
    folder = tmp_path / "runs"
    monkeypatch.setenv("SWEEP_STORE", str(folder))
    first = forked(client_that_waits, folder)
    while not (folder / "ready").exists():
        assert first.is_alive()
        time.sleep(0.01)
    with pytest.raises(mb.StoreError, match=f"in use by process {first.pid} on "):
        mb.sweep(scenes.model(), scenes.designs(N), scenes.numbers, store=folder)
    first.kill()
    first.join()
    # the lock is gone with the process
    with pytest.raises(mb.StoreError, match="another outputs"):
        mb.sweep(scenes.model(), scenes.designs(N), scenes.numbers, store=folder)


NESTED: list[str] = []


def sweeps_itself(m):
    try:
        mb.sweep(scenes.model(), scenes.designs(N), sweeps_itself, store=os.environ["SWEEP_STORE"])
    except mb.StoreError as problem:
        NESTED.append(str(problem))
    return scenes.numbers(m)


def test_a_second_sweep_of_the_same_process_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("SWEEP_STORE", str(tmp_path / "runs"))
    NESTED.clear()
    runs = mb.sweep(scenes.model(), scenes.designs(2), sweeps_itself, store=tmp_path / "runs")
    assert runs.done.all() and len(NESTED) == 2 and "another sweep of this process" in NESTED[0]


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "other", "text"])
def test_damaged_chunks_are_named_and_computed_again(tmp_path, damage):
    m, designs = scenes.model(), scenes.designs(N)
    whole = mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs", chunk=8)
    path = tmp_path / "runs" / "chunk-0000000008-00000008.npz"
    data = path.read_bytes()
    middle = data.index(b"flat0") + 200
    changed = {
        "cut": data[: len(data) // 2],
        "flipped": data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :],
        "empty": b"",
        "other": (tmp_path / "runs" / "chunk-0000000000-00000008.npz").read_bytes(),
        "text": b"not an archive",
    }[damage]
    path.write_bytes(changed)
    with pytest.warns(mb.errors.MbrsWarning, match="computed again"):
        again = mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs")
    assert bits(again) == bits(whole)


def test_mutated_chunks_never_give_wrong_numbers():
    """Any change of a file is an error of mbrs, or leaves what is read as it was."""
    scene = local_scene(scenes.model(), scenes.awkward)
    chunk = run(Task(scene, ("k", "b.mass", "mark"), 0, scenes.designs(12).values))
    file, rng = io.BytesIO(), random.Random(1)
    pack(chunk, file)
    data = file.getvalue()
    wanted = {name: c.flat.tobytes() for name, c in chunk.columns.items()}
    for _ in range(300):
        cut = bytearray(data)
        for _ in range(rng.randint(1, 4)):
            cut[rng.randrange(len(cut))] = rng.randrange(256)
        try:
            found = unpacked(io.BytesIO(cut[: rng.choice([len(cut), rng.randrange(len(cut))])]))
        except mb.ModelError:
            continue
        assert {name: c.flat.tobytes() for name, c in found.columns.items()} == wanted


def test_a_damaged_or_foreign_sweep_json_is_refused(tmp_path):
    m, designs = scenes.model(), scenes.designs(3)
    mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs")
    path = tmp_path / "runs" / "sweep.json"
    text = path.read_text()
    for bad, message in (
        (text[:99], "damaged"),
        ("[]", "damaged"),
        (text.replace('"format": 1', '"format": 9'), "format 9"),
    ):
        path.write_text(bad)
        with pytest.raises(mb.StoreError, match=message):
            mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs")
    path.unlink()
    with pytest.raises(mb.StoreError, match=r"no sweep\.json"):
        mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs")
    (tmp_path / "file").write_text("")
    with pytest.raises(mb.StoreError, match="cannot use the folder"):
        mb.sweep(m, designs, scenes.numbers, store=tmp_path / "file")
    other = json.loads(text)
    other["versions"]["mbrs"] = "0.0.1"
    path.write_text(json.dumps(other))
    with pytest.warns(mb.errors.MbrsWarning, match="was begun with"):
        mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs")


def test_a_full_disk_stops_the_sweep_and_room_lets_it_go_on(tmp_path, monkeypatch):
    m, designs = scenes.model(), scenes.designs(N)
    real, written = os.fsync, []

    def full(descriptor):
        written.append(descriptor)
        if len(written) > 11:  # files and folders: two files of the sweep, then chunks
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr("mbrs._lib.files.os.fsync", full)
        with pytest.raises(mb.StoreError, match="No space left on device; the same call goes on") as stopped:
            mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs", chunk=4)
    assert 4 < stopped.value.result.done.sum() < N and not list((tmp_path / "runs").glob(".*.tmp"))
    whole = mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs", chunk=4)
    assert bits(whole) == bits(mb.sweep(m, designs, scenes.numbers))
    with monkeypatch.context() as patch:
        patch.setattr("mbrs._lib.files.os.fsync", lambda _: full(0))
        with pytest.raises(mb.StoreError, match="cannot use the folder"):
            mb.sweep(m, designs, scenes.numbers, store=tmp_path / "new")


def killed_as_expected(runs, dead):
    assert [f.design for f in runs.failed] == dead and set(runs.failures.reason) == {"killed"}
    assert "signal 6" in runs.failures.message[0] and runs.done.sum() == len(runs) - len(dead)
    whole = mb.sweep(scenes.model(), scenes.designs(len(runs)), scenes.numbers)
    for name, array in runs.outputs.items():
        assert np.array_equal(array[runs.done], whole.outputs[name][runs.done])


def test_designs_that_end_their_process_are_found_by_a_pool_in_the_same_run(tmp_path):
    with ProcessPoolExecutor(2) as pool:
        runs = mb.sweep(
            scenes.model(), scenes.designs(N), scenes.aborts, executor=pool, store=tmp_path / "runs", chunk=8
        )
    killed_as_expected(runs, [5, 17])


def client_that_aborts(folder, executor):
    mb.sweep(scenes.model(), scenes.designs(N), scenes.aborts, executor=executor, store=folder, chunk=6)


@pytest.mark.some(1)
@pytest.mark.parametrize("executor", [None, 2])
def test_designs_that_end_the_client_are_found_by_the_next_call(tmp_path, executor):
    folder = tmp_path / "runs"
    for _ in range(2):  # the first process dies at 5; the second one finds it, and dies at 17
        client = forked(client_that_aborts, folder, executor)
        client.join(60)
        assert client.exitcode == -signal.SIGABRT and list(folder.glob("begun-*"))
    runs = mb.sweep(scenes.model(), scenes.designs(N), scenes.aborts, executor=executor, store=folder)
    killed_as_expected(runs, [5, 17])
    assert not list(folder.glob("begun-*"))


def test_a_design_that_does_not_answer_is_ended_with_its_process(monkeypatch):
    monkeypatch.setattr(isolation, "GRACE", 0.3)
    scene = local_scene(scenes.model(), scenes.hangs_deaf)
    designs = scenes.designs(4)
    chunks = list(isolation.examine(Task(scene, designs.names, 0, designs.values, 0.05)))
    assert sorted((c.first, c.status.tolist()) for c in chunks) == [(0, [0, 0]), (2, [2]), (3, [0])]


@pytest.mark.slow
def test_a_worker_that_does_not_answer_is_ended_by_its_pool(monkeypatch):
    monkeypatch.setattr(isolation, "GRACE", 0.3)
    # a first call of a process that starts takes longer than a design
    with ProcessPoolExecutor(2) as pool:
        runs = mb.sweep(scenes.model(), scenes.designs(8), scenes.hangs_deaf, executor=pool, time_limit=1.0, chunk=2)
    assert runs.states.tolist() == ["done"] * 2 + ["timeout"] + ["done"] * 5
    assert "did not answer" in runs.failures.message[0]


def test_a_mark_alone_condemns_no_design(tmp_path):
    """A client that somebody killed leaves marks; its designs are computed as ever."""
    m, designs = scenes.model(), scenes.designs(N)
    mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs", n=6)
    for first, n in ((6, 1), (7, 5)):
        (tmp_path / "runs" / store._mark(first, n)).touch()
    runs = mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs")
    assert bits(runs) == bits(mb.sweep(m, designs, scenes.numbers)) and not list((tmp_path / "runs").glob("begun-*"))


def client_of(kind, folder, n):
    os.setpgid(0, 0)
    executor = {"here": None, "threads": 2}.get(kind) if kind != "processes" else ProcessPoolExecutor(2)
    mb.sweep(scenes.model(), scenes.designs(n), scenes.slow, executor=executor, store=folder, chunk=4)


def wait_for(client, folder, chunks):
    """Until the client has written so many chunks."""
    while len(list(folder.glob("chunk*"))) < chunks:
        assert client.is_alive()
        time.sleep(0.001)


def end(client):
    """Kill a client and what it started."""
    os.killpg(client.pid, signal.SIGKILL)
    client.join()
    assert client.exitcode == -signal.SIGKILL


@pytest.mark.exact
@pytest.mark.parametrize(
    ("kind", "deaths"),
    [
        ("processes", 2),
        *(pytest.param(kind, n, marks=pytest.mark.slow) for kind, n in (("processes", 6), ("here", 7), ("threads", 7))),
    ],
)
def test_killed_clients_leave_bit_identical_results(tmp_path, kind, deaths):
    """20 deaths in all over the three kinds, at random moments."""
    folder, rng, n = tmp_path / "runs", random.Random(kind), 200
    for _ in range(deaths):
        before = len(list(folder.glob("chunk*")))
        client = forked(client_of, kind, folder, n)
        wait_for(client, folder, before + rng.randint(1, 3))
        time.sleep(rng.uniform(0.0, 0.02))
        end(client)
    some = mb.sweep(scenes.model(), scenes.designs(n), scenes.slow, store=folder, n=0)
    assert some.done.any() and not some.done.all() and not some.failed
    runs = mb.sweep(scenes.model(), scenes.designs(n), scenes.slow, store=folder)
    assert runs.done.all()
    assert bits(runs) == bits(mb.sweep(scenes.model(), scenes.designs(n), scenes.numbers))


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="finds processes through /proc")
def test_workers_leave_with_the_client_that_was_killed(tmp_path):
    """Nobody would take their results, and nothing else would end them."""
    client = forked(client_of, "processes", tmp_path / "runs", 400)
    # every worker has had a chunk
    wait_for(client, tmp_path / "runs", 12)
    workers = [int(pid) for pid in Path(f"/proc/{client.pid}/task/{client.pid}/children").read_text().split()]
    client.kill()
    client.join()
    assert workers
    deadline = time.monotonic() + 60.0
    while any(Path(f"/proc/{pid}/cmdline").exists() for pid in workers):
        assert time.monotonic() < deadline, "a worker goes on for nobody"
        time.sleep(0.02)


@pytest.mark.exact
def test_killed_workers_leave_bit_identical_results():
    """Processes of a pool die at random moments while they compute: none of their designs is to blame."""
    rng, n = random.Random(7), 80
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(abs, range(4)))
        victims = list(pool._processes)
        ended = subprocess.Popen(
            [sys.executable, "-c", f"import os, time; time.sleep({rng.uniform(0.05, 0.2)}); os.kill({victims[0]}, 9)"]
        )
        runs = mb.sweep(scenes.model(), scenes.designs(n), scenes.slow, executor=pool, chunk=4)
        ended.wait()
    assert runs.done.all()
    assert bits(runs) == bits(mb.sweep(scenes.model(), scenes.designs(n), scenes.numbers))


def test_functions_of_the_model_belong_to_the_sweep(tmp_path, monkeypatch):
    """A model that is given another body of a function of the same name is another model."""
    monkeypatch.syspath_prepend(tmp_path)
    text = "import numpy as np\n\n\ndef wave(t):\n    return 0.1 * np.sin({} * t)  # {}\n"

    def made(rate, comment=""):
        (tmp_path / "waves_of_a_test.py").write_text(text.format(rate, comment))
        sys.modules.pop("waves_of_a_test", None)
        importlib.invalidate_caches()
        linecache.clearcache()
        m = scenes.model()
        other = m.body("driven", mass=1.0, inertia=(1, 1, 1), at=(1, 2, 3))
        m.drive(
            "drive",
            m.prismatic("guide", m.ground, other, at=(1, 2, 3), axis="x"),
            importlib.import_module("waves_of_a_test").wave,
        )
        return m

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    designs = scenes.designs(3)
    mb.sweep(made(3.0), designs, scenes.numbers, store=tmp_path / "runs")
    mb.sweep(made(3.0, "a comment"), designs, scenes.numbers, store=tmp_path / "runs")
    with pytest.raises(mb.StoreError, match="waves_of_a_test:wave"):
        mb.sweep(made(4.0), designs, scenes.numbers, store=tmp_path / "runs")
