"""Every result: what it declares, how it prints and draws."""

from __future__ import annotations

import dataclasses
import importlib
import re

import every_result
import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import pytest
from every_result import drawn
from mbrs._lib.records import HOMES
from mbrs.io.results import member
from mbrs.results import Result

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")


@pytest.fixture
def results():
    return every_result.made


ALL = pytest.mark.parametrize("name", every_result.MAKE)


def _classes(base=Result):
    for cls in base.__subclasses__():
        yield cls
        yield from _classes(cls)


def test_no_result_class_is_forgotten():
    for name in HOMES:
        member(HOMES, name)
    found = {cls.__name__ for cls in _classes() if cls.__module__.startswith("mbrs.")}
    assert found == {name.split()[0] for name in every_result.MAKE} and found <= set(HOMES)


@ALL
def test_quantities_are_what_they_declare(results, name):
    result = results(name)
    assert type(result).__name__ == name.split()[0]
    for quantity, (dims, value, _, label) in result.labelled().items():
        assert np.ndim(value) == len(dims), f"{quantity} has {dims} and the shape {np.shape(value)}"
        assert label
        for dimension, size in zip(dims, np.shape(value), strict=True):
            labels = result.labels_of(dimension)
            assert labels is None or len(labels) == size, f"{quantity}: {size} along {dimension}, {len(labels)} labels"
    data = result.to_xarray()
    assert data.attrs["result"] == type(result).__name__ and data.attrs["status"] == result.status
    for quantity, (_, value, unit, _) in result.labelled().items():
        assert np.array_equal(data[quantity].values, value, equal_nan=np.asarray(value).dtype.kind in "fc")
        assert data[quantity].attrs.get("units", "") == unit
    assert len(result.to_frame()) == len(next(iter(result.columns().values())))


@ALL
def test_results_print(results, name):
    result = results(name)
    lines = str(result).split("\n")
    # what is wider than a line are sentences, never rows of a table
    rules = [i for i, line in enumerate(lines) if line and not line.strip("-")]
    assert all(len(lines[i + k]) <= 120 for i in rules for k in (-1, 0, 1))
    assert "\n" not in repr(result) and len(repr(result)) < 250 and repr(result).startswith(type(result).__name__ + "(")
    page = result._repr_html_()
    assert page.startswith("<") and (not rules or "<table" in page)


@ALL
def test_results_are_frozen(results, name):
    result = results(name)
    for field in dataclasses.fields(result):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, field.name, None)


@ALL
def test_converged_has_an_estimate(results, name):
    result = results(name)
    if result.status == "converged":
        assert result.error is not None and not np.any(np.isnan(np.asarray(result.error, dtype=float)))


# whose errors are not a share of the result, or not of it alone, and what judges them
JUDGED = {
    "ModalResult": "rigid modes have a frequency; by kind",
    "CampbellResult": "the same; the modes at each speed",
    "Correlation": "the same; its modes",
    "Linearization": "forces of motions are not in balance; at rest the balance",
    "LinearizationSensitivity": "the linearisation",
    "SteadyMotion": "what means leave out; the residual of the state",
    "AccuracyStudy": "errors of runs, which it measures",
}


@ALL
def test_a_large_error_never_passes(results, name):
    """Whatever made a result: with an error of a fifth, or one that is not a number, it is not converged."""
    result = results(name)
    kind = type(result)
    assert (kind.largest_error == np.inf) == (kind.__name__ in JUDGED)
    if kind.__name__ == "System":
        return  # has no estimate, and is made of a model alone
    size = np.shape(result.error) if result.error is not None else ()
    for bad in (0.2, np.nan, np.inf):
        if kind.__name__ not in JUDGED or np.isnan(bad):
            assert result.replaced(error=np.full(size, bad) if size else bad, status="converged").status == "unresolved"
    fine = result.replaced(error=np.full(size, 0.01) if size else 0.01, status="converged")
    assert fine.status == "converged"


@pytest.mark.some(25)
@ALL
def test_results_draw(results, name):
    result = results(name)
    made = result.plot()
    assert plt.fignum_exists(made.number) and made.axes
    figure, ax = plt.subplots()
    assert result.plot(ax=ax) is figure and result.plot(ax=ax) is figure
    assert ax.has_data() or ax.images


def test_labelled_data_of_rotation_say_what_is_seen_and_in_which_units(results):
    motion = results("SteadyMotion that slides and carries")
    data = motion.to_xarray()
    assert data.speed_unit.values.tolist() == ["m/s", "rad/s"] and data.torque_unit.values.tolist() == ["N", "N m"]
    assert data.attrs["frame"] == motion.frame and "carried around: ring" in str(motion)
    assert data.torque.values == pytest.approx([0.61 * 0.7, 0.017 * 13.0], rel=1e-9)
    diagram = results("CampbellResult with critical speeds")
    data = diagram.to_xarray()
    assert data.critical_speed.values.tolist() == [c.speed for c in diagram.critical] and len(diagram.critical) == 2
    assert "unbalance excites" in str(diagram) and "unbalance excites" in diagram._repr_html_()
    assert "<table" in diagram.critical._repr_html_()


def test_copies_do_not_ask_for_an_estimate():
    """The estimate of a motion is a second motion: a copy leaves it for later."""
    asked = []
    made = mb.simulate(drawn(), t=[0.0, 0.1]).replaced(error=lambda owner: asked.append(owner) or 0.3)
    copy = made.replaced(parameters=("k",))
    assert not asked and copy.error == 0.3 and asked == [copy]


def test_motions_with_parameters_make_their_estimate_when_asked(monkeypatch):
    runs = []
    for name in ("mbrs.motion.simulate", "mbrs.motion.error"):
        module = importlib.import_module(name)
        run = module.run_core
        monkeypatch.setattr(module, "run_core", lambda *given, run=run: runs.append(given) or run(*given))
    motion = mb.simulate(drawn(), t=0.1, parameters=["k"])
    assert len(runs) == 1 and motion.error > 0.0 and len(runs) == 2


def test_rounding_is_not_printed(results):
    """A pendulum along no axis of the world: what vanishes is not shown as 1e-17."""
    m = mb.Model("chain", gravity=(0.0, 0.0, -9.81))
    a = m.body("a", mass=1.3, inertia=(0.02, 0.03, 0.04), at=(0.0, 0.0, -0.37))
    m.revolute("A", m.ground, a, at=(0.0, 0.0, 0.0), axis="y", k=41.0)
    text = str(mb.equilibrium(m)) + str(mb.sensitivity(mb.equilibrium(m), ["a.mass"]))
    text += str(mb.sensitivity(mb.modes(mb.examples.cubic_hexapod()), ["k_leg", "c_leg"]))
    assert not re.search(r"\d(\.\d+)?e-(1[4-9]|[2-9]\d)", text.split("\n", 1)[1])
