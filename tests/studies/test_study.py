"""Studies of accuracy and effects, on integrals with known errors and on stand-ins with known costs."""

from __future__ import annotations

import math
import pickle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mbrs.errors import ConvergenceError, ModelError
from mbrs.results import Result, Stats
from mbrs.studies.accuracy import accuracy_study
from mbrs.studies.effects import effect_study
from mbrs.studies.measures import (
    curve_difference,
    eigenvalue_difference,
    frequency_difference,
    largest_difference,
    measure_for,
)


class _Clock:
    """Stands in for the module `time` in mbrs.studies.timing, so that no test depends on how fast the machine is."""

    now = 0.0

    def perf_counter(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> _Clock:
    made = _Clock()
    monkeypatch.setattr("mbrs.studies.timing.time", made)
    return made


def trapezoid(f: Any, n: int) -> float:
    x = np.linspace(0.0, 1.0, n + 1)
    y = f(x)
    return float((y[:-1] + y[1:]).sum() / (2 * n))


def simpson(f: Any, n: int) -> float:
    x = np.linspace(0.0, 1.0, 2 * n + 1)
    y = f(x)
    return float((y[0:-2:2] + 4 * y[1::2] + y[2::2]).sum() / (6 * n))


def integral(f: Any, method: str = "trapezoid", n: int = 10) -> float:
    return {"trapezoid": trapezoid, "simpson": simpson}[method](f, n)


def test_errors_have_the_order_of_the_method() -> None:
    study = accuracy_study(
        integral, np.exp, method=["trapezoid", "simpson"], n=[10, 20, 40], reference=math.e - 1.0, repeat=1
    )
    error = np.array([p.error for p in study.points]).reshape(2, 3)
    assert np.log2(error[0, :-1] / error[0, 1:]) == pytest.approx(2.0, abs=0.02)
    assert np.log2(error[1, :-1] / error[1, 1:]) == pytest.approx(4.0, abs=0.02)
    # leading term of the trapezoidal rule: h^2/12 (f'(1) - f'(0)), relative to the integral
    assert error[0, 2] == pytest.approx(40.0**-2 / 12.0, rel=1e-3)
    assert [label for label, _ in study.lines()] == ["trapezoid", "simpson"]
    assert study.stats.counts == {"runs": 6}


def test_the_grid_is_spanned_by_lists_arrays_and_dicts_only() -> None:
    seen = []

    def record(**settings: Any) -> float:
        seen.append(settings)
        return 1.0

    accuracy_study(record, repeat=1, reference=1.0, force=[1.0, 2.0], omega=(0.5, 1.6), one=[7], text="ab",
                   n=[1, 2], rtol=10.0 ** -np.arange(3, 5), scheme={"a": "x", "b": "y"})  # fmt: skip
    assert len(seen) == 8
    assert all(s["force"] == [1.0, 2.0] and s["omega"] == (0.5, 1.6) and s["one"] == [7] for s in seen)
    assert [(s["n"], s["rtol"], s["scheme"]) for s in seen[:3]] == [(1, 1e-3, "x"), (1, 1e-3, "y"), (1, 1e-4, "x")]
    assert all(type(s["rtol"]) is float for s in seen)


def test_vary_spans_a_vector_argument_and_dicts_set_several_keywords() -> None:
    seen = []

    def record(**settings: Any) -> float:
        seen.append(settings)
        return 1.0

    study = accuracy_study(
        record, repeat=1, reference=1.0, vary=("t",), t=[1.0, 2.0], setup={"coarse": {"a": 1, "b": 2}, "fine": {"a": 3}}
    )
    assert seen == [{"t": 1.0, "a": 1, "b": 2}, {"t": 1.0, "a": 3}, {"t": 2.0, "a": 1, "b": 2}, {"t": 2.0, "a": 3}]
    assert study.points[1].settings == {"t": "1", "setup": "fine"}


@pytest.mark.parametrize(
    ("settings", "reference"),
    [
        ({"n": [40, 10, 20]}, {"n": "40"}),
        ({"rtol": [1e-3, 1e-9, 1e-6]}, {"rtol": "1e-09"}),
        ({"n": [1, 2], "step": [0.1, 0.2]}, {"n": "2", "step": "0.1"}),
    ],
)
def test_the_self_made_reference_is_the_finest_setting(settings: dict[str, Any], reference: dict[str, str]) -> None:
    study = accuracy_study(lambda **one: float(sum(one.values())), repeat=1, **settings)
    chosen = [p for p in study.points if p.is_reference]
    assert [dict(p.settings) for p in chosen] == [reference]
    assert math.isnan(chosen[0].error) and "self-made" in study.reference


def test_methods_that_agree_outvote_one_that_does_not() -> None:
    values = {"good": 1.0, "also": 1.0 + 1e-9, "third": 1.0 - 1e-9, "wrong": 2.0}
    study = accuracy_study(lambda method: values[method], method=list(values), repeat=1)
    chosen = next(p for p in study.points if p.is_reference)
    assert chosen.settings["method"] == "good" and "agree" in study.reference
    assert next(p for p in study.points if p.settings["method"] == "wrong").error == pytest.approx(1.0)


def test_own_error_estimates_choose_among_methods() -> None:
    results = {"a": SimpleNamespace(value=1.0, error=1e-3), "b": SimpleNamespace(value=1.1, error=[1e-6, np.nan])}
    study = accuracy_study(lambda method: results[method], method=["a", "b"], repeat=1)
    assert next(p for p in study.points if p.is_reference).settings["method"] == "b"
    assert [p.estimate for p in study.points] == [1e-3, 1e-6]


def test_failures_are_recorded_and_bugs_are_not_hidden() -> None:
    def run(n: int) -> float:
        if n == 2:
            raise ConvergenceError("no luck at n = 2")
        if n == 99:
            raise ZeroDivisionError
        return 1.0 / n

    study = accuracy_study(run, n=[1, 2, 4], repeat=2)
    assert study.points[1].status == "failed: no luck at n = 2" and math.isnan(study.points[1].error)
    assert study.status == "stopped" and "no luck" in str(study)
    with pytest.raises(ZeroDivisionError):
        accuracy_study(run, n=[1, 99])
    with pytest.raises(ModelError, match=r"no setting of the study worked.*no luck"):
        accuracy_study(run, n=2, other={"x": {"n": 2}, "y": {"n": 2}})


def _study_with(points: list[tuple[float, float]]) -> Any:
    """A study whose times are given, not measured."""
    study = accuracy_study(lambda n: float(n), n=list(range(1, len(points) + 1)), reference=1.0, repeat=1)
    for point, (spent, error) in zip(study.points, points, strict=True):
        object.__setattr__(point, "time", spent)
        object.__setattr__(point, "error", error)
    return study


def test_recommendation_is_the_cheapest_that_is_good_enough_and_says_why() -> None:
    study = _study_with([(1.0, 1e-2), (3.0, 1e-6), (2.0, 5e-6), (9.0, 1e-12)])
    best = study.recommend(error=1e-5)
    assert best.settings == {"n": 3} and best.reached and best.time == 2.0
    assert str(best) == (
        "n=3: error 5.0e-06 in 2 s; the cheapest of 3 settings within 1.0e-05, the next (n=2) takes 1.5 times as long"
    )
    assert study.recommend(error=1e-13).reached is False
    assert "no setting reaches 1.0e-13; the most accurate is n=4" in str(study.recommend(1e-13))
    assert "the only one of 4" in str(study.recommend(1e-11))


@pytest.mark.parametrize("error", [0.0, -1.0, math.nan, math.inf, "1e-3", None])
def test_recommend_wants_a_positive_number(error: Any) -> None:
    with pytest.raises(ModelError, match="must be a positive number"):
        _study_with([(1.0, 1e-3)] * 2).recommend(error)


def test_bad_arguments_are_named() -> None:
    with pytest.raises(ModelError, match="no setting spans the grid"):
        accuracy_study(integral, np.exp, n=10)
    with pytest.raises(ModelError, match="'n' is empty"):
        accuracy_study(integral, np.exp, n=[])
    with pytest.raises(ModelError, match="repeat=0"):
        accuracy_study(integral, np.exp, n=[1, 2], repeat=0)
    with pytest.raises(ModelError, match=r"vary names \['q'\]"):
        accuracy_study(integral, np.exp, n=[1, 2], vary=("q",))
    with pytest.raises(ModelError, match="no default measure for dict"):
        accuracy_study(lambda n: {"n": n}, n=[1, 2])


def test_time_is_the_best_of_the_repeats(clock: _Clock) -> None:
    waits = iter([5.0, 1.0, 5.0, 4.0, 5.0, 3.0])

    def run(n: int) -> float:
        clock.now += next(waits)
        return float(n)

    study = accuracy_study(run, n=[1, 2], repeat=3, reference=1.0)
    assert [p.time for p in study.points] == [1.0, 3.0]
    assert study.stats.wall_time == 23.0


def test_study_prints_saves_plots_and_becomes_labelled_data(tmp_path: Any) -> None:
    study = accuracy_study(
        integral, np.exp, method=["trapezoid", "simpson"], n=[10, 20], reference=math.e - 1, repeat=1
    )
    text = str(study)
    assert "trapezoid" in text and "8.3e-04" in text and "the given value 1.71828" in text
    assert study._repr_html_().count("<tr>") == 5
    assert pickle.loads(study.save(tmp_path / "study.pkl").read_bytes()).points[3].error == study.points[3].error
    data = pytest.importorskip("xarray") and study.to_xarray()
    assert data["method"].values.tolist() == ["trapezoid"] * 2 + ["simpson"] * 2
    assert data["error"].values == pytest.approx([p.error for p in study.points])


def test_accuracy_plot_draws_a_line_per_method_and_shows_exact_runs() -> None:
    pytest.importorskip("matplotlib")
    study = _study_with([(1.0, 1e-2), (2.0, 1e-6), (3.0, 0.0)])
    axes = study.plot().axes[0]
    assert axes.get_xscale() == axes.get_yscale() == "log"
    line = axes.get_lines()[0]
    assert line.get_xdata() == pytest.approx([1, 2, 3]) and line.get_ydata()[:2] == pytest.approx([1e-2, 1e-6])
    assert 0.0 < line.get_ydata()[2] < 1e-6 and axes.get_lines()[1].get_markerfacecolor() == "white"


# --- measures


def _modes(frequency: Any) -> SimpleNamespace:
    return SimpleNamespace(frequency=np.array(frequency, dtype=float), eigenvalue=1j * np.array(frequency))


def test_modes_are_compared_by_their_lowest_frequencies() -> None:
    assert measure_for(_modes([1.0])) is frequency_difference
    assert frequency_difference(_modes([1.0, 2.0]), _modes([1.0, 2.002, 5.0])) == pytest.approx(0.002 / 2.002)
    # a rigid mode that came out at 1e-6 Hz counts relative to the lowest elastic one
    assert frequency_difference(_modes([1e-6, 2.0]), _modes([0.0, 2.0])) == pytest.approx(5e-7)
    assert math.isnan(frequency_difference(_modes([np.nan, 2.0]), _modes([1.0, 2.0])))


def test_eigenvalues_see_damping_and_do_not_mind_the_order() -> None:
    a, b = _modes([1.0, 2.0]), _modes([1.0, 2.0])
    b.eigenvalue = np.array([2j, -0.1 + 1j])
    assert eigenvalue_difference(a, b) == pytest.approx(0.1 / abs(-0.1 + 1j))
    assert eigenvalue_difference(a, _modes([2.0, 1.0])) == 0.0
    assert eigenvalue_difference(a, _modes([1.0, 2.0, 4.0])) == pytest.approx(0.5)
    assert eigenvalue_difference(_modes([0.01, 2.0]), _modes([0.0, 2.0])) == pytest.approx(0.005)


def test_transfer_functions_are_compared_at_the_same_points() -> None:
    def frf(value: Any, frequency: Any) -> SimpleNamespace:
        return SimpleNamespace(value=np.array(value), frequency=np.array(frequency))

    a, b = frf([[[1.0, 2j]]], [1.0, 2.0]), frf([[[1.0, 4j]]], [1.0, 2.0])
    assert measure_for(a) is largest_difference and largest_difference(a, b) == pytest.approx(0.5)
    with pytest.raises(ModelError, match="different frequency"):
        largest_difference(a, frf([[[1.0, 2j]]], [1.0, 3.0]))
    with pytest.raises(ModelError, match="same points"):
        largest_difference(a, frf([[[1.0]]], [1.0]))


def test_response_curves_are_compared_by_their_peak() -> None:
    def curve(sizes: Any, omega: Any) -> SimpleNamespace:
        return SimpleNamespace(X=np.array(sizes, dtype=float)[:, None, None], omega=np.array(omega))

    a, b = curve([1.0, 3.0, 2.0], [1.0, 2.0, 3.0]), curve([1.0, 2.0, 4.0, 1.0], [1.0, 1.5, 2.5, 3.0])
    assert measure_for(a) is curve_difference and curve_difference(a, b) == pytest.approx(0.25)


# --- effects


class _Modes(Result):
    """A result whose work can be counted."""

    def __init__(self, frequency: list[float], counts: dict[str, int]) -> None:
        super().__init__(stats=Stats(counts=counts))
        object.__setattr__(self, "frequency", np.array(frequency))
        object.__setattr__(self, "eigenvalue", 1j * self.frequency)


def _analysis(model: Any, scale: float = 1.0, without: tuple[str, ...] = ()) -> _Modes:
    if "gravity" in without:
        raise ConvergenceError("needs gravity")
    _analysis.clock.now += 0.2 if "damping" in without else 1.0  # type: ignore[attr-defined]
    value = scale * (1.1 if "damping" in without else 1.0)
    return _Modes([value, 3.0], {"damping matrices": 0 if "damping" in without else 1, "eigensolutions": 1})


@pytest.fixture
def listed_effects(monkeypatch: pytest.MonkeyPatch, clock: _Clock) -> None:
    _analysis.clock = clock  # type: ignore[attr-defined]
    listed = [
        SimpleNamespace(name="gravity", on=True, why="given"),
        SimpleNamespace(name="gyroscopic", on=True, why="turns"),
        SimpleNamespace(name="damping", on=True, why="c"),
        SimpleNamespace(name="friction", on=False, why="none"),
    ]
    monkeypatch.setattr("mbrs.studies.effects.effects", lambda model: listed)


@pytest.mark.usefixtures("listed_effects")
def test_effect_study_measures_change_cost_and_work() -> None:
    study = effect_study(_analysis, "model", scale=2.0)
    assert [row.effect for row in study.runs] == ["damping", "gyroscopic", "gravity"]
    damping, gyroscopic, gravity = study.runs
    assert (
        damping.change == pytest.approx(0.1)
        and damping.fewer == {"damping matrices": -1}
        and damping.saved == pytest.approx(0.8)
    )
    assert gyroscopic.change == 0.0 and gyroscopic.fewer == {}
    assert math.isnan(gravity.change) and gravity.status == "failed: needs gravity"
    assert study.stats.counts == {"runs": 13}
    text = str(study)
    assert "-1 damping matrices" in text and "needs gravity" in text and "friction" not in text


@pytest.mark.usefixtures("listed_effects")
def test_effects_that_are_off_stay_off() -> None:
    study = effect_study(_analysis, "model", without=("damping",), effects=["damping", "gyroscopic"])
    assert [row.effect for row in study.runs] == ["gyroscopic"] and study.runs[0].change == 0.0
    with pytest.raises(ModelError, match=r"fails with all effects on.*needs gravity"):
        effect_study(_analysis, "model", without=("gravity",))


@pytest.mark.usefixtures("listed_effects")
def test_effect_study_plots() -> None:
    pytest.importorskip("matplotlib")
    left, right = effect_study(_analysis, "model").plot().axes
    assert [t.get_text() for t in left.get_yticklabels()] == ["damping", "gyroscopic"]
    assert left.get_xlabel().startswith("change") and right.get_xlabel() == "time saved [%]"
