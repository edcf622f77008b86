"""Every result: what it declares, how it prints, and that a file gives back the same object."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import importlib
import json
import pickle
import re
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import pytest
from air_models import vane
from mbrs._lib.records import HOMES
from mbrs.io.results import member
from mbrs.linear.measurement import MeasuredFunction, Measurement
from mbrs.results import Result

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
TURN = mb.rotation((0.31, -0.83, 0.46), 0.7)


def drawn():
    """A double pendulum with springs, dampers, parameters, about an axis that is not of the world."""
    m = mb.Model("pendulum", gravity=(0.4, -9.3, 1.7))
    k = m.parameter("k", 37.3)
    axis = np.array([0.31, -0.83, 0.46])
    a = m.body("a", mass=1.31, inertia=(0.021, 0.033, 0.027), at=(0.37, 0.11, -0.23), orientation=TURN)
    b = m.body("b", mass=0.73, inertia=(0.013, 0.017, 0.019), at=(0.71, 0.23, -0.31), orientation=TURN)
    m.revolute("A", m.ground, a, at=(0.0, 0.0, 0.0), axis=axis, k=k, c=0.21)
    m.revolute("B", a, b, at=(0.53, 0.17, -0.29), axis=axis, k=0.7 * k, c=0.13)
    return m


def duffing():
    return mb.MechanicalSystem(M=[[1.3]], C=[[0.07]], K=[[1.9]], elements=[mb.Cubic(0.23, w=[1.0])], coordinates=["x"])


def stage():
    m = mb.Model("stage")
    b = m.body("b", mass=1.7, inertia=(0.1, 0.2, 0.3))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=(0.31, -0.83, 0.46), k=413.0, c=0.61, law=mb.Cubic(1.9e4))
    return m, b


def _curve():
    m, b = stage()
    return mb.frequency_response(
        m, inputs=b.force((0.31, -0.83, 0.46)), amplitude=0.7, frequency=(1.7, 3.3), max_points=12
    )


def _parameter_curve():
    m, b = stage()
    return mb.parameter_response(
        m, "b.mass", value=(1.5, 1.9), inputs=b.force((0.31, -0.83, 0.46)), amplitude=0.7, frequency=2.3, max_points=8
    )


def _torus(**more):
    forces = [dict(force=[0.11], omega=0.83), dict(force=[0.07], omega=1.31)]
    return (mb.quasi_periodic_response if more else mb.quasi_periodic)(duffing(), forces, harmonics=3, **more)


def _blades():
    phase = np.exp(-2j * np.pi * np.arange(3) / 3)
    shape = np.stack([np.ones(3), phase, phase.conj()], axis=1)
    return SimpleNamespace(shape=shape, eigenvalue=1j * np.array([1.9, 2.3, 2.9]), coordinates=["a.q1", "b.q1", "c.q1"])


def _turbine():
    a = np.linspace(-np.pi, np.pi, 73)
    section = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.01 + np.sin(a) ** 4)
    return mb.aero.rotor(mb.aero.blade([2.1, 10.3, 39.7], [3.1, 3.5, 1.2], [0.35, 0.12, -0.03], section))


def _wing():
    section = mb.aero.polar([-0.7, 0.9], [-4.3, 5.1], [0.02, 0.03])
    return mb.aero.blade([-2.3, 0.4, 3.1], [0.7, 1.1, 0.6], [0.02, 0.0, -0.03], section)


def _rail():
    m, axis = mb.Model("rail"), (0.31, -0.83, 0.46)
    last = m.ground
    for i in range(500):
        b = m.body(f"b{i}", mass=1.0 + 0.001 * i, inertia=(0.1, 0.2, 0.3), at=(0.7 * i, 0.1, -0.2))
        m.prismatic(f"j{i}", m.ground, b, at=(0.7 * i, 0.0, 0.0), axis=axis)
        m.bushing(f"k{i}", last, b, at=(0.7 * i - 0.3, 0.0, 0.0), k=(913.0,) * 6)
        last = b
    return m


def _sliding():
    """A carriage that is pulled along at constant speed, and a rotor whose bushing carries a ring around."""
    m = mb.Model("carriage")
    along = np.array([0.31, -0.83, 0.46])
    a = m.body("a", mass=1.7, inertia=(0.1, 0.2, 0.3), orientation=TURN)
    b = m.body("b", mass=0.9, inertia=(0.03,) * 3, orientation=TURN)
    ring = m.body("ring", mass=0.4, inertia=(0.02,) * 3, orientation=TURN)
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis=along, c=0.61)
    m.revolute("hub", m.ground, b, at=(0, 0, 0), axis=(0.7, 0.2, -0.5), c=0.017)
    m.bushing("tie", b, ring, at=(0, 0, 0), orientation=TURN, k=(3.1e4,) * 3 + (170.0,) * 3)
    return mb.steady_motion(m, {"rail": 0.7, "hub": 13.0})


def _blocks():
    return mb.design.saltelli({"k": (31.0, 43.0), "a.mass": (1.1, 1.7)}, 4)


def _measured():
    x = np.linspace(1.0, 3.0, 5)
    function = MeasuredFunction("frequency response", "2:+z", "1:-x", "velocity/force", "m/s", x, x * (0.3 - 0.7j))
    shape = np.arange(24.0).reshape(6, 2, 2) * (1 + 0.1j)
    at = np.array([[0.1, 0.2, 0.3], [0.7, -0.1, 0.4]])
    return Measurement(
        np.array([1, 2]),
        at,
        ("1", "tip"),
        ((1, 2),),
        (function,),
        np.array([-0.1 + 3j, 7j]),
        shape,
        "test",
        status="measured",
    )


def _read_back():
    """Transfer functions of the model, read back from a universal file as a measurement."""
    h = mb.frf(drawn(), inputs="a.force.x", outputs=["a.motion.x", "b.motion.y"], frequency=[0.7, 1.2, 1.7, 2.2])
    with tempfile.TemporaryDirectory() as folder:
        return mb.load(h.save(Path(folder) / "h.uff"))


MAKE = {
    "ModalResult": lambda: mb.modes(drawn()),
    "ModalResult of matrices": lambda: mb.modes(
        mb.MechanicalSystem(M=np.diag([1.3, 0.7]), K=[[3.1, -1.7], [-1.7, 2.9]])
    ),
    "ModalResult of a large model": lambda: mb.modes(_rail(), n=2),
    "EnergyShares": lambda: mb.modes(drawn()).energy(),
    "FrfResult": lambda: mb.frf(
        drawn(), inputs=["a.force.x", "b.torque.z"], outputs="b.motion.y", frequency=[0.7, 1.9, 3.1]
    ),
    "FrfSensitivity": lambda: mb.sensitivity(MAKE["FrfResult"](), ["k", "a.mass"]),
    "ResponseResult": lambda: mb.response(
        drawn(), np.linspace(0.0, 1.3, 27), {"a.force.x": np.sin(np.arange(27.0))}, ["b.motion.y", "a.motion.x"]
    ),
    "ResponseSensitivity": lambda: mb.sensitivity(MAKE["ResponseResult"](), ["k", "a.mass"]),
    "Pairing": lambda: mb.pair(drawn(), _read_back()),
    "Correlation": lambda: mb.correlate(drawn(), _read_back()),
    "Update": lambda: mb.update(drawn(), MAKE["FrfResult"](), ["k", "a.mass"], noise=1e-6),
    "Equilibrium": lambda: mb.equilibrium(drawn()),
    "EquilibriumSensitivity": lambda: mb.sensitivity(mb.equilibrium(drawn()), ["k", "a.mass"]),
    "Linearization": lambda: mb.linearize(drawn()),
    "LinearizationSensitivity": lambda: mb.sensitivity(mb.linearize(drawn()), ["k", "a.mass"]),
    "StateSpace": lambda: mb.state_space(drawn(), inputs="a.force.x", outputs="b.motion.y"),
    "EigenSensitivity": lambda: mb.sensitivity(mb.modes(drawn()), ["k", "a.mass"]),
    "DirectionalDerivative": lambda: mb.sensitivity(mb.modes(drawn()), ["k", "a.mass"]).directional([0.3, -0.7]),
    "SteadyMotion": lambda: mb.steady_motion(mb.examples.rotor(), {"shaft": 130.0}),
    "SteadyMotion that slides and carries": _sliding,
    "CampbellResult with critical speeds": lambda: mb.campbell(
        mb.examples.rotor(), "shaft", speed=np.linspace(10.0, 290.0, 4)
    ),
    "ModalResult near a frequency": lambda: mb.modes(drawn(), n=1, shift=1.9),
    "CampbellResult": lambda: mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(10.0, 90.0, 4)),
    "System": lambda: mb.System(mb.examples.four_bar()),
    "EffectsTable": lambda: mb.effects(drawn()),
    "PeriodicSolution": lambda: mb.harmonic_balance(duffing(), force=[0.31], omega=1.1, harmonics=5),
    "FrequencyResponse": _curve,
    "ParameterResponse": _parameter_curve,
    "QuasiPeriodicSolution": _torus,
    "QuasiPeriodicResponse": lambda: _torus(level=(0.7, 1.0)),
    "LimitCycle": lambda: mb.limit_cycle(
        mb.MechanicalSystem(M=[[1.0]], C=[[-0.31]], K=[[1.0]], elements=[mb.VanDerPol(0.31, w=[1.0])]), harmonics=9
    ),
    "Trajectory": lambda: mb.simulate(drawn(), t=np.linspace(0.0, 0.4, 9)),
    "Energy": lambda: mb.simulate(drawn(), t=np.linspace(0.0, 0.4, 9)).energy,
    "MotionGradient": lambda: mb.gradient(
        drawn(), mb.Final(lambda s: s.position("b")[0]), ["k", "a.mass"], t=0.2, step=0.01
    ),
    "MotionSensitivity": lambda: MAKE["MotionGradient"]().sensitivity(["k"]),
    "Comparison": lambda: mb.compare(mb.modes(drawn())),
    "GradientCheck": lambda: mb.check_gradients(mb.modes, drawn(), ["k", "a.mass"]),
    "Optimum": lambda: mb.problem(
        drawn(),
        mb.Final(lambda s: s.position("b")[0] ** 2),
        parameters=["k"],
        bounds={"k": (10.0, 90.0)},
        t=0.1,
        step=0.01,
    ).solve(),
    "AccuracyStudy": lambda: mb.accuracy_study(mb.simulate, drawn(), t=0.2, rtol=[1e-4, 1e-6]),
    "EffectStudy": lambda: mb.effect_study(mb.modes, drawn()),
    "BladeLoads": lambda: mb.simulate(vane(sections=3), t=[0.0, 0.01], rtol=1e-6).aero("arm"),
    "Performance": lambda: mb.aero.performance(_turbine(), [4.1, 7.3, 9.9]),
    "WingLoads": lambda: mb.aero.lifting_line(_wing(), [0.03, 0.11], strips=8),
    "RotorResponse": lambda: mb.aero.rotor_response(
        _turbine(), np.linspace(0.0, 3.0, 7), 8.0, 4.0, pitch=np.linspace(0.0, 0.1, 7)
    ),
    "StallResponse": lambda: mb.aero.dynamic_stall(
        mb.aero.polar([-0.4, 0.0, 0.2, 0.4], [-0.8, 0.1, 1.1, 0.7], [0.1, 0.01, 0.02, 0.1]),
        [0.0, 0.1, 0.3],
        [0.1, 0.3, 0.2],
        20.0,
        0.7,
    ),
    "RotorWake": lambda: mb.aero.rotor_wake(
        _turbine(), 5.0, turns=4, steps=12, strips=4, free_turns=0.5, mean_turns=1.5, tail_turns=0.5
    ),
    "WingStart": lambda: mb.aero.impulsive_start(_wing(), 0.07, 2.9, step=0.7, strips=8),
    "Measurement": lambda: _measured(),
    "RotorModes": lambda: mb.rotor_modes(_blades(), ["a", "b", "c"], 0.7),
    "Runs": lambda: mb.sweep(drawn(), _blocks(), mb.outputs.modes(2, ["k", "a.mass"])),
    "Failures": lambda: mb.sweep(drawn(), mb.design.from_table({"a.mass": [1.0, -1.0]}), mb.outputs.modes()).failures,
    "SobolIndices": lambda: MAKE["Runs"]().sobol_indices("frequency[0]"),
    "DerivativeMeasures": lambda: MAKE["Runs"]().derivative_measures("frequency[0]"),
    "Statistics": lambda: MAKE["Runs"]().statistics(),
    "Designs": lambda: mb.design.latin_hypercube({"k": (31.0, 43.0), "a.mass": (1.1, 1.7)}, 7, units={"k": "N/m"}),
}


@pytest.fixture(scope="module")
def results():
    """Each result made once."""
    made: dict[str, Result] = {}

    def of(name):
        if name not in made:
            made[name] = MAKE[name]()
        return made[name]

    return of


ALL = pytest.mark.parametrize("name", MAKE)


def _classes(base=Result):
    for cls in base.__subclasses__():
        yield cls
        yield from _classes(cls)


def test_no_result_class_is_forgotten():
    for name in HOMES:
        member(HOMES, name)
    found = {cls.__name__ for cls in _classes() if cls.__module__.startswith("mbrs.")}
    assert found == {name.split()[0] for name in MAKE} and found <= set(HOMES)


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


@ALL
def test_results_draw(results, name):
    result = results(name)
    made = result.plot()
    assert plt.fignum_exists(made.number) and made.axes
    figure, ax = plt.subplots()
    assert result.plot(ax=ax) is figure and result.plot(ax=ax) is figure
    assert ax.has_data() or ax.images


def _same(one, other):
    assert type(one) is type(other) and str(one) == str(other) and repr(one) == repr(other)
    assert one.stats == other.stats and one.status == other.status
    mine, its = one.labelled(), other.labelled()
    assert list(mine) == list(its)
    for quantity, (dims, value, unit, label) in mine.items():
        assert (dims, unit, label) == (its[quantity][0], *its[quantity][2:])
        a, b = np.asarray(value), np.asarray(its[quantity][1])
        assert a.dtype == b.dtype and a.tobytes() == b.tobytes(), quantity


@ALL
@pytest.mark.parametrize("ending", [".json", ".nc", ".JSON"])
def test_files_give_the_same_object_back(results, name, ending, tmp_path):
    path = results(name).save(tmp_path / f"result{ending}")
    again = mb.load(path)
    _same(results(name), again)
    _same(again, mb.load(again.save(tmp_path / f"again{ending}")))
    assert again.plot().axes


@ALL
def test_pickles_come_back_and_are_never_loaded(results, name, tmp_path):
    path = results(name).save(tmp_path / "result.pkl")
    _same(results(name), pickle.loads(path.read_bytes()))
    with pytest.raises(mb.errors.ModelError, match="a pickle can run any program"):
        mb.load(path)


@ALL
def test_tables_of_numbers_are_complete(results, name, tmp_path):
    columns = results(name).columns()
    lines = list(csv.reader((results(name).save(tmp_path / "result.csv")).read_text().splitlines()))
    assert lines[0] == list(columns)
    for place, column in enumerate(columns.values()):
        texts = [line[place] for line in lines[1:]]
        if column.dtype.kind in "fiu":
            assert np.array_equal(np.array([float(x) for x in texts]), column, equal_nan=True)
        else:
            assert texts == [str(x) for x in column.tolist()]
    with pytest.raises(mb.errors.ModelError, match=r"is only written; known are \.json, \.nc"):
        mb.load(tmp_path / "result.csv")


@pytest.mark.parametrize("name", ["a.png", "a", "a.txt", "a.toml", "a.nc4", "a.pickle", ".nc"])
def test_unknown_endings_are_refused_and_the_known_ones_listed(results, name, tmp_path):
    with pytest.raises(mb.errors.ModelError, match=r"known are \.csv, \.fmu, \.json, \.nc, \.parquet, \.pkl"):
        results("ModalResult").save(tmp_path / name)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".json", ".nc"])
def test_a_loaded_result_goes_on(results, ending, tmp_path):
    def loaded(name):
        return mb.load(results(name).save(tmp_path / f"{name}{ending}"))

    modes = loaded("ModalResult")
    derivative = mb.sensitivity(results("ModalResult"), ["k", "b.mass"]).frequency
    assert np.array_equal(mb.sensitivity(modes, ["k", "b.mass"]).frequency, derivative)
    assert "mbrsViewer" in modes.animate().html()
    rest = loaded("Equilibrium")
    assert np.array_equal(
        mb.modes(rest.model, at=rest).eigenvalue, mb.modes(rest.model, at=mb.equilibrium(drawn())).eigenvalue
    )
    assert list(rest.reactions) == ["A", "B"]
    h = mb.sensitivity(loaded("FrfResult"), ["k"])
    assert np.array_equal(h.value, mb.sensitivity(results("FrfResult"), ["k"]).value)
    curve = loaded("FrequencyResponse").resume(5)
    # the last point is found again, as the first of the new ones
    assert curve.omega[:12] == pytest.approx(results("FrequencyResponse").omega, rel=1e-9) and len(curve) == 17
    assert curve.point(16).verify(full=False).balanced < 1e-6
    motion = loaded("Trajectory")
    assert motion.error == results("Trajectory").error > 0.0
    on = mb.simulate(motion.model, t=[0.4, 0.5], at=motion.state(0.4))
    assert np.array_equal(
        on.position("b"), mb.simulate(drawn(), t=[0.4, 0.5], at=results("Trajectory").state(0.4)).position("b")
    )


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
    module = importlib.import_module("mbrs.motion.simulate")
    runs, run = [], module._run
    monkeypatch.setattr(module, "_run", lambda *given: runs.append(given) or run(*given))
    motion = mb.simulate(drawn(), t=0.1, parameters=["k"])
    assert len(runs) == 1 and motion.error > 0.0 and len(runs) == 2


def test_a_model_that_changed_since_keeps_the_numbers_of_the_result(tmp_path):
    m = drawn()
    rest = mb.equilibrium(m)
    text = str(rest)
    m.set({"k": 91.0})
    again = mb.load(rest.save(tmp_path / "rest.json"))
    assert str(again) == text and again.model.value("k") == 91.0
    with pytest.raises(mb.errors.ModelError, match="was changed after"):
        mb.sensitivity(again, ["k"])


def test_python_functions_of_a_model_are_imported_when_asked_for_only(tmp_path, monkeypatch):
    (tmp_path / "pulls.py").write_text("CALLS = []\ndef pull(t):\n    return (0.3 * t, 0.0, 0.0)\n")
    monkeypatch.syspath_prepend(tmp_path)
    import pulls

    m = drawn()
    m.force("f", "b", at=(0.71, 0.23, -0.31), value=pulls.pull)
    motion = mb.simulate(m, t=[0.0, 0.1])
    path = motion.save(tmp_path / "motion.json")
    monkeypatch.delitem(sys.modules, "pulls")
    with pytest.raises(mb.errors.ModelError, match="functions=True"):
        mb.load(path)
    assert "pulls" not in sys.modules
    _same(motion, mb.load(path, functions=True))
    m.force("g", "b", at=(0.71, 0.23, -0.31), value=lambda t: (0.0, t, 0.0))
    with pytest.raises(mb.errors.ModelError, match="to_netcdf"):
        mb.simulate(m, t=[0.0, 0.1]).save(tmp_path / "lambda.json")


@pytest.mark.parametrize("ending", [".json", ".nc"])
@pytest.mark.parametrize("name", ["ModalResult", "Trajectory", "FrequencyResponse"])
def test_damaged_files_are_named(results, name, ending, tmp_path):
    """Cut, flipped, overwritten, doubled: never another error, never another result."""
    good = results(name).save(tmp_path / f"good{ending}").read_bytes()
    rng = np.random.default_rng(5)
    path = tmp_path / f"bad{ending}"
    for _ in range(150):
        data = bytearray(good)
        kind, place = rng.integers(4), int(rng.integers(len(good)))
        if kind == 0:
            data = data[:place]
        elif kind == 1:
            data[place] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            data[place : place + 40] = rng.bytes(40)
        else:
            data[place:place] = data[: int(rng.integers(1, 200))]
        path.write_bytes(data)
        with pytest.raises(mb.errors.MbrsError, match=r"bad\."):
            mb.load(path)
    for text in (b"", b"{}", b"[]", b"null", rng.bytes(500), b'{"sha256": "', b"\x89HDF\r\n\x1a\n"):
        path.write_bytes(text)
        with pytest.raises(mb.errors.MbrsError, match=r"bad\."):
            mb.load(path)
    with pytest.raises(mb.errors.ModelError, match="cannot read"):
        mb.load(tmp_path / f"absent{ending}")


def _mutated(tree, rng):
    """One entry of a tree replaced by something else."""
    if isinstance(tree, dict | list) and len(tree) and rng.random() < 0.93:
        keys = list(tree) if isinstance(tree, dict) else range(len(tree))
        key = keys[int(rng.integers(len(keys)))]
        copy = dict(tree) if isinstance(tree, dict) else list(tree)
        if rng.random() < 0.05:
            del copy[key]
        else:
            copy[key] = _mutated(tree[key], rng)
        return copy
    junk = [
        None,
        -1,
        10**30,
        1.5,
        "x",
        "os",
        [],
        {},
        {"~": "record", "class": "Popen", "at": 0, "state": {}},
        {"~": "made"},
        [[[]]],
    ]
    return junk[int(rng.integers(len(junk)))]


@pytest.mark.parametrize("name", ["ModalResult", "Equilibrium", "FrfResult", "PeriodicSolution", "CampbellResult"])
def test_files_that_were_made_by_hand_end_in_a_result_or_a_named_error(results, name, tmp_path):
    """With a right checksum around wrong content."""
    text = results(name).save(tmp_path / "good.json").read_text()
    data = json.loads(text)["data"]
    rng = np.random.default_rng(17)
    path, named = tmp_path / "made.json", 0
    for _ in range(300):
        body = json.dumps(_mutated(data, rng))
        checksum = hashlib.sha256(body.encode()).hexdigest()
        path.write_text(f'{{"sha256": "{checksum}",\n"data": {body}}}\n')
        try:
            assert isinstance(mb.load(path), Result)
        except mb.errors.MbrsError as reason:
            named += 1
            assert "made.json" in str(reason)
    assert named > 100


def test_files_carry_format_and_version_and_newer_ones_are_refused(results, tmp_path):
    path = results("ModalResult").save(tmp_path / "a.json")
    data = json.loads(path.read_text())["data"]
    assert data["mbrs"]["format"] == 3 and data["mbrs"]["version"] == mb.__version__
    assert "[[body]]" in path.read_text()
    data["mbrs"]["format"] = 4
    body = json.dumps(data)
    path.write_text(f'{{"sha256": "{hashlib.sha256(body.encode()).hexdigest()}",\n"data": {body}}}\n')
    with pytest.raises(mb.errors.ModelError, match="has the format 4"):
        mb.load(path)


def test_rounding_is_not_printed(results):
    """A pendulum along no axis of the world: what vanishes is not shown as 1e-17."""
    m = mb.Model("chain", gravity=(0.0, 0.0, -9.81))
    a = m.body("a", mass=1.3, inertia=(0.02, 0.03, 0.04), at=(0.0, 0.0, -0.37))
    m.revolute("A", m.ground, a, at=(0.0, 0.0, 0.0), axis="y", k=41.0)
    text = str(mb.equilibrium(m)) + str(mb.sensitivity(mb.equilibrium(m), ["a.mass"]))
    text += str(mb.sensitivity(mb.modes(mb.examples.cubic_hexapod()), ["k_leg", "c_leg"]))
    assert not re.search(r"\d(\.\d+)?e-(1[4-9]|[2-9]\d)", text.split("\n", 1)[1])
