"""Test and computation side by side: points in other axes and units, shapes, functions, signs and units."""

from __future__ import annotations

import math

import mbrs as mb
import numpy as np
import pytest
from hexapods import hexapod
from mbrs._lib.rotations import quaternion_matrix
from mbrs.errors import MbrsWarning, ModelError, NameNotFoundError
from random_models import random_tree

pyuff = pytest.importorskip("pyuff")

ORIGIN = np.array([0.31, -1.7, 0.42])
TURN = quaternion_matrix(mb.rotation((0.2, -0.6, 0.77), 0.9))
# nodes of the test: two on the payload, in world coordinates
NODES = {11: (0.1, 0.02, 0.15), 12: (-0.06, 0.08, 0.13)}


def in_test_axes(path, factor=1.0, length=1000.0):
    """Accelerances that a test measured in its own axes and in mm: three directions of two nodes by a force on the first."""
    m, _ = hexapod()
    p, f = m["payload"], np.linspace(5.0, 60.0, 60)
    outputs = [p.motion(TURN[:, c], at=at) for at in NODES.values() for c in range(3)]
    h = mb.frf(m, p.force(-TURN[:, 1], at=NODES[11]), outputs, frequency=f, kind="accelerance")
    local = {n: TURN.T @ (np.array(at) - ORIGIN) * length for n, at in NODES.items()}
    names = [(n, c + 1) for n in NODES for c in range(3)]
    sets = [
        {"type": 164, "units_code": 5, "length": length, "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
        {"type": 15, "node_nums": list(NODES), **{k: [local[n][i] for n in NODES] for i, k in enumerate("xyz")}},
        *(
            {"type": 58, "binary": 1, "func_type": 4, "rsp_node": n, "rsp_dir": c, "ref_node": 11, "ref_dir": -2,
             "abscissa_spacing": 1, "abscissa_min": f[0], "abscissa_inc": f[1] - f[0], "num_pts": len(f), "abscissa_spec_data_type": 18,
             "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13, "z_axis_value": 0.0, "z_axis_spec_data_type": 0,
             "x": f, "data": h.value[i, 0] * length * factor}
            for i, (n, c) in enumerate(names)
        ),
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    return m, h


def test_a_test_in_other_axes_and_units(tmp_path):
    """The only body carries all points; the functions are the model's, and an update finds its legs."""
    m, h = in_test_axes(tmp_path / "m.uff")
    test = mb.load(tmp_path / "m.uff")
    made = mb.pair(m, test, frame=(ORIGIN, TURN))
    assert made.node == ("11", "12") and set(made.how.tolist()) == {"only body"}
    # data set 15 has five digits
    wanted = [np.linalg.norm(np.subtract(at, m["payload"].values("at"))) for at in NODES.values()]
    assert made.distance == pytest.approx(wanted, abs=2e-5)
    port = made.port("12:-ry", "motion")
    assert np.allclose(port.direction, -TURN[:, 1]) and port.is_rotation
    assert np.allclose(made.port("12:+z", "force").point, NODES[12], atol=2e-5)
    both = mb.correlate(m, test, pairing=made)
    assert both.checks == () and np.abs(both.frac - 1.0).max() < 1e-6
    assert np.abs(both.computed.value - h.value).max() < 3e-4 * np.abs(h.value).max()
    m.set({"k0": 1.07 * m.value("k0")})
    k = m.value("k0") / 1.07
    assert mb.update(m, test, "k0", pairing=made).x[0] == pytest.approx(k, rel=1e-4)
    assert len(test.plot(against=both.computed).axes) == 1


@pytest.mark.parametrize(
    ("factor", "words"),
    [(-1.0, "opposite sign"), (1000.0, "1000 times the model's: mm for m"), (1 / 9.80665, "m/s2 for g")],
)
def test_signs_and_units_are_checked(tmp_path, factor, words):
    m, _ = in_test_axes(tmp_path / "m.uff", factor)
    with pytest.warns(MbrsWarning, match=words):
        both = mb.correlate(m, mb.load(tmp_path / "m.uff"), frame=(ORIGIN, TURN))
    assert words in str(both)


def test_points_by_name_by_position_and_as_given():
    m = random_tree(np.random.default_rng(7), 4)
    bodies = [b.name for b in m.bodies]
    m.marker("tip", bodies[0], at=(1.1, -0.7, 2.3))
    at = np.array(m[bodies[1]].values("at"))
    test = mb.Measurement(
        node=np.array([1, 2, 3, 4]), position=np.array([[np.nan] * 3, at + 1e-6, [1.1, -0.7, 2.3], [50.0, 60.0, 70.0]]),
        node_name=(bodies[0], "2", "3", "4"), lines=(), functions=(), eigenvalue=np.zeros(0, complex), shape=np.zeros((6, 4, 0), complex),
    )  # fmt: skip
    made = mb.pair(m, test)
    assert made.target.tolist() == [bodies[0], bodies[1], "tip"] and made.how.tolist() == [
        "name",
        "position",
        "position",
    ]
    assert made.unpaired == ("4",) and made.status == "partly paired" and made.places["2"].point is None
    with pytest.raises(ModelError, match=r"node '4' of the measurement is not paired.*points="):
        made.port("4:+x", "motion")
    given = mb.pair(m, test, points={4: bodies[2], "2": "tip"})
    assert given.target.tolist() == [bodies[0], "tip", "tip", bodies[2]] and given.places["4"].point == (
        50.0,
        60.0,
        70.0,
    )
    for points, words in (({9: bodies[0]}, "names the node 9"), ({1: "nobody"}, "not a body or marker")):
        with pytest.raises(NameNotFoundError, match=words):
            mb.pair(m, test, points=points)
    with pytest.raises(ModelError, match="frame= takes"):
        mb.pair(m, test, frame=((0, 0, 0), 2.0 * np.eye(3)))


def test_modes_side_by_side_and_expanded(tmp_path):
    """Modes of the model itself in another order and with other phases; SEREP gives back what was left out."""
    m, _ = hexapod()
    m.set({f"c{i}": 0.0 for i in range(6)})
    modes = mb.modes(m)
    order = [3, 0, 5]
    rows = modes.body_shape("payload")[:, order] * np.exp(0.4j) * [1.0, -2.0, 0.5]
    seen = rows.copy()
    seen[2] = 0.0  # not measured along z
    test = mb.Measurement(
        node=np.array([3]), position=np.array([m["payload"].values("at")]), node_name=("3",), lines=(), functions=(),
        eigenvalue=modes.eigenvalue[order] * 1.01, shape=seen[:, None, :],
    )  # fmt: skip
    both = mb.correlate(m, test)
    assert both.partner.tolist() == order and both.coordinate == ("3:x", "3:y", "3:rx", "3:ry", "3:rz")
    assert both.difference == pytest.approx([1 / 1.01 - 1.0] * 3) and both.mac[range(3), order] == pytest.approx(
        [1.0] * 3
    )
    assert both.comac == pytest.approx([1.0] * 5)
    assert np.abs(both.expanded()[:, 0] - rows).max() < 1e-9 * np.abs(rows).max()
    with pytest.raises(ModelError, match="5 measured coordinates cannot tell 6 modes apart"):
        both.expanded(range(6))
    page = both.report(tmp_path / "both.html").read_text()
    assert "3 of 3 modes paired" in page and len(both.plot().axes) == 2


def test_criteria_by_their_formulas():
    rng = np.random.default_rng(4)
    a, b = (rng.standard_normal((3, 4, 9)) + 1j * rng.standard_normal((3, 4, 9)) for _ in range(2))
    i, j = 2, 1
    by_hand = abs(sum(x.conjugate() * y for x, y in zip(a[i, j], b[i, j], strict=True))) ** 2
    by_hand /= sum(abs(x) ** 2 for x in a[i, j]) * sum(abs(y) ** 2 for y in b[i, j])
    assert mb.frac(a, b)[i, j] == pytest.approx(by_hand, rel=1e-13)
    a[i, j, 3] = np.nan
    assert np.isfinite(mb.frac(a, b)[i, j])
    x, y = (s / np.linalg.norm(s, axis=0) for s in (rng.standard_normal((5, 3)), rng.standard_normal((5, 3))))
    k = 4
    by_hand = sum(abs(x[k, n] * y[k, n]) for n in range(3)) ** 2 / (sum(x[k] ** 2) * sum(y[k] ** 2))
    assert mb.comac(3.0 * x, -0.2 * y)[k] == pytest.approx(by_hand, rel=1e-13)
    for call in (lambda: mb.frac(a, b[:1]), lambda: mb.comac(x, y[:2]), lambda: mb.serep(x, y[:2], y)):
        with pytest.raises(ModelError):
            call()
    assert math.isnan(mb.comac(np.array([[1.0], [0.0]]), np.array([[1.0], [0.0]]))[1])
