"""Ask and tell, and searches that go on where they were: SciPy and optuna."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
import sweep_scenes as scenes
from test_sweep import bits

CALLS: list[dict] = []
NAMES = ("k", "b.mass", "mark")


def counted(m):
    CALLS.append({name: m.value(name) for name in NAMES})
    return scenes.numbers(m)


def computed(point):
    m = scenes.model()
    m.set(point)
    return scenes.numbers(m)


@pytest.mark.parametrize("kept", [False, True])
def test_designs_asked_for_are_told_in_any_order(tmp_path, kept):
    m, designs = scenes.model(), scenes.designs(11)
    folder = tmp_path / "runs" if kept else None
    runs = mb.sweep(m, designs, scenes.numbers, store=folder, n=0)
    assert runs.states.tolist() == ["waiting"] * 11
    first, second = runs.ask(4), runs.ask(5)
    assert np.array_equal(first.values, designs.values[:4]) and np.array_equal(second.values, designs.values[4:9])
    runs = runs.tell(second, [computed(p) for p in second])
    assert runs.done.tolist() == [False] * 4 + [True] * 5 + [False] * 2
    runs = runs.tell(first.values[1:], [computed(p) for p in first][1:], seconds=0.25)
    assert runs.seconds[1] == 0.25 and len(runs.ask(9)) == 2 and len(runs.ask(9)) == 0
    with pytest.raises(mb.ModelError, match="has a result"):
        runs.tell(first.point(2), [computed(first.point(2))])
    runs = runs.tell(designs.point(10), [None])
    assert runs.states[10] == "failed" and "outside" in runs.failures.message[0]
    # what nobody told is computed; a design that is not in the table goes behind it
    new = {"k": 333.0, "b.mass": 1.1, "mark": 77.0}
    runs = runs.tell(new, [computed(new)])
    assert len(runs) == 12 and runs["n"][11] == 77
    if kept:
        runs = mb.sweep(m, designs, scenes.numbers, store=folder)
        assert len(runs) == 12 and runs.done.sum() == 11 and runs["f"][11] == computed(new)["f"]
        rest = runs.designs.part(np.delete(np.arange(12), 10))
        assert np.array_equal(runs["f"][runs.done], mb.sweep(m, rest, scenes.numbers)["f"])


@pytest.mark.parametrize("executor", [None, 2])
def test_what_was_evaluated_is_looked_up(tmp_path, executor):
    m, designs = scenes.model(), scenes.designs(3)
    CALLS.clear()
    runs = mb.sweep(m, designs, counted, store=tmp_path / "runs", executor=executor)
    points = np.array([[500.0, 1.5, 7.0], designs.values[1], [600.0, 1.5, 8.0], [500.0, 1.5, 7.0]])
    found = runs.evaluate(points)
    assert len(CALLS) == 5 and found["n"].tolist() == [7, 1, 8, 7] and np.array_equal(found.designs.values, points)
    again = mb.sweep(m, designs, counted, store=tmp_path / "runs").evaluate(points[::-1])
    assert len(CALLS) == 5 and np.array_equal(again["f"], found["f"][::-1])
    one = runs.evaluate(dict(zip(NAMES, [501.0, 1.5, 9.0], strict=True)))
    assert len(CALLS) == 6 and one["f"].shape == (1,) and len(runs.designs) == 3
    assert bits(runs.evaluate(designs)) == bits(mb.sweep(m, designs, scenes.numbers))


def test_the_bits_of_some_designs_do_not_depend_on_the_others():
    designs = scenes.designs(40)
    runs = mb.sweep(scenes.model(), designs, scenes.awkward, chunk=6, n=30)
    for chosen in ([0, 2, 1], [3, 4], [39, 12, 38], [5, 16], [10, 10]):
        part = designs.part(chosen)
        alone = mb.sweep(scenes.model(), part, scenes.awkward)
        assert bits(runs.evaluate(part))[:2] == bits(alone)[:2]
        assert [f.message for f in alone.failed] == [f.message for f in runs.evaluate(part).failed]


def test_outputs_may_be_computed_elsewhere_altogether():
    runs = mb.sweep(scenes.model(), scenes.designs(3), n=0)
    asked = runs.ask(3)
    runs = runs.tell(asked, [computed(p) for p in asked])
    assert runs.done.all()
    new = runs.evaluate({"k": 1.0, "b.mass": 1.0, "mark": 0.0})
    assert new.states.tolist() == ["failed"] and "no outputs=" in new.failures.message[0]


@pytest.mark.parametrize(
    ("designs", "message"),
    [
        ({"k": 1.0}, "those of the sweep are"),
        ([[1.0, 2.0]], "rows of 3 numbers"),
        ({"k": np.nan, "b.mass": 1.0, "mark": 1.0}, "NaN"),
    ],
)
def test_designs_that_do_not_fit_are_named(designs, message):
    runs = mb.sweep(scenes.model(), scenes.designs(2), scenes.numbers)
    with pytest.raises(mb.ModelError, match=message):
        runs.evaluate(designs)
    with pytest.raises(mb.ModelError, match=r"2 entries for 1"):
        runs.tell([[1.0, 1.0, 1.0]], [None, None])


@pytest.mark.slow
def test_a_search_of_scipy_goes_on_for_nothing(tmp_path):
    from scipy.optimize import differential_evolution

    m = scenes.model()
    bounds = {"k": (100.0, 900.0), "b.mass": (0.7, 2.3)}

    def search(iterations):
        runs = mb.sweep(
            m, mb.design.from_table({name: [] for name in bounds}), counted_frequency, store=tmp_path / "fit"
        )

        def miss(x):
            return (runs.evaluate(x)["f[0]"][0] - 2.7) ** 2 + 1e-3 * (x[1] - 1.0) ** 2

        return differential_evolution(
            miss,
            list(bounds.values()),
            maxiter=iterations,
            popsize=6,
            rng=np.random.default_rng(1),
            polish=False,
            tol=0.0,
        )

    CALLS.clear()
    search(1)
    cut = len(CALLS)
    found = search(8)
    # each design once, although the second search began anew
    kept = mb.sweep(m, mb.design.from_table({name: [] for name in bounds}), counted_frequency, store=tmp_path / "fit")
    assert 12 < cut < len(CALLS) == len(kept) <= found.nfev
    assert len(np.unique(kept.designs.values, axis=0)) == len(kept) and kept.done.all()
    assert np.sqrt(found.x[0] / found.x[1]) / (2 * np.pi) == pytest.approx(2.7, abs=0.2)


def counted_frequency(m):
    CALLS.append({})
    return scenes.frequency(m)


def test_a_study_of_optuna_goes_on_for_nothing(tmp_path):
    optuna = pytest.importorskip("optuna")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    m = scenes.model()

    def search(n):
        runs = mb.sweep(m, mb.design.from_table({"k": [], "b.mass": []}), counted_frequency, store=tmp_path / "fit")

        def miss(trial):
            point = {"k": trial.suggest_float("k", 100.0, 900.0), "b.mass": trial.suggest_float("b.mass", 0.7, 2.3)}
            return abs(runs.evaluate(point)["f[0]"][0] - 2.7)

        study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
        study.optimize(miss, n_trials=n)
        return study

    CALLS.clear()
    search(12)
    study = search(25)
    assert len(CALLS) == 25 and study.best_value < 0.3
