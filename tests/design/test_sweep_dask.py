"""Sweeps on a real local cluster of Dask: loss of a worker, a restart, designs that end their worker."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time

import mbrs as mb
import pytest
import sweep_scenes as scenes
from mbrs.design import pools
from mbrs.design.chunk import Task
from test_sweep import bits

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")
N = 60


# seconds for one test: a cluster that lost its workers may be waited for without end
LIMIT = 240


@contextlib.contextmanager
def limited():
    """Raise in what takes too long."""

    def cut(*_):
        pytest.fail(f"longer than {LIMIT} s")

    old = signal.signal(signal.SIGALRM, cut)
    signal.alarm(LIMIT)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, old)


@pytest.fixture(autouse=True)
def limit():
    with limited():
        yield


@pytest.fixture(scope="module")
def client():
    with (
        # a task may lose two workers before it counts as the reason; the default of three only takes longer
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.mark.exact
def test_a_cluster_gives_the_same_bits(client, tmp_path):
    m, designs = scenes.model(), scenes.designs(N)
    runs = mb.sweep(m, designs, scenes.awkward, executor=client, store=tmp_path / "runs", chunk=7)
    assert bits(runs) == bits(mb.sweep(m, designs, scenes.awkward))
    factor = 3.0  # functions of a script go by value
    runs = mb.sweep(m, designs, lambda m: {"x": factor * m.value("k")}, executor=client)
    assert runs["x"].tolist() == (3.0 * designs["k"]).tolist()


@pytest.mark.slow
@pytest.mark.exact
def test_the_loss_of_a_worker_and_a_restart_change_nothing(client):
    m, designs = scenes.model(), scenes.designs(N)

    def disturb():
        time.sleep(0.3)
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
        time.sleep(0.5)
        client.restart()

    trouble = threading.Thread(target=disturb)
    trouble.start()
    runs = mb.sweep(m, designs, scenes.slower, executor=client, chunk=5)
    trouble.join()
    assert runs.done.all() and bits(runs) == bits(mb.sweep(m, designs, scenes.numbers))


@pytest.mark.slow
def test_a_design_that_takes_too_long_is_cut_on_a_cluster(client):
    runs = mb.sweep(scenes.model(), scenes.designs(6), scenes.spins, executor=client, time_limit=0.3, chunk=3)
    assert runs.failures.design.tolist() == [2] and set(runs.failures.reason) == {"timeout"}


@pytest.mark.slow
def test_a_design_that_ends_its_worker_is_found_in_the_same_run(client):
    runs = mb.sweep(scenes.model(), scenes.designs(24), scenes.aborts, executor=client, chunk=12)
    assert (
        [f.design for f in runs.failed] == [5, 17] and set(runs.failures.reason) == {"killed"} and runs.done.sum() == 22
    )


@contextlib.contextmanager
def one_worker(monkeypatch):
    """A cluster of one worker and its client, which gives up after a second without any."""
    monkeypatch.setattr(pools, "_ASK", 0.2)
    monkeypatch.setattr(pools, "_ALONE", 1.0)
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield cluster, client


@pytest.mark.slow
def test_a_cluster_without_workers_is_not_waited_for(monkeypatch, tmp_path):
    """All workers leave during the sweep: an error in place of an endless wait, and the store holds what came before."""
    m, designs = scenes.model(), scenes.designs(N)
    with one_worker(monkeypatch) as (cluster, alone):
        threading.Timer(1.0, lambda: cluster.scale(0)).start()
        with pytest.raises(mb.RouteError, match="has had no worker for 1 s"):
            mb.sweep(m, designs, scenes.slower, executor=alone, store=tmp_path / "runs", chunk=2)
    runs = mb.sweep(m, designs, scenes.slower, store=tmp_path / "runs")
    assert runs.done.all() and bits(runs) == bits(mb.sweep(m, designs, scenes.numbers))


@pytest.mark.slow
def test_a_result_that_is_lost_with_the_last_worker_is_not_waited_for(monkeypatch):
    """It was computed, but the worker left before the result was fetched: Dask waits for another worker."""
    designs = scenes.designs(4)
    with one_worker(monkeypatch) as (cluster, alone):
        pool = pools.Cluster(alone)
        future = pool.submit(Task(pool.scene(scenes.model(), scenes.numbers), designs.names, 0, designs.values, None))
        assert pool.finished([future]) == [future]
        cluster.scale(0)
        while alone.nthreads():
            time.sleep(0.01)
        with pytest.raises(mb.RouteError, match="has had no worker for 1 s"):
            pool.chunk(future)
        cluster.scale(1)
        alone.wait_for_workers(1, timeout=60)
        assert pool.chunk(future).status.tolist() == [0, 0, 0, 0]


@pytest.mark.slow
def test_a_sweep_says_that_the_workers_left_before_it_fetched_a_result(monkeypatch):
    """The first chunk is computed and lost with the last worker: the sweep names the cluster, and not the outputs."""
    fetch = pools.Cluster.chunk
    with one_worker(monkeypatch) as (cluster, alone):

        def leave_first(pool, future):
            cluster.scale(0)
            while alone.nthreads():
                time.sleep(0.01)
            return fetch(pool, future)

        monkeypatch.setattr(pools.Cluster, "chunk", leave_first)
        with pytest.raises(mb.RouteError, match=r"^the cluster of Dask has had no worker for 1 s"):
            mb.sweep(scenes.model(), scenes.designs(8), scenes.numbers, executor=alone, chunk=2)
