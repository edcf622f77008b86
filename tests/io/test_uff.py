"""Universal files: what mbrs writes is read by pyuff and by mbrs, what pyuff writes is read by mbrs, in SI units."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError, OmissionWarning

pyuff = pytest.importorskip("pyuff")


def isolator():
    m = mb.examples.cubic_hexapod()
    m.marker("tip", m.bodies[0], at=(0.11, -0.07, 0.23))
    return m


def transfer(kind="receptance", **options):
    m = isolator()
    name = m.bodies[0].name
    outputs = [f"{name}.motion.x", "tip.motion.-z", f"{name}.motion.ry"]
    inputs = [f"{name}.force.z", f"{name}.torque.x"] if kind != "transmissibility" else ["base.x", "base.z"]
    return mb.frf(m, inputs=inputs, outputs=outputs, frequency=np.geomspace(1.0, 300.0, 57), kind=kind, **options)


@pytest.mark.parametrize("kind", ["receptance", "mobility", "accelerance", "transmissibility"])
def test_transfer_functions_come_back_to_the_last_bit(tmp_path, kind):
    h = transfer(kind)
    test = mb.load(h.save(tmp_path / "h.uff"))
    again = test.frf()
    assert np.array_equal(again.value, h.value) and np.array_equal(again.frequency, h.frequency)
    assert (again.inputs, again.outputs, again.kind) == (h.inputs, h.outputs, kind)
    at = dict(zip(test.node_name, test.position, strict=True))
    body = isolator().bodies[0]
    assert np.array_equal(at[body.name], body.values("at")) and np.array_equal(at["tip"], [0.11, -0.07, 0.23])


def test_transfer_functions_are_what_pyuff_reads(tmp_path):
    h = transfer()
    sets = pyuff.UFF(str(h.save(tmp_path / "h.uff"))).read_sets()
    functions = [s for s in sets if s["type"] == 58]
    assert [s["type"] for s in sets][:2] == [151, 164] and len(functions) == 6
    for s, (i, j) in zip(functions, np.ndindex(3, 2), strict=True):
        assert np.array_equal(s["data"], h.value[i, j]) and np.array_equal(s["x"], h.frequency)
        assert (s["rsp_dir"], s["ref_dir"]) == ((1, -3, 5)[i], (3, 4)[j]) and s["func_type"] == 4
        assert (s["ordinate_spec_data_type"], s["orddenom_spec_data_type"]) == (8, 13)


def test_modes_are_what_pyuff_reads(tmp_path):
    """Six digits, as the format has; the shapes of undamped modes have their rotations."""
    modes = mb.modes(mb.examples.stewart_platform(), without=("damping",))
    path = modes.save(tmp_path / "modes.uff")
    sets = pyuff.UFF(str(path)).read_sets()
    shapes = [s for s in sets if s["type"] == 55]
    names = [b.name for b in modes.geometry.bodies]
    (nodes,) = (s for s in sets if s["type"] == 15)
    assert np.allclose(np.column_stack([nodes[k] for k in "xyz"]), [b.origin for b in modes.geometry.bodies], atol=2e-5)
    assert len(shapes) == modes.n
    test = mb.load(path)
    assert test.node_name == tuple(names) and np.allclose(test.frequency, modes.frequency, rtol=1e-5)
    for k, s in enumerate(shapes):
        whole = np.array([modes.body_shape(n)[:, k] for n in names])
        size = np.abs(whole).max()
        assert (
            s["analysis_type"] == 2
            and np.abs(np.column_stack([s[f"r{c}"] for c in range(1, 7)]) - whole).max() < 1e-5 * size
        )
        assert np.abs(test.shape[:, :, k].T - whole).max() < 1e-5 * size


def damped():
    """One damper that is not proportional: complex shapes."""
    m = mb.Model("two")
    a = m.body("a", mass=1.3, inertia=(0.1, 0.2, 0.25), at=(0, 0, 0.5))
    b = m.body("b", mass=0.7, inertia=(0.1, 0.15, 0.2), at=(0.1, 0, 1.1))
    m.bushing("ka", m.ground, a, at=(0, 0, 0.2), k=(900, 1100, 1700, 30, 40, 50), c=(9, 0, 4, 0.3, 0, 0))
    m.bushing("kb", a, b, at=(0, 0, 0.8), k=(500, 700, 900, 20, 30, 10))
    return m


def test_complex_shapes_lose_their_rotations_by_name(tmp_path):
    modes = mb.modes(damped())
    assert np.iscomplexobj(modes.shape)
    with pytest.warns(OmissionWarning, match="rotations of a complex shape: mode 1") as caught:
        path = modes.save(tmp_path / "modes.uff")
    assert len(caught[0].message.omissions) == modes.n
    test = mb.load(path)
    assert np.allclose(test.eigenvalue, modes.eigenvalue, rtol=2e-5, atol=0) and np.allclose(
        test.damping, modes.damping, rtol=1e-4
    )
    wanted = np.array([modes.body_shape(n)[:3] for n in ("a", "b")]).transpose(1, 0, 2)
    assert np.abs(test.shape[:3] - wanted).max() < 1e-5 * np.abs(wanted).max() and not np.any(test.shape[3:])
    assert test.lines == ((1, 2),) and test.node_name == ("a", "b")


def measured(path, length=1000.0, force=1.0, even=True, binary=1):
    """A file in mm as an analyser writes it: accelerance of two nodes, coherence, a time history, geometry, one mode."""
    rng = np.random.default_rng(1)
    f = np.linspace(2.0, 50.0, 25) if even else np.geomspace(2.0, 50.0, 25)
    value = rng.normal(size=(2, 25)) + 1j * rng.normal(size=(2, 25))
    common = {
        "type": 58, "binary": binary, "ref_node": 3, "ref_dir": -1, "abscissa_spacing": int(even), "abscissa_min": f[0],
        "abscissa_inc": f[1] - f[0], "num_pts": len(f), "abscissa_spec_data_type": 18, "x": f, "z_axis_value": 0.0,
        "z_axis_spec_data_type": 0,
    }  # fmt: skip
    sets = [
        {"type": 151, "model_name": "frame", "description": "", "db_app": "", "program": "analyser"},
        {"type": 164, "units_code": 5, "length": length, "force": force, "temp": 1.0, "temp_offset": 273.15},
        {"type": 15, "node_nums": [3, 17], "x": [0.0, 250.0], "y": [10.0, 20.0], "z": [0.0, -5.0]},
        {"type": 82, "trace_num": 1, "nodes": np.array([3, 17, 0, 17, 3, 0])},
        *(
            {**common, "func_type": 4, "rsp_node": n, "rsp_dir": 3, "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13,
             "ordinate_axis_units_lab": "mm/s^2", "data": value[i]} for i, n in enumerate((3, 17))
        ),
        {**common, "func_type": 6, "rsp_node": 17, "rsp_dir": 3, "ordinate_spec_data_type": 0, "orddenom_spec_data_type": 0,
         "data": rng.random(25)},
        {**common, "func_type": 1, "rsp_node": 17, "rsp_dir": -6, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12,
         "orddenom_spec_data_type": 0, "data": rng.random(25)},
        {"type": 55, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "load_case": 0, "mode_n": 1, "freq": 12.5,
         "modal_damp_vis": 0.02, "modal_m": 1.0, "node_nums": [3, 17], "r1": np.array([0.0, 0.5]), "r2": np.array([0.25, 0.0]),
         "r3": np.array([1.0, -1.0])},
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    return f, value


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("binary", [0, 1])
def test_a_test_in_millimetres(tmp_path, binary, even):
    path = tmp_path / "measured.unv"
    f, value = measured(path, even=even, binary=binary)
    test = mb.load(path)
    digits = {"rtol": 1e-10} if binary or even else {"rtol": 1e-5}
    assert np.allclose(test.position, [[0, 0.01, 0], [0.25, 0.02, -0.005]], atol=1e-12) and test.node.tolist() == [
        3,
        17,
    ]
    assert test.lines == ((3, 17), (17, 3))
    h = test.frf()
    assert (h.kind, h.outputs, h.inputs) == ("accelerance", ("3:+z", "17:+z"), ("3:-x",))
    assert np.allclose(h.value[:, 0], value / 1000.0, rtol=1e-10) and np.allclose(h.frequency, f, **digits)
    assert [x.kind for x in test.functions] == ["frequency response"] * 2 + ["coherence", "time response"]
    # a rotation has no length in it
    assert test.functions[3].response == "17:-rz" and test.functions[3].value.max() > 0.5
    assert test.frequency[0] == pytest.approx(12.5) and test.damping[0] == pytest.approx(0.02)
    assert np.array_equal(test.shape[:3, :, 0], [[0, 0.5], [0.25, 0], [1, -1]])
    assert "4 functions, 1 mode, 2 nodes" in str(test) and len(test.plot().axes) == 1


def test_forces_have_units_too(tmp_path):
    f, value = measured(tmp_path / "m.uff", length=100.0, force=0.25)
    h = mb.load(tmp_path / "m.uff").frf()
    assert np.allclose(h.value[:, 0], value / 100.0 * 0.25, rtol=1e-12) and len(f) == h.frequency.size


def test_functions_that_do_not_fit_together(tmp_path):
    path = tmp_path / "m.uff"
    measured(path)
    other = tmp_path / "other.uff"
    measured(other, even=False)
    path.write_bytes(path.read_bytes() + other.read_bytes())
    with pytest.raises(ModelError, match="has other frequencies than"):
        mb.load(path).frf()
    with pytest.raises(ModelError, match=r"m\.uff has no frequency responses of 'velocity/force'"):
        mb.load(path).frf("velocity/force")


def test_data_sets_that_are_not_read_are_named(tmp_path):
    path = tmp_path / "m.uff"
    measured(path)
    path.write_text("    -1\n   999\nwhatever\n    -1\n" + "", encoding="utf-8")
    with pytest.warns(OmissionWarning, match="type 999: data set 1"):
        test = mb.load(path)
    assert len(test.functions) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error", OmissionWarning)
        measured(path)
        mb.load(path)


def test_what_universal_files_do_not_hold(tmp_path):
    with pytest.raises(ModelError, match="UFF holds transfer functions and modes, not a Linearization"):
        mb.linearize(isolator()).save(tmp_path / "x.uff")
    with pytest.raises(ModelError, match="modes of plain matrices, which have no nodes"):
        mb.modes(mb.MechanicalSystem(M=[[1.0]], K=[[2.0]])).save(tmp_path / "x.uff")
    with pytest.raises(ModelError, match=r"known are \.csv, \.fmu, \.json, .*\.uff"):
        transfer().save(tmp_path / "x.foo")


def test_systems_of_matrices_have_scalar_directions(tmp_path):
    s = mb.MechanicalSystem(M=np.diag([2.0, 3.0]), C=np.eye(2), K=[[5.0, -1.0], [-1.0, 7.0]])
    h = mb.frf(s, inputs=[0], outputs=[0, 1], omega=np.linspace(0.3, 3.0, 11))
    again = mb.load(h.save(tmp_path / "h.uff")).frf()
    assert np.array_equal(again.value, h.value) and again.outputs == h.outputs
