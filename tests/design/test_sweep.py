"""Sweeps: the same bits in every way of computing, failures as data, outputs of any shape."""

from __future__ import annotations

import os
import pickle
import signal
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import mbrs as mb
import numpy as np
import pytest
import sweep_scenes as scenes
from mbrs.design.chunk import Chunk
from mbrs.design.client import CHUNK_SECONDS, LARGEST_CHUNK, PILOT, Sizes
from mbrs.design.store import Store
from scipy import stats

N = 60


def bits(runs):
    """Everything of the runs that must not depend on how they were computed."""
    arrays = {name: (array.dtype.str, array.shape, array.tobytes()) for name, array in runs.outputs.items()}
    return arrays, runs.codes.tobytes(), [(f.design, f.error, f.object, f.message) for f in runs.failed]


@pytest.fixture(scope="module")
def processes():
    with ProcessPoolExecutor(2) as pool:
        yield pool


@pytest.mark.some(2)
@pytest.mark.exact
@pytest.mark.parametrize("outputs", [scenes.numbers, scenes.frequency, scenes.awkward, mb.outputs.modes(1, ["k"])])
def test_bits_do_not_depend_on_executor_order_or_chunks(outputs, processes, tmp_path):
    m, designs = scenes.model(), scenes.designs(N)
    plain = mb.sweep(m, designs, outputs)
    rng = np.random.default_rng(5)
    with ThreadPoolExecutor(2) as threads:
        for executor, chunk in ((None, 1), (None, 7), (3, 5), (threads, 13), (processes, 11)):
            assert bits(mb.sweep(m, designs, outputs, executor=executor, chunk=chunk)) == bits(plain)
    mb.sweep(m, designs, outputs, store=tmp_path / "some", chunk=9, n=23)
    again = mb.sweep(m, designs, outputs, store=tmp_path / "some", chunk=4, executor=2)
    assert bits(again) == bits(plain)
    order = rng.permutation(N)
    turned = mb.sweep(m, designs.part(order), outputs)
    for name, array in plain.outputs.items():
        assert turned.outputs[name].tobytes() == array[order].tobytes()


def test_outputs_are_those_of_each_design_alone():
    m, designs = scenes.model(), scenes.designs(20)
    before = mb.Model.copy(m).value("k")
    runs = mb.sweep(m, designs, scenes.frequency)
    # one body on a spring: f = sqrt(k/m) / 2 pi
    exact = np.sqrt(designs["k"] / designs["b.mass"]) / (2 * np.pi)
    assert runs["f"][:, 0] == pytest.approx(exact, rel=1e-11) and np.array_equal(runs["f[0]"], runs["f"][:, 0])
    assert m.value("k") == before and runs.done.all() and runs.status == "computed" and not len(runs.failures)


@pytest.mark.filterwarnings("ignore:the frequency points miss")
def test_named_outputs_equal_closed_forms_with_their_derivatives():
    m, designs = scenes.model(), scenes.designs(9)
    runs = mb.sweep(m, designs, mb.outputs.modes(sensitivities=["k", "b.mass"]))
    k, mass = designs["k"], designs["b.mass"]
    f = np.sqrt(k / mass) / (2 * np.pi)
    assert runs["frequency[0]"] == pytest.approx(f, rel=1e-11)
    assert runs["damping[0]"] == pytest.approx(0.61 / (2 * np.sqrt(k * mass)), rel=1e-9)
    assert runs["frequency_derivative[0,0]"] == pytest.approx(0.5 * f / k, rel=1e-9)
    assert runs["frequency_derivative[0,1]"] == pytest.approx(-0.5 * f / mass, rel=1e-9)
    data = runs.to_xarray()
    assert data.frequency.dims == ("design", "mode") and data.frequency.attrs["units"] == "Hz"
    assert data.frequency_derivative.sel(parameter="k").shape == (9, 1)

    h = mb.sweep(m, designs, mb.outputs.frf("b.force.x", "b.motion.y", [0.7, 1.9], sensitivities=["k"]))
    s = 2j * np.pi * np.array([0.7, 1.9])
    axis = np.array(scenes.AXIS) / np.linalg.norm(scenes.AXIS)
    stiffness = mass[:, None] * s**2 + 0.61 * s + k[:, None]
    assert h["H"][:, 0, 0] == pytest.approx(axis[0] * axis[1] / stiffness, rel=1e-9)
    assert h["H_derivative"][:, 0, 0, :, 0] == pytest.approx(-axis[0] * axis[1] / stiffness**2, rel=1e-9)
    assert h.to_xarray().frequency.values.tolist() == [0.7, 1.9]

    m.gravity = (0.0, 0.0, -9.81)
    rest = mb.sweep(m, designs, mb.outputs.equilibrium(["k"]))
    along = -9.81 * axis[2] * mass / k
    assert rest["position"][:, 0] == pytest.approx(along[:, None] * axis, rel=1e-9)
    assert rest["position_derivative"][:, 0, :, 0] == pytest.approx((-along / k)[:, None] * axis, rel=1e-9)
    both = mb.outputs.sensitivity(mb.outputs.equilibrium(), ["k"])
    assert both == mb.outputs.equilibrium(["k"])


def test_arrays_of_changing_size_and_kind_are_filled_and_wrong_ones_fail():
    designs = scenes.designs(40)
    runs = mb.sweep(scenes.model(), designs, scenes.awkward, chunk=6)
    i = np.arange(40)
    bad, complex_ = i % 7 == 3, (i % 11 == 5) & (i % 7 != 3)
    assert np.array_equal(runs.done, ~bad) and runs["z"].dtype == complex and np.isnan(runs["z"][bad]).all()
    assert np.array_equal(runs["z"][complex_], 1.0 + 1j * designs["k"][complex_])
    assert runs["a"].shape == (40, 3, 2)
    for j in i[~bad & ~complex_]:
        assert np.array_equal(runs["a"][j, : j % 4], np.full((j % 4, 2), designs["b.mass"][j]))
        assert np.isnan(runs["a"][j, j % 4 :]).all() and runs["flag"][j] == (j % 2 == 0)
    assert np.isnan(runs["a"][complex_]).all()


def test_failures_are_data():
    runs = mb.sweep(scenes.model(), scenes.designs(40), scenes.awkward)
    failures = runs.failures
    assert failures.design.tolist() == [i for i in range(40) if i % 7 == 3]
    assert set(failures.error_class) == {"ValueError"} and set(failures.object) == {"rail"}
    assert failures.message[1] == "no luck with 'rail' in design 10" and set(failures.reason) == {"failed"}
    assert "ValueError" in str(failures) and "6 failed" in str(runs) and len(failures.to_frame()) == 6
    with pytest.raises(mb.DesignError, match="design 3: ValueError: no luck") as cut:
        mb.sweep(scenes.model(), scenes.designs(40), scenes.awkward, on_error="raise", chunk=2)
    assert cut.value.design == 3 and cut.value.result.done.tolist()[:4] == [True, True, True, False]
    assert cut.value.result.status == "stopped" and cut.value.result.states[5] == "waiting"


def of_other_shape(m):
    return {"a": np.ones(2) if m.value("mark") == 3 else 1.0}


def of_text(m):
    return {"a": "text"}


def of_nothing(m):
    return None


def exits(m):
    raise SystemExit(3)


@pytest.mark.parametrize("chunk", [1, 4, None])
def test_an_output_that_changes_its_dimensions_fails(chunk):
    runs = mb.sweep(scenes.model(), scenes.designs(6), of_other_shape, chunk=chunk)
    assert (
        runs.done.tolist() == [True, True, True, False, True, True] and runs["a"][4] == 1.0 and np.isnan(runs["a"][3])
    )
    assert runs.failures.error_class.tolist() == ["ShapeError"]


@pytest.mark.parametrize("outputs", [of_text, of_nothing, exits])
def test_outputs_that_are_not_numbers_fail(outputs):
    runs = mb.sweep(scenes.model(), scenes.designs(2), outputs)
    assert set(runs.states) == {"failed"} and not runs.outputs and "none" not in repr(runs)
    assert runs.failures.error_class[0] == ("SystemExit" if outputs is exits else "ModelError")


def test_models_that_cannot_be_pickled_and_closures_run_here_and_in_threads():
    m = scenes.model()
    m.force("push", m["b"], value=lambda t: (1.0, 0.0, t))
    factor = 3.0
    for executor in (None, 2):
        runs = mb.sweep(m, scenes.designs(5), lambda m: {"x": factor * m.value("k")}, executor=executor)
        assert np.array_equal(runs["x"], 3.0 * scenes.designs(5)["k"])


def test_a_worker_gets_the_model_once(processes, monkeypatch):
    """A task of processes is small whatever the model is: it names a file by its hash."""
    sizes = []
    submit = processes.submit
    monkeypatch.setattr(processes, "submit", lambda *a: sizes.append(len(pickle.dumps(a))) or submit(*a))
    m = scenes.model()
    for i in range(200):
        m.parameter(f"more{i}", float(i))
    runs = mb.sweep(m, scenes.designs(12), scenes.numbers, executor=processes, chunk=2)
    assert runs.done.all() and len(sizes) == 6 and max(sizes) < 2000 < len(pickle.dumps(m))


def test_what_cannot_go_to_other_processes_is_named(processes, tmp_path):
    with pytest.raises(mb.ModelError, match="top of a module"):
        mb.sweep(scenes.model(), scenes.designs(5), lambda m: {}, executor=processes)
    with pytest.raises(mb.ModelError, match="made within another"):
        mb.sweep(scenes.model(), scenes.designs(5), lambda m: {}, store=tmp_path / "runs")
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(designs={"k": [1.0]}), "must come from mb.design"),
        (dict(designs=mb.design.from_table({"spring": [1.0]})), "spring"),
        (dict(designs=mb.design.from_table({"b.inertia": [1.0]})), "holds"),
        (dict(designs=mb.design.from_table({"k": [1.0]}, units={"k": "N/mm"})), "N/mm, the model in N/m"),
        (dict(outputs=3), "outputs= must be"),
        (dict(outputs=None), "outputs= is missing"),
        (dict(executor="two"), "executor= must be"),
        (dict(executor=True), "executor= must be"),
        (dict(executor=0), "executor must be an integer"),
        (dict(time_limit=0.0), "time_limit"),
        (dict(on_error="ignore"), "on_error"),
        (dict(chunk=0), "chunk"),
        (dict(n=-1), "n must be"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    given = {"designs": scenes.designs(3), "outputs": scenes.numbers, **arguments}
    with pytest.raises(mb.ModelError, match=message):
        mb.sweep(scenes.model(), given.pop("designs"), given.pop("outputs"), **given)


def test_frequencies_of_named_outputs_are_points():
    with pytest.raises(mb.ModelError, match="range"):
        mb.outputs.frf("b.force.x", "b.motion.x", (1.0, 3.0))


def test_sizes_of_chunks_follow_the_time_of_a_design():
    sizes = Sizes(1)
    assert sizes.size(1000) == PILOT
    sizes.learn(_chunk([0.02] * 4))
    assert sizes.size(10**6) == round(CHUNK_SECONDS / 0.02)
    assert Sizes(1, fixed=17).size(3) == 17
    shared = Sizes(4)
    shared.learn(_chunk([0.02] * 4))
    assert shared.size(80) == 10 and shared.size(1) == 1
    slow = Sizes(2)
    slow.learn(_chunk([300.0]))
    assert slow.size(50) == 1
    quick = Sizes(1)
    quick.learn(_chunk([0.0]))
    assert quick.size(10**9) == LARGEST_CHUNK


def _chunk(seconds):
    n = len(seconds)
    return Chunk(0, np.zeros((n, 1)), np.zeros(n, np.int8), np.array(seconds))


@pytest.mark.parametrize("where", ["here", "threads", "processes"])
def test_a_design_that_takes_too_long_is_cut(where, processes):
    executor = {"here": None, "threads": 2, "processes": processes}[where]
    if where == "threads":  # compiled code, such as one long sleep, is not cut there
        outputs, dead = scenes.spins, [2]
    else:
        outputs, dead = scenes.hangs, [2, 9]
    runs = mb.sweep(scenes.model(), scenes.designs(12), outputs, executor=executor, time_limit=0.2, chunk=4)
    assert runs.failures.design.tolist() == dead and set(runs.failures.reason) == {"timeout"}
    assert "0.2 s" in runs.failures.message[0] and runs.done.sum() == 12 - len(dead)


def simulates(m):
    if m.value("mark") == 1:
        m.force("push", m["b"], value=(1.0, 0.3, 0.2))
        mb.simulate(m, t=1e7, rtol=1e-10)
    return scenes.numbers(m)


def test_a_long_call_of_the_core_is_cut():
    runs = mb.sweep(scenes.model(), scenes.designs(3), simulates, time_limit=0.3)
    assert runs.states.tolist() == ["done", "timeout", "done"]


@pytest.mark.parametrize("executor", [None, 2])
def test_ctrl_c_raises_with_what_there_is_and_the_same_call_goes_on(executor, tmp_path):
    m, designs = scenes.model(), scenes.designs(N)
    with pytest.raises(mb.Interrupted, match=f"of {N} designs") as cut:
        mb.sweep(m, designs, scenes.presses_ctrl_c, executor=executor, store=tmp_path / "runs", chunk=20)
        time.sleep(1.0)  # the signal comes between two lines
    so_far = cut.value.result
    assert so_far.status == "interrupted" and 0 < so_far.done.sum() < N
    if executor is None:
        assert so_far.done.sum() == 13  # every design that was finished
    session = mb.sweep(m, designs, scenes.presses_ctrl_c, store=tmp_path / "runs", n=0)
    assert np.array_equal(session.done, so_far.done)
    assert not list((tmp_path / "runs").glob("begun-*"))
    whole = mb.sweep(m, designs, scenes.numbers)
    for name, array in so_far.outputs.items():
        assert np.array_equal(array[so_far.done], whole.outputs[name][so_far.done])


def test_ctrl_c_between_a_mark_and_its_designs_leaves_no_mark(tmp_path, monkeypatch):
    begin = Store.begin

    def interrupted(store, first, n):
        begin(store, first, n)
        raise KeyboardInterrupt

    monkeypatch.setattr(Store, "begin", interrupted)
    with pytest.raises(mb.Interrupted):
        mb.sweep(scenes.model(), scenes.designs(N), scenes.numbers, store=tmp_path / "runs")
    assert (tmp_path / "runs").is_dir() and not list((tmp_path / "runs").glob("begun-*"))


def test_signal_handlers_are_given_back():
    before = signal.getsignal(signal.SIGALRM)
    mb.sweep(scenes.model(), scenes.designs(3), scenes.numbers, time_limit=5.0)
    assert signal.getsignal(signal.SIGALRM) is before and signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


def test_progress_tells_rate_time_left_and_failures(capfd, monkeypatch):
    mb.sweep(scenes.model(), scenes.designs(40), slow_and_awkward, progress=True)
    text = capfd.readouterr().err
    assert "designs" in text and "/s" in text and "failed" in text and "left" in text
    mb.sweep(scenes.model(), scenes.designs(4), slow_and_awkward, progress=False)
    assert not capfd.readouterr().err


def slow_and_awkward(m):
    time.sleep(0.01)
    return scenes.awkward(m)


def test_results_of_a_whole_sweep_are_in_memory_once(tmp_path):
    m, designs = scenes.model(), scenes.designs(30)
    runs = mb.sweep(m, designs, scenes.numbers, store=tmp_path / "runs", chunk=7)
    for name, array in runs.outputs.items():
        held = [c.flat for chunk in runs.session.chunks for key, c in chunk.columns.items() if key[2:] == name]
        assert len(held) == 5 and all(np.shares_memory(array, flat) for flat in held)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    again = runs.session.runs()
    assert bits(again) == bits(runs) == bits(mb.sweep(m, designs, scenes.numbers, chunk=4))
    # a part of the designs, then the rest: the first result stays as it was
    some = mb.sweep(m, designs, scenes.numbers, n=11, chunk=4)
    before = bits(some)
    some.evaluate(designs)
    assert bits(some) == before


def test_no_designs_and_one_design():
    m = scenes.model()
    none = mb.sweep(m, scenes.designs(1).part(slice(0)), scenes.numbers)
    assert len(none) == 0 and not none.outputs and str(none) and none.to_xarray() is not None
    one = mb.sweep(m, scenes.designs(1), scenes.numbers, executor=2)
    assert one["list"].shape == (1, 3)


def test_names_that_clash_are_told_apart():
    def clash(m):
        return {"k": m.value("k") + 1.0, "state": 3.0, "design": 2, "seconds": 1.0}

    runs = mb.sweep(scenes.model(), scenes.designs(3), clash)
    data = runs.to_xarray()
    assert np.array_equal(data["output k"].values, data["k"].values + 1.0)
    assert {"output state", "output design", "output seconds"} <= set(data)
    assert len(runs.to_frame()) == 3


def test_figures_show_what_was_found():
    designs = mb.design.latin_hypercube({"k": (100.0, 900.0), "b.mass": (0.7, 2.3)}, 50)
    runs = mb.sweep(scenes.model(), designs, scenes.numbers)
    scatter = runs.plot("k", "f")
    assert np.array_equal(np.asarray(scatter.axes[0].collections[0].get_offsets())[:, 1], runs["f"])
    assert scatter.axes[0].get_xlabel() == "k"
    assert len(runs.plot("k", "f", colour="b.mass").axes) == 2
    table = runs.plot()
    texts = [text.get_text() for text in table.axes[0].texts]
    exact = stats.spearmanr(runs["k"], runs["f"]).statistic
    assert texts[0] == f"{exact:.2f}"
    assert len(runs.plot("k", "b.mass", "f", colour="f").axes[0].lines) == 50
    failed = mb.sweep(scenes.model(), scenes.designs(40), scenes.awkward)
    bars = failed.plot(kind="failures").axes[0].patches
    assert [bar.get_width() for bar in bars] == [6]
    with pytest.raises(mb.ModelError, match="not one real number"):
        runs.plot("k", "list")
    with pytest.raises(mb.NameNotFoundError, match="shape"):
        runs.plot("k", "list[3]")
    with pytest.raises(mb.NameNotFoundError, match="have no 'g'"):
        runs["g"]


def test_a_saved_sweep_comes_back(tmp_path):
    runs = mb.sweep(scenes.model(), scenes.designs(40), scenes.awkward)
    for ending in (".json", ".nc"):
        again = mb.load(runs.save(tmp_path / f"runs{ending}"))
        assert bits(again) == bits(runs) and str(again) == str(runs) and again.dims == runs.dims
        with pytest.raises(mb.ModelError, match="came from a file"):
            again.ask(1)


def test_workers_of_the_user_stay_his(processes):
    mb.sweep(scenes.model(), scenes.designs(8), scenes.numbers, executor=processes)
    assert processes.submit(os.getpid).result() != os.getpid()
