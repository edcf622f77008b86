"""Files for ParaView, read back by meshio: points, lines, motions and shapes."""

from __future__ import annotations

from xml.etree import ElementTree

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError


def read(path):
    """Points, lines (n, 2), point data; by meshio where it is there, else from the XML."""
    root = ElementTree.parse(path).getroot()
    arrays = {
        a.get("Name"): np.array((a.text or "").split(), dtype=float).reshape(-1, int(a.get("NumberOfComponents", 1)))
        for a in root.iter("DataArray")
    }
    points = arrays.pop("Points")
    offsets, connectivity = arrays.pop("offsets").astype(int).ravel(), arrays.pop("connectivity").astype(int).ravel()
    cells = np.split(connectivity, offsets[:-1])
    assert [len(c) for c in cells] == [{1: 1, 3: 2}[int(t)] for t in arrays.pop("types").ravel()]
    try:
        import meshio
    except ImportError:
        pass
    else:
        mesh = meshio.read(path)
        assert np.array_equal(mesh.points, points) and set(mesh.point_data) == set(arrays)
        for name, values in mesh.point_data.items():
            assert np.array_equal(values.reshape(len(points), -1), arrays[name])
    return points, np.array([c for c in cells if len(c) == 2]), arrays


def pendulum():
    m = mb.Model("two", gravity=(0.3, -0.2, -9.7))
    q = mb.rotation((0.3, -0.8, 0.5), 0.7)
    a = m.body("a", mass=1.3, inertia=(0.1, 0.12, 0.13), at=(0.3, 0.1, -0.2), orientation=q)
    b = m.body("b", mass=0.7, inertia=(0.05, 0.06, 0.07), at=(0.7, 0.3, -0.4))
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis=(0.3, 0.9, 0.1))
    m.revolute("B", a, b, at=(0.5, 0.2, -0.3), axis=(0.2, 0.9, -0.3), c=0.1)
    m.spring_damper("s", m.ground, b, at=((0.9, 0.5, 0.2), (0.8, 0.3, -0.4)), k=30.0)
    m.marker("tip", b, at=(1.0, 0.4, -0.6))
    return m


def test_a_motion_as_a_series(tmp_path):
    m = pendulum()
    traj = mb.simulate(m, t=np.linspace(0.0, 0.5, 6), rtol=1e-9)
    path = traj.save(tmp_path / "run.pvd")
    sets = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    assert [float(s.get("timestep")) for s in sets] == traj.t.tolist()
    whole = [read(tmp_path / s.get("file")) for s in sets]
    for i, (points, lines, data) in enumerate(whole):
        assert np.array_equal(points[:2], [traj.position("a")[i], traj.position("b")[i]])
        assert np.allclose(data["displacement"], points - whole[0][0], atol=1e-15)
        body = data["body"].ravel().astype(int)
        # what is on a body keeps its distance from the origin, what is on ground stays
        for k in np.flatnonzero(body >= 0):
            origin = points[body[k]]
            assert np.linalg.norm(points[k] - origin) == pytest.approx(
                np.linalg.norm(whole[0][0][k] - whole[0][0][body[k]]), abs=1e-12
            )
            drift = np.cross(traj.angular_velocity("ab"[body[k]])[i], points[k] - origin)
            assert np.allclose(data["velocity"][k], traj.velocity("ab"[body[k]])[i] + drift, atol=1e-12)
        assert np.array_equal(points[body < 0], whole[0][0][body < 0]) and not data["velocity"][body < 0].any()
        # the marker is a point of its body, and the spring a line from ground to it
        assert min(np.linalg.norm(points - traj.point("tip")[i], axis=1)) < 1e-12
        assert any({body[p], body[q]} == {-1, 1} for p, q in lines)


def test_modes_in_one_file(tmp_path):
    m = pendulum()
    modes = mb.modes(m, at=mb.equilibrium(m))
    points, _, data = read(modes.save(tmp_path / "modes.vtu"))
    assert {f"mode {k + 1}" for k in range(modes.n)} <= set(data)
    body = data["body"].ravel().astype(int)
    for k in range(modes.n):
        shape = data[f"mode {k + 1}"] + 1j * data.get(f"mode {k + 1} imaginary", 0.0)
        assert np.abs(shape).max() == pytest.approx(1.0)
        wanted = np.zeros_like(shape)
        for p, b in enumerate(body):
            if b >= 0:
                u = modes.body_shape("ab"[b])[:, k]
                wanted[p] = u[:3] + np.cross(u[3:], points[p] - points[b])
        # up to one factor
        factor = np.vdot(wanted, shape) / np.vdot(wanted, wanted)
        assert np.abs(shape - factor * wanted).max() < 1e-12


def test_what_these_files_do_not_hold(tmp_path):
    m = pendulum()
    modes, traj = mb.modes(m), mb.simulate(m, t=[0.0, 0.1])
    with pytest.raises(ModelError, match=r"a \.pvd file holds a motion, not a ModalResult; save modes as \.vtu"):
        modes.save(tmp_path / "x.pvd")
    with pytest.raises(ModelError, match=r"a \.vtu file holds modes, not a Trajectory; save a motion as \.pvd"):
        traj.save(tmp_path / "x.vtu")
    with pytest.raises(ModelError, match="modes of plain matrices"):
        mb.modes(mb.MechanicalSystem(M=[[1.0]], K=[[2.0]])).save(tmp_path / "x.vtu")
    with pytest.raises(ModelError, match="is only written"):
        mb.load(modes.save(tmp_path / "modes.vtu"))
    assert not (tmp_path / "x.pvd").exists() and not (tmp_path / "x").exists()
