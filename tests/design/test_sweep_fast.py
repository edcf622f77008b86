"""The fast path of sweeps: designs computed in the core are those that Python computes one by one, failures and remarks included."""

from __future__ import annotations

import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.design.fast import FastPlan, fast_plan
from random_models import random_loop, random_tree

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")


def parametric(m, rng):
    """Expressions of parameters drive numbers of some elements."""
    mass, k = m.parameter("extra", 1.3), m.parameter("k", [3.1, 4.7])
    top = m.body("top", mass=mass * 0.9 + 0.2, inertia=(0.31, 0.42, 0.37), at=rng.normal(size=3))
    m.spherical(
        "ball",
        m.bodies[0],
        top,
        at=rng.normal(size=3),
        k=np.sqrt(k[0] * k[1]) * np.array([1.0, 1.7, 0.6]),
        c=[0.07 * k[1], 0.05, 0.09 * k[0]],
    )
    m.spring_damper("tie", m.ground, top, at=(rng.normal(size=3), rng.normal(size=3) + 2.0), k=k[0] ** 2, c=0.11)
    return m


def tree(rng, **given):
    return parametric(random_tree(rng, 3, each=True, kinds=("spherical", "cylindrical", "revolute"), **given), rng)


def loop(rng, **given):
    return parametric(random_loop(rng, ("revolute", "spherical", "universal", "cylindrical"), **given), rng)


SET = {
    "extra": (0.9, 1.9),
    "k[0]": (2.0, 4.0),
    "b0.mass": (1.1, 2.1),
    "b1.com[2]": (-0.2, 0.3),
    "spring0.k": (5.0, 9.0),
}
BY = ["k", "b0.mass", "extra", "bush0.k[0,3]", "b1.at[1]", "bush0.c", "spring0.at_b[0]"]


def python_alone(outputs):
    """The same outputs by a function, which no fast path knows."""
    return lambda model: outputs(model)


def computed(m, designs, outputs):
    """How many designs the core computes by itself."""
    fast = fast_plan(m.copy, designs.names, outputs)
    assert fast is not None
    done, at = [], 0
    while at < len(designs):
        block = fast.compute(designs.values[at:])
        done += block.computed.tolist()
        at += len(block.computed)
    return np.array(done)


CASES = {
    "tree": lambda rng: tree(rng),
    "tree of potential forces": lambda rng: tree(rng, followers=False),
    "moving tree": lambda rng: tree(rng, moving=True),
    "loop": lambda rng: loop(rng),
    "moving loop": lambda rng: loop(rng, moving=True),
}


@pytest.mark.some(3)
@pytest.mark.parametrize("name", CASES)
def test_the_core_computes_what_python_computes(name):
    m = CASES[name](np.random.default_rng(41))
    designs = mb.design.latin_hypercube(SET, 9, seed=7)
    outputs = mb.outputs.modes(n=4, sensitivities=BY)
    assert computed(m, designs, outputs).all()
    fast, slow = mb.sweep(m, designs, outputs), mb.sweep(m, designs, python_alone(outputs))
    assert fast.done.all() and slow.done.all() and set(fast.outputs) == set(slow.outputs)
    for key, expected in slow.outputs.items():
        scale = np.nanmax(np.abs(expected), axis=(0, 1), keepdims=True)
        assert np.array_equal(np.isnan(fast[key]), np.isnan(expected))
        assert (
            fast[key] == pytest.approx(expected, rel=1e-10, abs=0, nan_ok=True)
            or np.nanmax(np.abs(fast[key] - expected) / np.where(scale > 0, scale, 1)) < 1e-12 + 100 * jitter.level()
        )


FREQUENCIES = np.linspace(0.05, 1.5, 7)
PORTS = {
    "forces": (
        ["b0.force.x", "b1.torque.z", "spot.force.y"],
        ["b1.motion.z", "b0.motion.rx", "spot.motion.x"],
        "mobility",
    ),
    "points": (["b0.force.(0.6,0,0.8)@(0.3,1,0.2)"], ["b1.motion.(0,1,0)@(0.1,0.2,0.5)", "b0.motion.y"], "receptance"),
    "base": (["base.z", "b1.force.x"], ["b0.motion.z", "b1.motion.rx", "spot.motion.y"], "accelerance"),
    "transmissibility": (["base.x"], ["b1.motion.x"], "transmissibility"),
}


@pytest.mark.some(3)
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("ports", PORTS)
def test_transfer_functions_are_those_of_python(closed, ports):
    m = (loop if closed else tree)(np.random.default_rng(17))
    m.marker("spot", "b0", at=(0.3, -0.4, 0.9))
    inputs, seen, kind = PORTS[ports]
    designs = mb.design.latin_hypercube({**SET, "spot.at[1]": (-0.6, 0.1)}, 4, seed=3)
    by = ["k", "b0.mass", "b1.at[1]", "bush0.c", "spring0.at_b[0]", "spot.at[0]", "b0.com[1]"]
    outputs = mb.outputs.frf(inputs, seen, FREQUENCIES, kind, sensitivities=by)
    assert computed(m, designs, outputs).all()
    fast, slow = mb.sweep(m, designs, outputs), mb.sweep(m, designs, python_alone(outputs))
    assert slow.done.all() and fast["H"].shape == (4, len(seen), len(inputs), len(FREQUENCIES))
    for key in ("H", "H_derivative"):
        scale = np.abs(slow[key]).max(axis=3, keepdims=True) + 1e-3 * np.abs(slow[key]).max()
        assert fast[key].dtype == complex
        assert np.all(np.abs(fast[key] - slow[key]) <= (1e-11 + 1e3 * jitter.level()) * scale)


def test_a_transfer_function_follows_its_parameters():
    """x = F / (k - m w^2 + i w c) of one slider, without damping as well, and its slopes."""
    m = mb.Model("one")
    k, c = m.parameter("k", 310.0), m.parameter("c", 0.0)
    a = m.body("a", mass=1.3, inertia=(0.1, 0.1, 0.1), at=(0.2, 0.1, 0.0))
    axis = np.array([0.3, -0.5, 0.81]) / np.linalg.norm([0.3, -0.5, 0.81])
    m.prismatic("rail", m.ground, a, at=(0.2, 0.1, 0.0), axis=axis, k=k, c=c)
    f = np.array([0.7, 1.9, 4.4])
    designs = mb.design.from_table({"k": np.array([300.0, 350.0]), "c": np.array([0.0, 2.0])})
    outputs = mb.outputs.frf(a.force(axis), a.motion(axis), f, sensitivities=["k", "c", "a.mass"])
    assert computed(m, designs, outputs).all()
    for runs in (mb.sweep(m, designs, outputs), mb.sweep(m, designs, python_alone(outputs))):
        for i, (k, c) in enumerate(designs.values):
            w = 2 * np.pi * f
            h = 1.0 / (k - 1.3 * w**2 + 1j * w * c)
            assert runs["H"][i, 0, 0] == pytest.approx(h, rel=1e-10)
            slopes = np.stack([-(h**2), -1j * w * h**2, w**2 * h**2], axis=1)
            assert runs["H_derivative"][i, 0, 0] == pytest.approx(slopes, rel=1e-10)


def test_missed_and_infinite_resonances_are_told():
    m = mb.Model("one")
    a = m.body("a", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0.0, 0.0, 0.0))
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis="x", k=m.parameter("k", 400.0))
    designs = mb.design.from_table({"k": np.array([400.0, 410.0])})
    for points, text in (([1.0, 9.0], "miss 1 resonance"), ([0.5, 1.0], "")):
        outputs = mb.outputs.frf(a.force("x"), a.motion("x"), points)
        assert computed(m, designs, outputs).all()
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            mb.sweep(m, designs, outputs)
        assert [text in str(w.message) for w in told] == [True] * bool(text)


def test_places_at_rest_are_those_of_python():
    m = hanging(np.random.default_rng(5))
    designs = mb.design.latin_hypercube({"b0.mass": (1.1, 1.9), "b1.com[0]": (-0.1, 0.2)}, 6, seed=2)
    outputs = mb.outputs.equilibrium(["b0.mass", "mount1.k[2]", "b1.com[1]"])
    assert computed(m, designs, outputs).any()
    fast, slow = mb.sweep(m, designs, outputs), mb.sweep(m, designs, python_alone(outputs))
    assert np.array_equal(fast.codes, slow.codes) and fast.done.any() and set(fast.outputs) == set(slow.outputs)
    for key in slow.outputs:
        assert fast[key].shape == slow[key].shape
        assert fast[key] == pytest.approx(slow[key], rel=1e-8, abs=1e-9, nan_ok=True)


def hanging(rng):
    m = random_tree(rng, 3, each=True, kinds=("spherical", "revolute", "cylindrical"), followers=False)
    m.parameter("extra", 1.0)
    return m


def test_equilibria_are_followed():
    m = hanging(np.random.default_rng(5))
    designs = mb.design.latin_hypercube({"b0.mass": (1.1, 1.9), "spring1.k": (6.0, 9.0)}, 6, seed=2)
    outputs = mb.outputs.modes(n=3, sensitivities=["b0.mass", "mount1.k[2]", "spring1.k"], at="equilibrium")
    assert computed(m, designs, outputs).any()
    fast, slow = mb.sweep(m, designs, outputs), mb.sweep(m, designs, python_alone(outputs))
    assert np.array_equal(fast.codes, slow.codes) and fast.done.any()
    for key in slow.outputs:
        assert fast[key] == pytest.approx(slow[key], rel=1e-8, abs=1e-9, nan_ok=True)


def test_derivatives_are_those_of_closed_forms():
    """Two masses in a row: w^2 of [[k1 + k2, -k2], [-k2, k2]] over the masses, and its slopes by perturbation in closed form."""
    m = mb.Model("two")
    k1, ratio = m.parameter("k1", 310.0), m.parameter("ratio", 0.7)
    axis = np.array([0.3, -0.5, 0.81])
    a = m.body("a", mass=1.3, inertia=(0.1, 0.1, 0.1), at=(0.2, 0.1, 0.0))
    b = m.body("b", mass=0.6, inertia=(0.1, 0.1, 0.1), at=(0.9, 0.4, -0.3))
    m.prismatic("first", m.ground, a, at=(0.2, 0.1, 0.0), axis=axis, k=k1)
    m.prismatic("second", a, b, at=(0.9, 0.4, -0.3), axis=axis, k=k1 * ratio)
    designs = mb.design.latin_hypercube({"k1": (200.0, 900.0), "ratio": (0.4, 1.6), "b.mass": (0.3, 2.0)}, 12, seed=9)
    outputs = mb.outputs.modes(sensitivities=["k1", "ratio", "b.mass"])
    assert computed(m, designs, outputs).all()
    runs = mb.sweep(m, designs, outputs)
    for i in range(12):
        k, r, mass = designs.values[i]
        K, M = k * np.array([[1 + r, -r], [-r, r]]), np.diag([1.3, mass])
        root = np.diag(1 / np.sqrt(np.diag(M)))
        w2, v = np.linalg.eigh(root @ K @ root)
        phi = root @ v
        f = np.sqrt(w2) / (2 * np.pi)
        assert runs["frequency"][i] == pytest.approx(f, rel=1e-12)
        changes = [(K / k, 0 * K), (k * np.array([[1.0, -1.0], [-1.0, 1.0]]), 0 * K), (0 * K, np.diag([0.0, 1.0]))]
        for p, (dK, dM) in enumerate(changes):
            slope = np.array([phi[:, j] @ (dK - w2[j] * dM) @ phi[:, j] for j in range(2)]) / (2 * np.sqrt(w2))
            assert runs["frequency_derivative"][i, :, p] == pytest.approx(slope / (2 * np.pi), rel=1e-10)


@pytest.mark.exact
def test_bits_do_not_depend_on_blocks_chunks_or_threads():
    m = loop(np.random.default_rng(3))
    designs = mb.design.latin_hypercube(SET, 40, seed=1)
    outputs = mb.outputs.modes(n=5, sensitivities=BY[:3])
    plain = mb.sweep(m, designs, outputs)
    assert fast_plan(m.copy, designs.names, outputs).decides  # then all threads are of the core
    with ThreadPoolExecutor(2) as threads:
        for executor, chunk in ((None, 1), (None, 17), (2, 7), (3, 3), (2, 40), (5, 40), (threads, 9)):
            again = mb.sweep(m, designs, outputs, executor=executor, chunk=chunk)
            assert all(again[key].tobytes() == plain[key].tobytes() for key in plain.outputs)


@pytest.mark.exact
def test_bits_of_other_analyses_do_not_depend_on_threads():
    m = loop(np.random.default_rng(3))
    designs = mb.design.latin_hypercube(SET, 12, seed=1)
    for outputs in (
        mb.outputs.frf("b0.force.x", "b1.motion.y", [0.1, 0.4], sensitivities=BY[:2]),
        mb.outputs.equilibrium(BY[:2]),
    ):
        plain = mb.sweep(m, designs, outputs)
        again = mb.sweep(m, designs, outputs, executor=3)
        assert all(again[key].tobytes() == plain[key].tobytes() for key in plain.outputs)


def test_designs_that_fail_do_so_with_the_same_words():
    m = tree(np.random.default_rng(8))
    good = mb.design.latin_hypercube({**SET, "b0.inertia[0,0]": (0.4, 0.6), "tie.at_a[0]": (0.1, 0.2)}, 8, seed=4)
    values = good.values.copy()
    names = list(good.names)
    values[1, names.index("b0.mass")] = -1.0
    values[3, names.index("b0.inertia[0,0]")] = 1e3
    values[4, names.index("extra")] = -4.0  # an expression makes a negative mass
    values[6, names.index("k[0]")] = -1.0  # and the root of a negative number
    designs = mb.design.from_table({name: values[:, j] for j, name in enumerate(names)})
    outputs = mb.outputs.modes(n=3, sensitivities=["k", "b0.mass"])
    done = computed(m, designs, outputs)
    assert done[[0, 2, 5, 7]].all() and not done[[1, 3, 4, 6]].any()
    fast, slow = mb.sweep(m, designs, outputs), mb.sweep(m, designs, python_alone(outputs))
    assert [(f.design, f.error, f.object, f.message) for f in fast.failed] == [
        (f.design, f.error, f.object, f.message) for f in slow.failed
    ]
    assert {f.design for f in fast.failed} == {1, 3, 4, 6}
    assert fast["frequency"][fast.done] == pytest.approx(slow["frequency"][slow.done], rel=1e-11)


@pytest.mark.parametrize("executor", [None, 2])
def test_a_design_that_cannot_assemble_is_a_failure(executor):
    """The four-bar of three rods of length one: its last joint is too far away from four metres on."""
    m = mb.Model("four-bar", gravity=(0, -9.81, 0))
    upright = mb.rotation("z", np.pi / 2)
    a = m.body("crank", mass=1.0, inertia=(1e-3, 1 / 12, 1 / 12), at=(0, 0.5, 0), orientation=upright)
    b = m.body("coupler", mass=1.0, inertia=(1e-3, 1 / 12, 1 / 12), at=(0.5, 1, 0))
    c = m.body("rocker", mass=1.0, inertia=(1e-3, 1 / 12, 1 / 12), at=(1, 0.5, 0), orientation=upright)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z", k=5.0)
    m.revolute("B", a, b, at=(0, 1, 0), axis="z")
    m.revolute("C", b, c, at=(1, 1, 0), axis="z")
    m.revolute("D", c, m.ground, at=((1, 0, 0), (1, 0, 0)), axis="z")
    designs = mb.design.from_table({"D.at_b[0]": np.array([1.0, 4.0, 1.2])})
    outputs = mb.outputs.modes()
    runs = mb.sweep(m, designs, outputs, executor=executor)
    slow = mb.sweep(m, designs, python_alone(outputs))
    assert runs.done.tolist() == slow.done.tolist() == [True, False, True]
    assert [f.error for f in runs.failed] == ["AssemblyError"] and runs.failed == slow.failed


def free_pair(light=0.7):
    m = mb.Model("free pair")
    a = m.body("a", mass=1.1, inertia=(0.1, 0.2, 0.25), at=(0.1, 0.2, 0.3))
    b = m.body("b", mass=light, inertia=(0.1 * light, 0.12 * light, 0.15 * light), at=(0.9, -0.4, 0.2))
    m.bushing("link", a, b, at=(0.5, 0.1, 0.2), k=[11.0, 13.0, 17.0, 3.0, 5.0, 4.0])
    return m


@pytest.mark.parametrize("light", [0.7, 1e-7])
@pytest.mark.parametrize("soft", [1.0, 1e-11])
def test_rigid_and_graded_modes_know_the_factors_of_the_model(light, soft):
    m = free_pair(light)
    m.torsion("hold", m.ground, "a", at=(0, 0, 0), axis=(0.3, 0.5, -0.2), k=soft)
    designs = mb.design.latin_hypercube({"link.k[1]": (5.0, 20.0)}, 4, seed=1)
    outputs = mb.outputs.modes(sensitivities=["link.k[0]", "hold.k"])
    assert computed(m, designs, outputs).all()
    fast, slow = mb.sweep(m, designs, outputs), mb.sweep(m, designs, python_alone(outputs))
    assert np.all(np.sum(fast["frequency"] == 0.0, axis=1) == 5)
    for key in slow.outputs:
        assert fast[key] == pytest.approx(slow[key], rel=1e-9, abs=1e-12 * np.nanmax(np.abs(slow[key])), nan_ok=True)


def test_a_stiffness_that_may_hold_weight_is_left_to_python():
    m = mb.Model("weighed", gravity=(0.0, 0.0, 0.0))
    a = m.body("a", mass=1.1, inertia=(0.1, 0.2, 0.25), at=(0.1, 0.2, 0.3))
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis=(0.3, 0.5, -0.2))
    designs = mb.design.from_table({"gravity[0]": np.array([0.0, 1.0])})
    assert not computed(m, designs, mb.outputs.modes()).any()
    runs = mb.sweep(m, designs, mb.outputs.modes())
    assert runs.done.all() and np.all(runs["frequency"] == 0.0)


def test_remarks_are_told_and_can_be_errors():
    m = tree(np.random.default_rng(12))
    designs = mb.design.latin_hypercube({"b0.mass": (1.0, 2.0)}, 3, seed=1)
    outputs = mb.outputs.modes(n=2)
    with pytest.warns(mb.MbrsWarning, match="not in balance"):
        assert mb.sweep(m, designs, outputs).done.all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runs = mb.sweep(m, designs, outputs)
    assert not runs.done.any() and {f.error for f in runs.failed} == {"MbrsWarning"}


def test_what_is_done_before_an_interrupt_is_kept(monkeypatch):
    m = tree(np.random.default_rng(21))
    designs = mb.design.latin_hypercube(SET, 30, seed=6)
    outputs = mb.outputs.modes(n=2)
    whole = mb.sweep(m, designs, outputs)
    real, blocks = FastPlan.compute, []

    def cut(self, values, threads=1):
        if len(blocks) == 3:
            raise KeyboardInterrupt
        blocks.append(len(values))
        return real(self, values, threads)

    monkeypatch.setattr(FastPlan, "compute", cut)
    with pytest.raises(mb.Interrupted) as caught:
        mb.sweep(m, designs, outputs, chunk=30)
    done = caught.value.result.done
    assert blocks[0] == 30 and 3 <= done.sum() < 30 and done[: done.sum()].all()
    assert np.array_equal(caught.value.result["frequency"][done], whole["frequency"][done])


MILLION = """
import sys
import mbrs as mb
import numpy as np
m = mb.Model("one")
a = m.body("a", mass=1.3, inertia=(0.1, 0.1, 0.1), at=(0.2, 0.1, 0.0))
m.prismatic("rail", m.ground, a, at=(0.2, 0.1, 0.0), axis=(0.3, -0.5, 0.81), k=m.parameter("k", 310.0))
k = np.linspace(200.0, 900.0, 10**6)
outputs = mb.outputs.modes(sensitivities=["k"])
for _ in range(2):
    runs = mb.sweep(m, mb.design.from_table({"k": k}), outputs, executor=2, store=sys.argv[1])
    assert runs.done.all()
    assert np.abs(runs["frequency"][:, 0] * (2 * np.pi) - np.sqrt(k / 1.3)).max() < 1e-9
# the largest size that getrusage tells may be that of the process that started this one
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="kilobytes of resident memory are those of Linux")
def test_a_million_designs_take_less_than_a_gigabyte(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", MILLION, str(tmp_path / "runs")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) < 1e6


def test_what_only_python_knows_goes_its_way():
    m = random_tree(np.random.default_rng(2), 2)
    names = ("b0.mass",)
    assert fast_plan(m.copy, names, mb.outputs.modes(2)) is not None
    assert fast_plan(m.copy, names, mb.outputs.equilibrium()) is not None
    assert fast_plan(m.copy, names, mb.outputs.frf("base.z", "b0.motion.z", [0.1])) is not None
    assert fast_plan(m.copy, names, mb.outputs.frf("base.rz", "b0.motion.z", [0.1])) is None
    assert fast_plan(m.copy, names, mb.outputs.frf("b0.motion.z", "b0.motion.z", [0.1])) is None
    assert fast_plan(m.copy, ("b0.inertia",), mb.outputs.modes(2)) is None
    assert fast_plan(m.copy, ("no such number",), mb.outputs.modes(2)) is None
    assert fast_plan(m.copy, names, lambda model: {}) is None


def test_rows_may_begin_at_any_byte():
    """As those of a message do, which a cluster sends."""
    plan = fast_plan(mb.examples.cubic_hexapod, ("k_leg",), mb.outputs.modes(n=3))
    rows = np.linspace(0.9e5, 1.1e5, 4)[:, None]
    odd = np.zeros(rows.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(rows.shape)
    odd[...] = rows
    assert not odd.flags.aligned
    assert plan.compute(odd).arrays[0].tobytes() == plan.compute(rows[:1]).arrays[0].tobytes()
