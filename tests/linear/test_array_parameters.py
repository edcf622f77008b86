"""Derivatives by one array parameter alone keep its shape, in every result, against differences of the analysis itself."""

from __future__ import annotations

import matplotlib
import mbrs as mb
import numpy as np
import pytest

matplotlib.use("Agg")

pytestmark = pytest.mark.filterwarnings("ignore:the frequency points miss")
OMEGA, TIMES = [1.0, 7.0], np.linspace(0.0, 0.5, 4)


def hung(seed, values):
    """A body on a bushing whose six stiffnesses are the entries of a (2, 3) parameter, off its centre and turned."""
    rng = np.random.default_rng(seed)
    m = mb.Model("hung", gravity=tuple(rng.normal(size=3)))
    p = m.body("p", mass=1.0, inertia=(0.1, 0.2, 0.3), at=rng.normal(size=3))
    V = m.parameter("V", values)
    m.bushing(
        "mount",
        m.ground,
        p,
        at=0.3 * rng.normal(size=3),
        k=tuple(V[i, j] for i in range(2) for j in range(3)),
        c=(0.2,) * 6,
        orientation=mb.rotation(tuple(rng.normal(size=3)), 1.0),
    )
    return m


def full(seed, values):
    """The same with a full stiffness, addressed as an array of the bushing."""
    rng = np.random.default_rng(seed)
    m = mb.Model("full", gravity=tuple(rng.normal(size=3)))
    p = m.body("p", mass=1.0, inertia=(0.1, 0.2, 0.3), at=0.3 * rng.normal(size=3))
    m.bushing("mount", m.ground, p, at=0.3 * rng.normal(size=3), k=values, c=(0.2,) * 6)
    return m


def start(kind, seed):
    rng = np.random.default_rng([seed, 1])
    if kind is hung:
        return 100.0 * (1.0 + rng.random((2, 3)))
    a = rng.normal(size=(6, 6))
    return 150.0 * np.eye(6) + 5.0 * (a + a.T)


def driven(m):
    p = m.bodies[0]
    return {p.force((0.6, 0.0, 0.8)): np.ones(len(TIMES))}, p.motion("y")


def result(m, what):
    p, eq = m.bodies[0], mb.equilibrium(m)
    loads, output = driven(m)
    return {
        "modes": lambda: mb.modes(m, at=eq),
        "frf": lambda: mb.frf(m, p.force("x"), p.motion("z"), omega=OMEGA, at=eq),
        "response": lambda: mb.response(m, t=TIMES, loads=loads, outputs=output, at=eq),
        "equilibrium": lambda: eq,
        "linearization": lambda: mb.linearize(m, at=eq),
    }[what]()


NUMBERS = {"modes": "eigenvalue", "frf": "value", "response": "value", "equilibrium": "position", "linearization": "S"}


def numbers(found, what):
    return found.poses["position"] if what == "equilibrium" else getattr(found, NUMBERS[what])


def stiffness(lin):
    return lin.K if lin.N is None else lin.K + lin.N


@pytest.mark.parametrize("what", NUMBERS)
@pytest.mark.parametrize(("kind", "name"), [(hung, "V"), (full, "mount.k")])
def test_a_matrix_keeps_its_shape(kind, name, what):
    for seed in range(3):
        values = start(kind, seed)
        m = kind(seed, values)
        found = mb.sensitivity(result(m, what), name)
        derivative = getattr(found, NUMBERS[what])
        assert derivative.shape[-2:] == values.shape
        entries = mb.sensitivity(result(m, what), [f"{name}[{i},{j}]" for i, j in np.ndindex(values.shape)])
        flat = getattr(entries, NUMBERS[what])
        assert np.array_equal(derivative, flat.reshape(*flat.shape[:-1], *values.shape), equal_nan=True)
        rng = np.random.default_rng([seed, 2])
        for place in rng.permutation(list(np.ndindex(values.shape)))[:4]:
            step = np.zeros(values.shape)
            i, j = place
            step[i, j] = 1e-3 * values[0, 0]
            if kind is full:
                step[j, i] = step[i, j]
            ahead, behind = (numbers_of(kind(seed, values + sign * step), what) for sign in (1.0, -1.0))
            difference = (ahead - behind) / 2.0
            predicted = np.tensordot(derivative, step, axes=([-2, -1], [0, 1]))
            assert np.max(np.abs(predicted - difference)) < 1e-4 * np.max(np.abs(difference)) + 1e-12


def numbers_of(m, what):
    found = result(m, what)
    if what == "linearization":
        return stiffness(found)
    return numbers(found, what)


@pytest.mark.parametrize("what", NUMBERS)
@pytest.mark.parametrize(("kind", "name"), [(hung, "V"), (full, "mount.k")])
def test_tables_data_and_figures_have_a_column_for_each_entry(kind, name, what, tmp_path):
    values = start(kind, 5)
    m = kind(5, values)
    found = mb.sensitivity(result(m, what), [name])
    entries = mb.sensitivity(result(m, what), [f"{name}[{i},{j}]" for i, j in np.ndindex(values.shape)])
    assert found.labels == entries.labels
    assert found.units == entries.units if hasattr(found, "units") else True
    assert str(found) == str(entries)
    mine, other = found.labelled(), entries.labelled()
    assert mine.keys() == other.keys()
    for key, (dims, data, unit, _) in mine.items():
        assert (dims, unit) == (other[key][0], other[key][2])
        assert data.ndim == len(dims)
        assert np.array_equal(data, other[key][1], equal_nan=True)
    assert found.columns().keys() == entries.columns().keys()
    assert found.plot().axes
    again = mb.load(found.save(tmp_path / "derivatives.json"))
    assert np.array_equal(getattr(again, NUMBERS[what]), getattr(found, NUMBERS[what]), equal_nan=True)


def test_columns_of_one_matrix_among_several_parameters():
    values = start(hung, 7)
    r = result(hung(7, values), "modes")
    both = mb.sensitivity(r, ["p.mass", "V"])
    assert both.eigenvalue.shape == (6, 7)
    np.testing.assert_array_equal(both.eigenvalue[:, 1:], mb.sensitivity(r, "V").eigenvalue.reshape(6, 6))


def test_the_gradient_of_a_motion_by_a_matrix():
    values = start(hung, 9)
    m = hung(9, values)
    drift = mb.Integral(lambda s: np.sum(s.position("p") * [1.0, -2.0, 0.5]))
    made = mb.gradient(m, drift, ["V"], t=0.2, step=0.02, method="direct")
    assert np.asarray(made.gradient).shape == (2, 3)
    found = mb.sensitivity(made, "V")
    np.testing.assert_array_equal(found.value, np.asarray(made.gradient))
    np.testing.assert_array_equal(mb.sensitivity(made, ["V[1,0]"]).value, [np.asarray(made.gradient)[1, 0]])
    assert found.labels == tuple(f"V[{i},{j}]" for i in range(2) for j in range(3))
    assert found.plot().axes


def test_a_sweep_of_derivatives_by_a_matrix_has_a_column_for_each_entry():
    values = start(hung, 11)
    analysis = mb.outputs.sensitivity(mb.outputs.modes(n=4), ["V"])
    found = analysis(hung(11, values))
    assert found["frequency_derivative"].shape == (4, 6)
    entries = mb.outputs.sensitivity(mb.outputs.modes(n=4), [f"V[{i},{j}]" for i in range(2) for j in range(3)])
    np.testing.assert_array_equal(found["frequency_derivative"], entries(hung(11, values))["frequency_derivative"])
