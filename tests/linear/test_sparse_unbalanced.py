"""The sparse route of large models out of balance: its matrices on the motions that the joints allow are those of the dense route, which
has them from tree coordinates, and of the NumPy reference. All data are invented."""

from __future__ import annotations

import time
from dataclasses import replace

import mbrs as mb
import numpy as np
import pytest
from agreement import advanced, difference
from flexed import flexed, flexible_bodies_of
from flexible_models import four_bar, hanging_by_the_tip, pendulum
from mbrs import _core
from mbrs.linear.sparse_modes import model_modes
from mbrs.model.layout import BODY
from random_models import TREE_JOINTS, add_body, add_elements, add_loads, random_loop, random_tree
from test_sparse_general import FEATURES, UNITS, Chain, compare

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")


def cases(names, values):
    """Each name with one of the values; with the others it is slow."""
    marks = [(), (pytest.mark.slow,)]
    return [
        pytest.param(name, value, marks=marks[(i + j) % len(values) != 0])
        for i, name in enumerate(names)
        for j, value in enumerate(values)
    ]


UNIT = list(UNITS.values())


def motions(lin):
    """(n_absolute, dof) the coordinates of the sparse form, bodies about their centres of mass, per minimal coordinate."""
    tables, place = lin.snapshot.tables, BODY.block.slice("com")
    com = np.array([tables["x"][start:][place] for start in tables["body_x"]])
    arm = np.einsum("nij,nj->ni", lin.poses["rotation"], com)
    twist = lin.twists.copy()
    twist[:, :3] += np.cross(twist[:, 3:], arm[:, :, None], axis=1)
    return twist, lin.modal_map


def projected(m, at=None, without=()):
    """M, D and S of the sparse form on the motions that the joints allow, and the dense ones."""
    lin = mb.linearize(m, at=at, without=without)
    state = lin.state
    form = _core.sparse_model_form(lin.snapshot.system, state.q, state.rate, state.acceleration.tolist(), list(without))
    twist, modal = motions(lin)
    size = len(form["body"]) - len(modal)
    T = np.vstack([twist[form["body"][:size:6]].reshape(size, -1), modal])

    def reduced(key):
        i, j, v = form[key]
        full = np.zeros((len(T), len(T)))
        np.add.at(full, (i, j), v)
        return T.T @ full @ T

    i, j, v = form["rows"]
    rows = np.zeros((len(form["compliance"]), len(T)))
    np.add.at(rows, (i, j), v)
    rows, compliance = rows @ T, form["compliance"]
    elastic = compliance > 0.0
    held = np.abs(rows[~elastic]).max(initial=0.0)
    assert held < 1e-9 * max(1.0, np.abs(T).max()), "the motions break a constraint"
    S = reduced("stiffness") + (rows[elastic].T / compliance[elastic]) @ rows[elastic]
    found = {"M": reduced("mass"), "D": reduced("damping"), "S": S}
    zero = np.zeros_like(lin.M)
    C, G, N = (zero if x is None else x for x in (lin.C, lin.G, lin.N))
    return found, {"M": lin.M, "D": C + G, "S": lin.K + N}, lin


def agree(m, at=None, without=(), tol=1e-12):
    found, expected, lin = projected(m, at, without)
    scale = 1.0 / np.sqrt(np.diag(lin.M))
    for name, e in expected.items():
        e, a = (scale[:, None] * x * scale for x in (e, found[name]))
        error = np.abs(a - e).max(initial=0.0) / max(np.abs(e).max(initial=0.0), 1e-300)
        if np.abs(e).max(initial=0.0) == 0.0:
            error = np.abs(a).max(initial=0.0)
        print(f"{name} {error:.1e}, out of balance {lin.error:.1e}")
        assert error < tol, name
    return lin


def with_screws(rng, n, loose):
    """Bodies on screws and universal joints in a chain, half of them reversed, under all loads and elements; ``loose``: without a joint to
    ground."""
    m = mb.Model("screws", gravity=rng.normal(size=3) * (1, 9, 1))
    last, here = m.ground, np.zeros(3)
    for i in range(n):
        body, at = add_body(m, rng, f"b{i}", here + rng.normal(size=3)), here
        ends = (last, body) if rng.random() < 0.5 else (body, last)
        axis = rng.normal(size=3)
        if i == 0 and loose:
            pass
        elif i % 2:
            m.screw(f"j{i}", *ends, at=at, axis=axis, pitch=rng.normal() * 0.3, k=5.0)
        else:
            m.universal(f"j{i}", *ends, at=at, axis=axis, axis2=np.cross(axis, rng.normal(size=3)), k=(6.0, 7.0))
        add_elements(m, rng, str(i), *ends, at)
        add_loads(m, rng, str(i), body, at)
        last, here = body, here + rng.normal(size=3)
    return m


@pytest.mark.some(4)
@pytest.mark.parametrize("kind, followers", cases(TREE_JOINTS, (False, True)))
def test_trees(kind, followers):
    """Each kind of joint beside every other, forwards and reversed."""
    rng = np.random.default_rng([TREE_JOINTS.index(kind), followers])
    m = random_tree(rng, 6, (kind, *rng.choice(TREE_JOINTS, 2)), each=True, followers=followers)
    lin = agree(m)
    assert lin.error > 1e-3
    at = advanced(m, rng, 0.4)
    agree(m, at)
    agree(m, at, ("constraint-force-stiffness",))
    assert max(difference(m, at).values()) < 1e-9


@pytest.mark.parametrize("loose", [False, True])
def test_screws(loose):
    rng = np.random.default_rng(loose)
    m = with_screws(rng, 6, loose)
    agree(m)
    agree(m, advanced(m, rng, 0.4))


LOOPS = [
    (("spherical", "universal", "cylindrical", "spherical"), True),
    (("universal", "spherical", "spherical", "planar"), True),
    (("spherical", "prismatic", "spherical", "cylindrical"), False),
    (("revolute", "free", "universal", "planar", "spherical"), False),
]


@pytest.mark.parametrize("kinds, rod", LOOPS)
def test_loops(kinds, rod):
    rng = np.random.default_rng([len(kinds[0]), rod])
    m = random_loop(rng, kinds, rod=rod, followers=bool(rng.integers(2)))
    agree(m)
    at = advanced(m, rng, 0.1)
    agree(m, at)
    assert max(difference(m, at).values()) < 1e-9


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", [0, 3, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_flexible_bodies(seed):
    rng = np.random.default_rng(seed)
    m = random_tree(
        rng, 5, ("planar", "spherical", "universal", "prismatic", "revolute"), each=True, followers=seed > 1
    )
    m = flexed(m, str(rng.choice(flexible_bodies_of(m))), 30.0)
    at = advanced(m, rng, 0.1)
    for without in ((), ("preload-stiffness",), ("constraint-force-stiffness",)):
        agree(m, at, without)
        assert max(difference(m, at, without).values()) < 1e-9
    agree(m)


@pytest.mark.parametrize("without", [(), ("preload-stiffness",), ("constraint-force-stiffness",)], ids=str)
@pytest.mark.parametrize("made", [pendulum, hanging_by_the_tip, four_bar])
def test_nodes_that_move_in_second_order(made, without):
    m = made()
    agree(m, advanced(m, np.random.default_rng(3), 0.05), without)


@pytest.mark.parametrize("c, unit", cases((0.0, 1e-4), UNIT))
def test_roots_and_shapes(c, unit):
    """The modes of a drawn chain, with and without dampers."""
    made = Chain(4, unit, c=c, kinds=("revolute", "planar", "universal", "prismatic", "spherical"))
    assert mb.linearize(made.model).error > 1e-2
    compare(made.model)


@pytest.mark.parametrize("name, unit", cases(FEATURES, UNIT))
def test_features(name, unit):
    """Drives, couplers, functions, followers, rolling, cut loops."""
    made = Chain(5, unit, c=1e-4)
    FEATURES[name](made, made.length * made.mass)
    agree(made.model)


def test_a_rolling_disc():
    made = Chain(2, UNITS["mm, t"])
    normal, wheel, radius = made.turn[:, 2], made.body("wheel", made.end), 0.2 * made.length
    made.model.bushing("axle", "b29", wheel, at=made.end, k=made.stiffness("bushing"))
    ends, axis2 = (made.end - radius * normal, made.end), made.turn @ [0.6, 0.8, 0.0]
    made.model.rolling_disc("roll", made.model.ground, wheel, at=ends, axis=normal, axis2=axis2, radius=radius)
    agree(made.model)


@pytest.mark.parametrize("seed, unit", cases(range(2), UNIT))
def test_states_that_move(seed, unit):
    """The lowest roots of a state with rates that no force keeps up."""
    made = Chain(seed, unit, n=18, kinds=("revolute", "universal", "planar", "prismatic", "spherical"))
    m, names = made.model, mb.linearize(made.model).coordinates
    size, length = np.abs(mb.modes(m).eigenvalue[0]), made.length
    scale = np.array(
        [
            length if name.endswith((".x", ".y")) or made.kinds[int(name[1:].split(".")[0]) % 5] == "prismatic" else 1.0
            for name in names
        ]
    )
    at = replace(advanced(m, made.rng, 0.0), rate=0.02 * size * scale * made.rng.normal(size=len(names)))
    dense, found = mb.modes(m, at=at), model_modes(m, at, 4, (), time.perf_counter())
    error = np.abs(found.eigenvalue - dense.eigenvalue[:4]) / np.abs(dense.eigenvalue[:4])
    print(f"{error.max():.1e}, estimate {found.error.max():.1e}, out of balance {mb.linearize(m, at=at).error:.1e}")
    assert error.max() < 1e-9
