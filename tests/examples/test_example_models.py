"""The example models: the hexapod's closed form, bodies and degrees of freedom, geometry of docs/theory.md (23.2) to (23.4)."""

from __future__ import annotations

import math

import mbrs as mb
import numpy as np
import pytest
from absolute import Absolute
from mbrs import examples
from mbrs._lib.rotations import quaternion_matrix
from mbrs.model.tables import tables
from mbrs.system.compiled import compiled


def test_cubic_hexapod_has_its_closed_form():
    # sqrt(2k/m), sqrt(k L^2/(2 I)), sqrt(2 k L^2/I), docs/theory.md (23.1): 15.9155 (3), 18.3776 (2), 36.7553 Hz.
    k, mass, inertia, edge = 1e5, 20.0, 0.15, 0.2
    w2 = [2 * k / mass] * 3 + [k * edge**2 / (2 * inertia)] * 2 + [2 * k * edge**2 / inertia]
    exact = np.sqrt(w2) / (2 * math.pi)
    got = Absolute(tables(examples.cubic_hexapod())).frequencies()
    assert np.abs(got / exact - 1).max() < 1e-12
    assert [f"{f:.4f}" for f in got] == ["15.9155"] * 3 + ["18.3776"] * 2 + ["36.7553"]


def test_cubic_hexapod_decouples_anywhere():
    edge, centre = 0.37, np.array([1.0, -2.0, 3.0])
    K = np.zeros((6, 6))
    for a, b in examples.cubic_hexapod_points(edge=edge, centre=tuple(centre)):
        a, b = np.array(a), np.array(b)
        u = (b - a) / edge
        g = np.r_[u, np.cross(b - centre, u)]
        K += np.outer(g, g)
    assert np.abs(K - np.diag([2, 2, 2, 0.5 * edge**2, 0.5 * edge**2, 2 * edge**2])).max() < 1e-14


@pytest.mark.parametrize(
    ("model", "bodies", "freedom"),
    [
        (examples.quadruped(), 13, 18),
        (examples.stewart_platform(), 14, 12),
        (examples.four_bar(), 3, 1),
        (examples.wafer_stage(), 4, 14),
        (examples.wafer_stage(mounts=3), 4, 14),
        (examples.rotor(), 2, 7),
        (examples.cubic_hexapod(), 1, 6),
        (examples.chain(5), 5, 5),
        (examples.chain(4, joint="cylindrical"), 4, 8),
        (examples.chain(3, joint="S", springs=2), 3, 9),
        (examples.chain(3, joint=None), 3, 18),
        (examples.tree(3), 7, 7),
        # docs/theory.md (23.4): N, 4N and 6N degrees of freedom of the ladder with N layers.
        (examples.ladder(3, joint="R"), 9, 3),
        (examples.ladder(3, joint="C"), 9, 12),
        (examples.ladder(3, joint="S"), 9, 18),
        (examples.from_code("LL4RF2"), 12, 4),
    ],
)
def test_bodies_and_degrees_of_freedom(model, bodies, freedom):
    assert len(model.bodies) == bodies
    scene = Absolute(tables(model))
    assert scene.degrees_of_freedom() == freedom
    rigid = 1 if model.name == "rotor" else 0
    assert (scene.frequencies() < 1e-3).sum() == rigid


def test_the_springs_of_a_joint_share_their_coefficients():
    one, three = (Absolute(tables(examples.chain(4, joint="S", springs=s))) for s in (1, 3))
    assert np.abs(one.frequencies() / three.frequencies() - 1).max() < 1e-12


def test_geometry_of_the_chain():
    """Printed along z: centre of mass at [0 0 0.2i-0.1 | 0 0 0], joint at [0 0 0.2i-0.2 | 0 0 0]."""
    for code in ("CL7RF1", "CL7CF2"):
        m = examples.from_code(code)
        for i in range(1, 8):
            assert m.value(f"B{i}.at") == pytest.approx([0, 0, 0.2 * i - 0.1], abs=1e-15)
            assert m.value(f"J{i}.at_a") == pytest.approx([0, 0, 0.2 * i - 0.2], abs=1e-15)
            assert quaternion_matrix(m.value(f"J{i}.orientation")) == pytest.approx(np.eye(3))
    across = examples.chain(4, along="x")
    assert across.value("B4.at").tolist() == pytest.approx([0.7, 0, 0])
    assert across.value("J4.at_a").tolist() == pytest.approx([0.6, 0, 0])


def spectrum(n, stiffness, size):
    """Of n equal bodies in a row, one end held: 2 sqrt(k/m) sin((2j - 1) pi/(2 (2n + 1)))."""
    j = np.arange(1, n + 1)
    return 2 * np.sqrt(stiffness / size) * np.sin((2 * j - 1) * math.pi / (2 * (2 * n + 1)))


@pytest.mark.parametrize("n", [3, 8, 23])
def test_hinges_along_one_axis_twist_and_sliders_stretch(n):
    """The chain's closed forms, of any data: hinges along the chain make it a torsion chain, sliders a row of masses."""
    rng = np.random.default_rng(n)
    mass, inertia = rng.uniform(0.3, 4), tuple(rng.uniform(0.02, 0.03, 3))
    k, c = tuple(10 ** rng.uniform(1, 6, 6)), tuple(rng.uniform(0.01, 0.02, 6))
    twist, stretch = spectrum(n, k[5], inertia[2]), spectrum(n, k[2], mass)
    expected = {"R": twist, "P": stretch, "C": np.sort(np.r_[twist, stretch])}
    for joint, omega in expected.items():
        modes = mb.modes(examples.chain(n, joint, springs=2, mass=mass, inertia=inertia, k=k, c=c))
        assert np.abs(modes.omega / omega - 1).max() < 1e-11, joint
    # the damping of the modes of R is that of the torsion damper: zeta = c omega/(2 k)
    modes = mb.modes(examples.chain(n, mass=mass, inertia=inertia, k=k, c=c))
    assert modes.damping == pytest.approx(c[5] * twist / (2 * k[5]), rel=1e-9)


def test_geometry_of_the_tree():
    m = examples.from_code("TL7SF1")
    assert len(m.bodies) == 127 and m.name == "TL7SF1" and m.joints[0].type == "spherical"
    assert m.value("B6,32.at").tolist() == [32, 6, 0] and m["B6,1"].force("x").name == "B6,1.force.x"
    for i, j in ((2, 1), (3, 4), (5, 7)):
        for child, position, cotangent in ((2 * j - 1, (3 * j - 1) / 2, j - 1), (2 * j, 3 * j / 2, j)):
            name = f"J{i + 1},{child}"
            assert m.value(f"{name}.at_a").tolist() == [position, i + 0.5, 0]
            along = quaternion_matrix(m.value(f"{name}.orientation"))[:, 0]
            # Local x points along the link, from the parent to the child.
            link = m.value(f"B{i + 1},{child}.at") - m.value(f"B{i},{j}.at")
            assert along == pytest.approx(link / np.linalg.norm(link), abs=1e-14)
            assert along[0] / along[1] == pytest.approx(cotangent)


def test_geometry_of_the_ladder():
    m = examples.ladder(2)
    assert m.value("B2,1.at") == pytest.approx([-0.1, 0.3, 0])
    assert m.value("B2,3.at") == pytest.approx([0, 0.4, 0])
    assert quaternion_matrix(m.value("B2,3.orientation"))[:, 1] == pytest.approx([-1, 0, 0], abs=1e-15)
    assert m.value("J2,2a.at_a") == pytest.approx([0.1, 0.2, 0]) and m.value("J2,2b.at_a") == pytest.approx(
        [0.1, 0.4, 0]
    )


def test_sizes_are_taken():
    assert Absolute(tables(examples.cubic_hexapod(k=4e5))).frequencies()[0] == pytest.approx(31.830988618, rel=1e-9)
    assert examples.rotor(speed=7.0).value("disc.angular_velocity")[2] == 7.0
    assert examples.chain(2, gravity=(0, -9.81, 0)).gravity.tolist() == [0, -9.81, 0]
    assert examples.four_bar(width=2.0).value("D.at_a[0]") == 2.0


def unloaded_four_bar():
    m = examples.four_bar(gravity=0.0)
    m.set({"motor.value": (0, 0, 0), "pull.value": (0, 0, 0)})
    return m


@pytest.mark.parametrize(
    "build",
    [
        examples.cubic_hexapod,
        unloaded_four_bar,
        examples.quadruped,
        examples.stewart_platform,
        examples.wafer_stage,
        examples.rotor,
        *(
            lambda code=code: examples.from_code(code)
            for code in ("LL3RF1", "LL3CF1", "LL3SF2", "LL3PF1", "TL3SF1", "CL9PF1", "CL5SF1")
        ),
        lambda: examples.chain(7, along="x"),
        lambda: examples.chain(6, joint=None),
    ],
)
def test_the_core_agrees_with_absolute_coordinates(build):
    """Minimal coordinates of the core against a null space in absolute ones, both from the same Tables."""
    m = build()
    core = compiled(m)
    state = core.assemble()
    lin = core.linearize(state["q"], state["rate"], [], raw=True)
    L = np.linalg.cholesky(lin["M"])
    w2 = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, lin["S"]).T))
    expected = (2 * math.pi * Absolute(tables(m)).frequencies()) ** 2
    assert w2.shape == expected.shape
    error = np.abs(w2 - expected).max() / expected.max()
    print(f"{m.name}: {error:.1e}")
    assert error < 1e-11
