"""Junk at the border of the core, absurd models, changed models, pickles: nothing panics, hangs or lies."""

from __future__ import annotations

import pickle
import signal
import warnings
from contextlib import contextmanager

import jitter
import mbrs as mb
import numpy as np
import problems
import pytest
from mbrs import _core
from mbrs.errors import MbrsError
from mbrs.model.tables import tables
from mbrs.system.compiled import compiled
from mbrs.system.state import State
from random_models import (
    N_FREE,
    TREE_JOINTS,
    add_body,
    add_elements,
    add_joint,
    random_loop,
    random_quaternion,
    random_tree,
)

pytestmark = pytest.mark.filterwarnings("ignore")


@contextmanager
def bounded(seconds=60):
    """A hang becomes an error. The limit is far above what any of these needs: it finds loops without end, not slow code."""

    def stop(*_):
        raise TimeoutError(f"still running after {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def small():
    return problems.hanging_four_bar().model


# --- junk tables and states -----


@pytest.mark.parametrize(
    "change",
    [
        {"x": None},
        {"x": np.array([np.nan])},
        {"x": np.zeros((2, 2))},
        {"x": "abc"},
        {"body_name": []},
        {"body_x": np.array([10**9])},
        {"body_x": np.array([-1, 0, 0])},
        {"body_x": np.array([0.5, 0.5, 0.5])},
        {"joint_type": np.array([99, 1, 1, 1])},
        {"joint_a": np.array([77, 0, 0, 0])},
        {"joint_a": np.array([0, 0])},
        {"gravity_x": np.array([10**12])},
        {"load_body": np.array([-5])},
        {"law_owner": np.array([3, 4])},
        {"pose_body": np.array([9]), "pose_x": np.array([0])},
    ],
)
def test_junk_tables_are_refused(change):
    t = dict(tables(small()))
    t.update(change)
    with bounded(), pytest.raises((_core.CoreModelError, TypeError, ValueError)):
        _core.System(t)


# the first table of each of these says whether a model has any of them
OPTIONAL = ("pose", "marker", "function", "motion_type", "drive_joint", "load_motion_load", "coupler_first")


def test_missing_tables_are_named():
    for key in tables(small()):
        if key.startswith(OPTIONAL):
            continue
        t = dict(tables(small()))
        del t[key]
        with pytest.raises(_core.CoreModelError, match=key):
            _core.System(t)


@pytest.mark.parametrize(
    "q", [np.zeros(0), np.zeros(2), np.zeros(4), np.zeros((3, 1)), np.full(3, np.nan), np.full(3, np.inf)]
)
def test_junk_states_are_refused(q):
    m = small()
    for rate in (np.zeros(0), np.zeros(2), np.full(3, np.nan)):
        with bounded(), pytest.raises(MbrsError):
            mb.linearize(m, at=State(q, rate))


@pytest.mark.parametrize("at", [3, "drawn", [1, 2], object(), np.zeros((3, 12)), {"state": 1}])
def test_junk_for_at_is_refused_in_words(at):
    for analysis in (mb.linearize, mb.equilibrium, mb.modes):
        with pytest.raises(mb.ModelError, match="at= takes"):
            analysis(small(), at=at)


def test_a_state_of_another_model_is_refused():
    eq = mb.equilibrium(problems.spring_pendulum().model)
    with pytest.raises(mb.ModelError, match="compute it again"):
        mb.linearize(small(), at=eq)


@pytest.mark.parametrize("m", [None, 3, "model", np.eye(3), object(), {}])
def test_junk_for_a_model_is_refused(m):
    for analysis in (mb.linearize, mb.equilibrium, mb.System, mb.modes, mb.effects):
        with pytest.raises((mb.ModelError, TypeError)) as caught:
            analysis(m)
        assert str(caught.value)


@pytest.mark.parametrize("values", [np.zeros(3), np.full(10**6, 1.0), np.array([np.inf])])
def test_values_that_do_not_fit_are_refused(values):
    with pytest.raises(_core.CoreModelError):
        compiled(small()).with_values(values)


@pytest.mark.parametrize("parameters", [[], ["nobody.mass"], "left", ["left.mass", 3], [None], "left.inertia[9,9]", 5])
def test_junk_parameters_are_refused(parameters):
    lin = mb.linearize(small())
    with pytest.raises((mb.ModelError, TypeError)) as caught:
        mb.sensitivity(lin, parameters)
    assert str(caught.value)


def test_sensitivities_of_what_has_none_are_refused():
    for junk in (None, 3, small(), "modes"):
        with pytest.raises(mb.ModelError, match="no sensitivities"):
            mb.sensitivity(junk, "k")
    with pytest.raises(mb.ModelError, match="follow"):
        mb.sensitivity(mb.linearize(small()), "left.mass", equilibrium="maybe")


def test_an_empty_model_is_refused_by_every_analysis():
    m = mb.Model("empty")
    for analysis in (mb.linearize, mb.equilibrium, mb.System, mb.modes):
        with pytest.raises(mb.ModelError, match="no body"):
            analysis(m)


def test_a_freedom_without_inertia_is_named():
    """A point mass turning about itself."""
    m = mb.Model("massless")
    b = problems.point_mass(m, "bead", 1.0, (0, 0, 0))
    m.spherical("ball", m.ground, b, at=(0, 0, 0), k=(1, 1, 1))
    with pytest.raises(mb.SingularError, match="ball"):
        mb.modes(m)


def shrunk(length):
    """A spring at a state at which it is so long."""
    m = mb.Model("collapsed")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    m.prismatic("rail", m.ground, b, at=(1, 0, 0), axis="x")
    m.spring_damper("s", m.ground, b, at=((0, 0, 0), (1, 0, 0)), k=10.0)
    relative = mb.linearize(m).state.q
    return m, State(compiled(m).advance(relative, np.array([length - 1.0])), np.zeros(0))


@pytest.mark.parametrize("length", [0.0, 1e-13])
def test_a_spring_that_shrank_to_a_point_says_so(length):
    """Its direction is lost: an error or finite numbers, never NaN."""
    m, at = shrunk(length)
    with pytest.raises(MbrsError, match=r"'s'"):
        mb.linearize(m, at=at)


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
def test_a_spring_that_is_longer_than_rounding_has_a_direction():
    m, at = shrunk(1e-11)
    assert mb.linearize(m, at=at).K[0, 0] == pytest.approx(10.0, rel=1e-12)


def test_off_equilibrium_warns_with_the_acceleration():
    m = problems.level_rod().model
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(mb.MbrsWarning, match=r"not in balance.*'hinge'.*-14\.7"):
            mb.linearize(m)


# --- changed models and pickles -----


def test_m_set_keeps_the_topology():
    m = small()
    before = compiled(m)
    m.set({"left.mass": 2.0})
    after = compiled(m)
    assert after is not before and after.topology() == before.topology()
    m.body("new", mass=1.0, inertia=(1, 1, 1), at=(5, 5, 5))
    assert compiled(m).n_bodies == before.n_bodies + 1


def test_set_there_and_back_gives_the_same_numbers():
    m = small()
    f = mb.modes(m).frequency
    m.set({"left.mass": 3.0, "B.at": (0.01, -1, 0)})
    assert abs(mb.modes(m).frequency[0] - f[0]) > 1e-3
    m.set({"left.mass": 1.0, "B.at": (0.0, -1, 0)})
    assert np.array_equal(mb.modes(m).frequency, f)


def test_results_refuse_sensitivities_after_a_change():
    m = small()
    results = [
        mb.linearize(m),
        mb.modes(m),
        mb.equilibrium(m),
        mb.frf(m, inputs=m["left"].force("x"), outputs=m["left"].motion("x"), frequency=[1.0]),
    ]
    for r in results:
        mb.sensitivity(r, "left.mass")
    m.set({"left.mass": 2.0})
    for r in results:
        with pytest.raises(mb.ModelError, match=r"was changed after this .* was computed; compute it again"):
            mb.sensitivity(r, "left.mass")


def test_results_stay_as_they_were_after_a_change():
    m = small()
    lin, eq = mb.linearize(m), mb.equilibrium(m)
    K, reactions = lin.K.copy(), {k: v.copy() for k, v in eq.reactions.items()}
    masses, poses = lin.body_mass_matrices.copy(), eq.position("left").copy()
    m.set({"left.mass": 5.0, "right.at": (1.0, -0.6, 0)})
    assert np.array_equal(lin.K, K) and np.array_equal(eq.position("left"), poses)
    again = {k: v for k, v in eq.reactions.items()}
    assert all(np.array_equal(again[k], reactions[k]) for k in again)
    assert np.array_equal(lin.body_mass_matrices, masses)


def test_reactions_asked_for_after_a_change_are_those_of_then():
    m = small()
    eq, same = mb.equilibrium(m), mb.equilibrium(m)
    known = same.reactions["A"].copy()
    m.set({"left.mass": 5.0})
    assert np.array_equal(eq.reactions["A"], known)


def test_results_pickle():
    m = small()
    f = mb.frf(m, inputs=m["left"].force("x"), outputs=m["left"].motion("x"), frequency=[0.3, 1.0])
    for result in (mb.linearize(m), mb.modes(m), mb.equilibrium(m), f, mb.sensitivity(mb.modes(m), "left.mass")):
        back = pickle.loads(pickle.dumps(result))
        assert type(back) is type(result) and str(back) == str(result)
    eq = pickle.loads(pickle.dumps(mb.equilibrium(m)))
    assert np.array_equal(eq.reactions["A"], mb.equilibrium(m).reactions["A"])
    d = mb.sensitivity(pickle.loads(pickle.dumps(mb.linearize(m))), "left.mass")
    assert np.array_equal(d.K, mb.sensitivity(mb.linearize(m), "left.mass").K)


def test_a_pickled_result_of_a_changed_model_refuses_sensitivities():
    m = small()
    lin = mb.linearize(m)
    m.set({"left.mass": 2.0})
    with pytest.raises(mb.ModelError, match="changed"):
        mb.sensitivity(pickle.loads(pickle.dumps(lin)), "left.mass")


def test_results_save(tmp_path):
    for result in (mb.linearize(small()), mb.equilibrium(small()), mb.modes(small())):
        path = result.save(tmp_path / "result.pkl")
        assert str(pickle.loads(path.read_bytes())) == str(result)


# --- fuzz -----


def decades(rng, low, high):
    return float(10.0 ** rng.uniform(low, high))


def absurd_model(rng):
    """A random tree or loop with every number scaled by decades of its own."""
    if rng.random() < 0.3:
        kinds = [
            "spherical",
            *rng.choice(("universal", "cylindrical", "revolute", "planar", "prismatic"), 2),
            "spherical",
        ]
        m = random_loop(rng, [str(k) for k in kinds], rod=bool(rng.random() < 0.3), moving=bool(rng.random() < 0.2))
    else:
        m = random_tree(
            rng, int(rng.integers(1, 4)), moving=bool(rng.random() < 0.2), slack=0.2 * float(rng.random() < 0.3)
        )
    changes = {}
    for item in m.items.values():
        for name, field in item.fields().items():
            if name in ("k", "c", "preload", "mass", "inertia", "value", "velocity") and field.kind == "plain":
                changes[f"{item.name}.{name}"] = m.value(f"{item.name}.{name}") * decades(rng, -9, 9)
    m.set(changes)
    return m


def analyses(m):
    yield lambda: mb.System(m)
    yield lambda: mb.linearize(m)
    yield lambda: mb.modes(m)
    yield lambda: mb.equilibrium(m)


@pytest.mark.some(1)
@pytest.mark.parametrize("part", [pytest.param(1, marks=pytest.mark.slow), 0, 2])
def test_absurd_scales(part):
    """Results are finite or an error says in words why not."""
    refused = {}
    for seed in range(20):
        rng = np.random.default_rng([50, part, seed])
        m = absurd_model(rng)
        for run in analyses(m):
            with bounded():
                try:
                    result = run()
                except MbrsError as error:
                    assert "internal error" not in str(error), f"seed {part}, {seed}: {error}"
                    refused[type(error).__name__] = refused.get(type(error).__name__, 0) + 1
                    continue
            check_finite(result)
    print(f"absurd models refused: {refused}")


def check_finite(result):
    kind = type(result).__name__
    if kind == "Linearization":
        assert all(np.all(np.isfinite(a)) for a in (result.M, result.K, result.T))
    elif kind == "ModalResult":
        assert np.all(np.isfinite(result.roots)) and np.all(np.isfinite(result.shape))
        assert result.n == len(result.coordinates)
    elif kind == "Equilibrium":
        assert np.all(np.isfinite(result.poses["position"])) and result.residual < 1e-6


def random_small_model(rng):
    """One to three bodies on any joints, with springs, dampers and now and then a loop through a rod."""
    m = mb.Model("small")
    handles, places = [m.ground], [np.zeros(3)]
    damped = rng.random() < 0.6
    for i in range(int(rng.integers(1, 4))):
        j = int(rng.integers(len(handles)))
        here = places[j] + rng.normal(size=3)
        b = add_body(m, rng, f"b{i}", here)
        kind = str(rng.choice(TREE_JOINTS))
        n = N_FREE[kind]
        forces = {"k": rng.random(n) * rng.choice([0.0, 1.0, 100.0])} if n else {}
        if n and damped:
            forces["c"] = rng.random(n) * rng.choice([0.01, 1.0])
        ends = (handles[j], b) if rng.random() < 0.5 else (b, handles[j])
        frame = {"orientation": random_quaternion(rng)}
        getattr(m, kind)(f"j{i}", *ends, at=0.5 * (places[j] + here), **frame, **forces)
        if rng.random() < 0.5:
            m.spring_damper(
                f"s{i}",
                m.ground,
                b,
                at=(places[j] + 2.0, here),
                k=rng.random() * 50,
                c=rng.random() if damped else None,
            )
        handles.append(b)
        places.append(here)
    if len(handles) > 2 and rng.random() < 0.2:
        m.distance("rod", handles[1], handles[-1], at=(places[1] + 0.3, places[-1] - 0.4))
    return m


def ratio(modes, M, D, S):
    """LAPACK's test ratio of the pairs, |Q(s) phi| / ((|s|^2 |M| + |s| |D| + |S|) |phi| n eps), in coordinates of unit mass."""
    n = len(M)
    L = np.linalg.cholesky(M)
    hat = [np.linalg.solve(L, np.linalg.solve(L, a.T).T) for a in (M, D, S)]
    phi = L.T @ modes.shape
    norms = [np.linalg.norm(a) for a in hat]
    worst = 0.0
    for s, v in zip(modes.eigenvalue, phi.T, strict=True):
        r = s * s * (hat[0] @ v) + s * (hat[1] @ v) + hat[2] @ v
        size = (abs(s) ** 2 * norms[0] + abs(s) * norms[1] + norms[2]) * np.linalg.norm(v)
        worst = max(worst, np.linalg.norm(r) / (size * n * np.finfo(float).eps) if size > 0 else 0.0)
    return worst


def stiffness(m, name):
    """The sum of an object's stiffnesses, if it was defined with any."""
    try:
        return float(np.sum(m.value(f"{name}.k")))
    except mb.NameNotFoundError:
        return 0.0


def noise_of_stiffness(m, lin):
    """What noise on the numbers of a model allows the ratio more: that of the terms k l^2 that cancel in K, in coordinates of unit
    mass. A spring drawn at its natural length then has a force, and that turns a rigid direction.
    """
    L = np.linalg.cholesky(lin.M)
    lever = 1 + max(np.abs(lin.poses["position"]).max(), 2.0) ** 2
    terms = (
        sum(stiffness(m, held.name) for held in (*m.elements, *m.joints))
        * lever
        * np.linalg.norm(np.linalg.solve(L, lin.T.T)) ** 2
    )
    size = np.linalg.norm(np.linalg.solve(L, np.linalg.solve(L, lin.K).T))
    return jitter.level() * terms / (size * lin.n * np.finfo(float).eps) if size > 0 else 0.0


@pytest.mark.parametrize("part", [pytest.param(n, marks=pytest.mark.slow if n else ()) for n in range(50)])
def test_ten_thousand_random_models(part):
    """As many modes as degrees of freedom, ratio below 30, in every one."""
    largest, dofs = 0.0, 0
    for model in range(200 * part, 200 * (part + 1)):
        rng = np.random.default_rng([60, *divmod(model, 1000)])
        m = random_small_model(rng)
        lin = mb.linearize(m)
        if lin.n == 0:
            continue
        modes = mb.modes(lin)
        assert modes.n == lin.n == len(modes.frequency) and len(modes.roots) == 2 * lin.n
        if jitter.seed() is not None and modes.status == "unresolved":
            continue  # noise has parted roots that are one, and the result tells that they are not resolved
        zero = np.zeros_like(lin.M)
        D = sum((a for a in (lin.C, lin.G) if a is not None), zero)
        S = lin.K if lin.N is None else lin.K + lin.N
        one = ratio(modes, lin.M, D, S)
        assert one < 30 + noise_of_stiffness(m, lin), f"model {model}: ratio {one:.3g}, {modes.stats.route}"
        largest, dofs = max(largest, one), dofs + lin.n
    print(f"200 models, {dofs} degrees of freedom: largest ratio {largest:.2f}")


def test_all_kinds_of_joints_with_everything_at_once():
    """One model with every joint and every element type in it."""
    rng = np.random.default_rng(70)
    m = mb.Model("zoo")
    before, place = m.ground, np.zeros(3)
    for i, kind in enumerate(TREE_JOINTS):
        here = place + rng.normal(size=3)
        b = add_body(m, rng, f"b{i}", here)
        add_joint(m, rng, kind, f"j{i}", before, b, 0.5 * (here + place))
        add_elements(m, rng, str(i), before, b, here)
        before, place = b, here
    lin = mb.linearize(m)
    assert lin.n == sum(N_FREE.values())
    assert np.all(np.linalg.eigvalsh(lin.M) > 0)
