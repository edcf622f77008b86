"""What gradients of motions print, draw and hand on; the page docs/gradients.md is true."""

from __future__ import annotations

import pickle
import re

import mbrs as mb
import numpy as np
import pytest
from folders import DOCS
from mbrs.errors import ModelError
from mbrs.motion.quantities import Instant

PAGE = (DOCS / "gradients.md").read_text()
NAMES = ["spring1.length", "spring1.k", "crank.at[0]", "A.axis"]


@pytest.fixture(scope="module")
def found():
    m = mb.examples.five_bar()
    goals = [mb.Final(lambda s: s.point("P2")[0]), mb.Integral(lambda s: s.point("P2")[1])]
    return mb.gradient(m, goals, NAMES[:3], t=0.2, step=0.02)


@pytest.fixture(scope="module")
def traj():
    return mb.simulate(mb.examples.five_bar(), t=0.2, step=0.02, method="ali3p", parameters=NAMES[:3])


def bars(figure):
    """{label: length} of a tornado."""
    (ax,) = figure.axes
    return dict(zip([t.get_text() for t in ax.get_yticklabels()], [p.get_width() for p in ax.patches], strict=True))


def test_a_gradient_prints_values_and_units(found):
    text = str(found)
    print(text)
    for word in ("spring1.length", "N/m", "100", "gradient 0", "gradient 1", "ali3p"):
        assert word in text


def test_tornado_is_the_change_by_one_per_cent(found, tmp_path):
    figure = found.plot()
    figure.savefig(tmp_path / "a.png")
    drawn = bars(figure)
    assert drawn["spring1.k  +1 %"] == pytest.approx(found.gradient[0, 1] * 1.0, rel=1e-12)
    assert drawn["spring1.length  +1 %"] == pytest.approx(found.gradient[0, 0] * 0.01 * 5**0.5, rel=1e-12)
    assert bars(found.plot(objective=1))["spring1.k  +1 %"] == pytest.approx(found.gradient[1, 1], rel=1e-12)


def test_tornado_of_changes_in_units(found):
    drawn = bars(found.plot(change={"spring1.length": 0.02}))
    assert drawn["spring1.length  +0.02 m"] == pytest.approx(found.gradient[0, 0] * 0.02, rel=1e-12)
    assert "spring1.k  +1 %" in drawn
    lengths = list(map(abs, drawn.values()))
    assert lengths == sorted(lengths)  # the largest on top
    assert len(bars(found.plot(n=1))) == 1


def test_turns_have_no_value_and_no_bar_by_themselves():
    m = mb.examples.five_bar()
    one = mb.gradient(m, mb.Final(lambda s: s.point("P2")[0]), ["spring1.k", "B.at"], t=0.02, step=0.02)
    assert one.where.tolist() == [100.0, 1.0, 0.0, 0.0]
    hinge = mb.Model("hinge", gravity=(0, 0, -9.81))
    b = hinge.body("b", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    hinge.revolute("A", hinge.ground, b, at=(0, 0, 0), axis="y")
    turns = mb.gradient(hinge, mb.Final(lambda s: s.position("b")[2]), ["A.axis", "b.mass"], t=0.1, step=0.05)
    assert np.isnan(turns.where[:3]).all() and turns.where[3] == 1.0
    assert [name.split()[0] for name in bars(turns.plot())] == ["b.mass"]
    assert len(bars(turns.plot(change={"A.axis": 0.01}))) == 4


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"change": {"spring9.k": 1.0}}, "spring9.k"),
        ({"change": "much"}, "finite number"),
        ({"change": {"spring1.k": np.nan}}, "finite number"),
        ({"objective": 2}, "has 2"),
        ({"kind": "pie"}, "'tornado'"),
    ],
)
def test_bad_plots(found, options, words):
    with pytest.raises(ModelError, match=words):
        found.plot(**options)


def test_a_gradient_is_labelled_data_and_comes_back(found, tmp_path):
    data = found.to_xarray()
    assert data["gradient"].sel(parameter="spring1.k").values.tolist() == found.gradient[:, 1].tolist()
    assert data["where"].sel(parameter="spring1.k").item() == 100.0
    back = pickle.loads(found.save(tmp_path / "g.pkl").read_bytes())
    assert np.array_equal(back.gradient, found.gradient) and back.labels == found.labels


def test_parts_and_optima_are_labelled_data(found, tmp_path):
    part = found.sensitivity(["spring1.k"]).to_xarray()
    assert part["derivative"].sel(parameter="spring1.k").values.tolist() == found.gradient[:, 1].tolist()
    m = mb.Model("one")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1.0, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x")
    goal = mb.Final(lambda s: (s.position("p")[0] - 3.0) ** 2 + 1.0)
    best = mb.problem(m, goal, ["p.velocity[0]"], t=1.0, step=0.1).solve()
    data = best.to_xarray()
    assert data["x"].sel(parameter="p.velocity[0]").item() == pytest.approx(3.0, abs=1e-6)
    assert data["objective"].values.tolist() == best.history.tolist() and data.attrs["status"] == "converged"
    figure = best.plot()
    figure.savefig(tmp_path / "a.png")
    assert figure.axes[0].lines[0].get_ydata().tolist() == best.history.tolist()
    assert figure.axes[0].lines[1].get_ydata()[-1] == best.history.min()


def test_sensitivities_over_time(traj, tmp_path):
    figure = traj.plot("sensitivity", of="P2")
    figure.savefig(tmp_path / "a.png")
    exact = np.asarray(traj.sensitivity("P2"))
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles == [f"by {name}" for name in NAMES[:3]]
    for p, ax in enumerate(figure.axes):
        for k, line in enumerate(ax.lines):
            assert np.array_equal(line.get_ydata(), exact[:, k, p])
    assert [ax.get_ylabel() for ax in figure.axes] == ["[m/m]", "[m / (N/m)]", "[m/m]"]
    assert traj.plot("sensitivity", of="A").axes[0].get_ylabel() == "[rad/m]"


def test_table_and_labels_of_sensitivities(traj):
    text = traj.sensitivity_table("P2")
    print(text)
    exact = np.asarray(traj.sensitivity("P2"))
    assert f"{exact[-1, 0, 0]:.4g}"[:5] in text and "largest ever" in text and "[m per unit" in text
    assert "t = 0.1 s" in traj.sensitivity_table("A", t=0.1)
    data = traj.to_xarray(sensitivity=["P2", "A"])
    assert data["d P2"].dims == ("time", "axis", "parameter")
    assert np.array_equal(data["d P2"].sel(parameter="spring1.k", axis="y").values, exact[:, 1, 1])
    assert "d P2" not in traj.to_xarray()
    assert [traj.unit_of(w) for w in ("P2", "P2.velocity", "A", "crank.angular_acceleration", "A.reaction")] == [
        "m",
        "m/s",
        "rad",
        "rad/s^2",
        "",
    ]


def test_the_page_on_gradients_is_true(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    exec(PAGE.split("```python\n")[1].split("```")[0], scope)
    found, best, problem = scope["found"], scope["best"], scope["problem"]
    assert np.asarray(found.gradient).shape == (2, 5) and scope["data"].dims == ("time",)
    assert np.abs(scope["slope"] - found.gradient[0]).max() < 1e-12 * np.abs(found.gradient[0]).max()
    assert best.status == "converged" and best.value < problem.history[0][1]
    kept = [c["fun"](best.x / problem.scale) for c in problem.constraints]
    print("constraints", kept)
    assert min(kept) > -1e-6
    # all that it says an objective may read is there
    for name in re.findall(r"`s\.(\w+)", PAGE.split("## What an objective may read")[1].split("##")[0]):
        assert hasattr(Instant, name) or name in ("t", "index"), name
    assert all(hasattr(mb, name) for name in re.findall(r"`mb\.(\w+)", PAGE))
