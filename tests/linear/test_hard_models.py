"""Hard cases of linear vibration; each prints its measured error."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import problems
import pytest
from agreement import difference, show
from mbrs.system.compiled import compiled
from mbrs.system.state import State
from random_models import random_tree


def frequency_error(p, **options):
    """Largest relative error of the frequencies, rigid modes by their absolute size."""
    found, known = mb.modes(p.model, **options).frequency, np.asarray(p.answer["frequency"])
    assert found.shape == known.shape
    return float(np.max(np.abs(found - known) / np.where(known > 0, known, 1.0)))


def report(what, error, bound):
    print(f"{what}: error {error:.1e}")
    assert error < bound


def test_closed_forms():
    report("cubic hexapod", frequency_error(problems.cubic_hexapod()), 1e-12)
    for p, known in ((problems.hanging_rod(), 0.610521), (problems.hanging_four_bar(), 0.546066)):
        assert f"{mb.modes(p.model).frequency[0]:.6f}" == f"{known:.6f}"
        report(p.model.name, frequency_error(p), 1e-12)


@pytest.mark.parametrize("joint, dof", [("revolute", 4), ("cylindrical", 16)])
def test_redundant_ladders(joint, dof):
    """The same ladder with its redundancy removed: planar joints in place of one hinge of each loop keep the motion."""
    p = mb.examples.ladder(4, joint)
    modes = mb.modes(p)
    assert modes.n == dof and modes.status == "converged"
    if joint == "revolute":
        m = released_ladder(4)
        assert mb.System(m).redundant == {}
        error = np.max(np.abs(mb.modes(m).frequency / modes.frequency - 1))
        report("redundant ladder against the one without redundancy", error, 1e-10)
    else:
        print(f"ladder {joint}: largest backward error {modes.backward_error.max():.1e}")


def released_ladder(layers):
    """The ladder of revolutes with the last joint of each layer replaced by a line contact: what a planar loop needs."""
    full = mb.examples.ladder(layers, "revolute")
    m = mb.Model("released", gravity=None)
    for b in full.bodies:
        m.body(b.name, **body_numbers(full, b.name))
    for j in full.joints:
        a, b = full.body_name(j.a), full.body_name(j.b)
        at = full.value(f"{j.name}.at_a")
        if j.name.endswith("2b"):
            # x and y of the point alone: two sliders' worth of freedom, a sphere on a rail along z would leave the turning free
            release(m, j.name, a, b, at)
        else:
            m.revolute(j.name, a, b, at=tuple(at), axis="z")
    for e in full.elements:
        ends = full.body_name(e.a), full.body_name(e.b)
        at, k, c = (full.value(f"{e.name}.{f}") for f in ("at_a", "k", "c"))
        m.bushing(e.name, *ends, at=tuple(at), k=k, c=c, orientation=full.value(f"{e.name}.orientation"))
    return m


def release(m, name, a, b, at):
    """Only two translations are held: by two long rods, whose ends turn with neither body beyond first order."""
    for i, direction in enumerate(((1e5, 0, 0), (0, 1e5, 0))):
        m.distance(f"{name}{i}", a, b, at=(tuple(at), tuple(np.asarray(at) + direction)))


def body_numbers(m, name):
    return {f: m.value(f"{name}.{f}") for f in ("mass", "inertia", "at", "orientation")}


@pytest.mark.parametrize("ratio", [1e6, 1e9, 1e12])
def test_stiffness_ratio(ratio):
    """A soft spring before and behind a stiff one."""
    p = problems.two_on_rails(1.0, ratio)
    report(f"soft ground, stiff link {ratio:g}", frequency_error(p), 1e-10)
    p = problems.two_on_rails(ratio, 1.0)
    report(f"stiff ground, soft link {ratio:g}", frequency_error(p), 1e-10)


@pytest.mark.parametrize("ratio", [1e5, 1e9])
def test_mass_ratio(ratio):
    report(f"light on heavy {ratio:g}", frequency_error(problems.two_on_rails(1.0, 1.0, ratio, 1.0)), 1e-10)
    report(f"heavy on light {ratio:g}", frequency_error(problems.two_on_rails(1.0, 1.0, 1.0, ratio)), 1e-10)


def test_triple_eigenvalue_and_its_derivatives():
    """A mass on equal springs: three times the same frequency, which splits along k_x and does not along the mass."""
    m = mb.Model("triple")
    b = m.body("b", mass=2.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.bushing("mount", m.ground, b, at=(0, 0, 0), k=(800.0, 800.0, 800.0, 5e4, 6e4, 7e4))
    modes = mb.modes(m)
    # derivatives treat as one what agrees to 1e-11, a group what rounding cannot part
    assert modes.clusters[0] == (0, 1, 2) and (jitter.seed() is not None or modes.groups[0] == (0, 1, 2))
    f = np.sqrt(800 / 2) / (2 * np.pi)
    errors = {"frequency": np.abs(modes.frequency[:3] - f).max() / f}
    s = mb.sensitivity(modes, ["b.mass", "mount.k[0]"])
    errors["by mass"] = np.abs(s.frequency[:3, 0] + f / (2 * 2.0)).max() / f
    errors["by k_x"] = np.abs(np.sort(s.frequency[:3, 1]) - [0, 0, f / (2 * 800.0)]).max() / f
    split = np.sort(s.group(0).directional([0.0, 1.0]).imag) if hasattr(s.group(0), "directional") else None
    if split is not None:
        errors["directional"] = np.abs(split - [0, 0, 20 / (2 * 800.0)]).max()
    show("triple eigenvalue", errors)
    # f goes like (k/m)^(1/2), its derivatives like f/k and f/m
    assert max(errors.values()) < 1e-12 + 2 * jitter.level()


def test_critical_damping():
    """One double root without a second vector: flagged, finite, and right to the square root of rounding."""
    p = problems.critical_damper()
    modes = mb.modes(p.model)
    assert modes.near_defective[0] and np.all(np.isfinite(modes.roots)) and np.all(np.isfinite(modes.shape))
    assert "near-defective" in str(modes)
    # a double root parts by the root of 1 - 4 k m/c^2, which has the noise of k and m once and of c twice
    noise = np.sqrt(4 * jitter.level())
    report("critical damping", float(np.abs(modes.roots / p.answer["root"] - 1).max()), 1e-7 + noise)


def test_free_floating():
    p = problems.free_pair()
    modes = mb.modes(p.model)
    assert list(modes.kind[:6]) == ["rigid"] * 6 and np.all(modes.frequency[:6] == 0)
    report("free pair", frequency_error(p), 1e-12)
    m = random_tree(np.random.default_rng(3), 5, ("revolute", "universal", "spherical"), followers=False, forces=False)
    free = mb.Model("free tree")
    del m, free


def test_free_floating_chain():
    """Five bodies on bushings and nothing else: six rigid modes, exactly zero."""
    full = mb.examples.chain(5, None)
    m = mb.Model("adrift")
    for b in full.bodies:
        m.body(b.name, **body_numbers(full, b.name))
    for e in full.elements[1:]:
        m.bushing(
            e.name,
            full.body_name(e.a),
            full.body_name(e.b),
            at=tuple(full.value(f"{e.name}.at_a")),
            k=full.value(f"{e.name}.k"),
        )
    modes = mb.modes(m)
    assert modes.n == 30 and list(modes.kind).count("rigid") == 6
    print(
        f"adrift: lowest elastic {modes.frequency[6]:.3g} Hz, largest backward error {modes.backward_error.max():.1e}"
    )
    assert modes.backward_error.max() < 1e-13


def test_inverted_pendulum():
    p = problems.inverted_rod()
    modes = mb.modes(p.model)
    assert modes.kind[0] == "divergence" and modes.unstable[0]
    report("inverted pendulum", float(np.abs(np.sort(modes.roots.real)[::-1] / p.answer["roots"] - 1).max()), 1e-12)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99, 1.01, 1.3])
def test_flutter_under_a_follower_force(share):
    """Ziegler's double pendulum below and above its critical load."""
    p = problems.ziegler(share * problems.ziegler(0.0).answer["critical"])
    modes = mb.modes(p.model)
    known = p.answer["roots"]
    distance = max(np.abs(modes.roots - s).min() for s in known)
    # s^2 = w with 2 w^2 + b w + 1 = 0, b = 7 - 2 p: ds/s = db / (2 (b^2 - 8)^(1/2)), and four numbers decide 7 and 2 p
    load = share * (3.5 - np.sqrt(2.0))
    condition = 4 * (7 + 2 * load) / (2 * np.sqrt(abs((7 - 2 * load) ** 2 - 8))) * np.abs(known).max()
    print(f"Ziegler at {share:g} of the critical load: error {distance:.1e}")
    assert distance < 1e-12 + condition * jitter.level()
    assert ("flutter" in modes.kind) == (share > 1.0)
    lin = mb.linearize(p.model)
    assert (lin.N is None) == (share == 0.0)


def test_flutter_boundary_by_bisection():
    """Where modes first flutter: (7/2 - sqrt 2) k/l."""
    low, high = 1.0, 3.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        unstable = np.any(mb.modes(problems.ziegler(middle).model).eigenvalue.real > 1e-7)
        low, high = (low, middle) if unstable else (middle, high)
    report("critical follower load", abs(high - problems.ziegler(0).answer["critical"]), 1e-9)


@pytest.mark.parametrize("speed", [10.0, 1e3, 1e6])
def test_fast_gyroscopic_rotor(speed):
    """Nutation and precession apart by many orders of magnitude."""
    p = problems.spinning_top(speed)
    modes = mb.modes(p.model)
    known = np.asarray(p.answer["omega"])
    error = np.abs(np.sort(modes.omega) - known) / np.where(known > 0, known, 1.0)
    print(f"top at {speed:g} rad/s: errors {error[1]:.1e} (precession) {error[2]:.1e} (nutation), spin {error[0]:.1e}")
    assert modes.kind[0] == "rigid" and np.max(error) < 1e-9


def test_a_body_far_from_the_origin():
    """The hanging four-bar and a chain on bushings, moved 1e5 m away: only the drawn points lose digits."""
    for make in (
        lambda: problems.hanging_four_bar().model,
        lambda: mb.examples.chain(6),
        lambda: mb.examples.cubic_hexapod(),
    ):
        near, far = make(), make()
        shift = np.array([1e5, -7e4, 3e4])
        for item in far.items.values():
            for name in item.fields():
                if name in ("at", "at_a", "at_b") and not (name == "at" and "at_a" in item.fields()):
                    address = f"{item.name}.{name}"
                    far.set({address: far.value(address) + shift})
        a, b = mb.modes(near), mb.modes(far)
        error = np.max(np.abs(b.frequency - a.frequency) / a.frequency.max())
        # points at 1e5 m are known to 1.5e-11 m, arms of .1 m to 1e-10; noise on the numbers moves them by its part of the distance
        report(f"{near.name} at 1e5 m", float(error), 1e-8 + 1e6 * jitter.level())


def test_angles_through_full_turns():
    """A pendulum turned on and on: K = m g L/2 cos phi at every angle, in steps and in one large one."""
    p = problems.hanging_rod()
    m, worst = p.model, 0.0
    q = mb.linearize(m).state.q
    for turns in np.linspace(0.0, 4 * np.pi, 41):
        for path in ([turns], [turns / 3] * 3):
            now = q
            for step in path:
                now = compiled(m).advance(now, np.array([step]))
            K = compiled(m).linearize(now, np.zeros(0), [], raw=True)["S"][0, 0]
            worst = max(worst, abs(K - 4.905 * np.cos(turns)))
    report("full turns of a hinge", worst, 1e-12 + 4.905 * 5 * jitter.level())


def test_spherical_and_universal_joints_through_full_turns():
    """Many large rotations about all axes: still what the reference finds, rotation matrices still orthogonal."""
    worst, skew = 0.0, 0.0
    for kinds in (("spherical",), ("universal",), ("free",)):
        rng = np.random.default_rng(len(kinds[0]))
        m = random_tree(rng, 2, kinds, forces=False, followers=False)
        q = mb.linearize(m, without=("gravity",)).state.q
        n = mb.System(m).dof
        for _ in range(30):
            q = compiled(m).advance(q, 4.0 * rng.normal(size=n))
        R = compiled(m).bodies(q, np.zeros(0))["rotation"]
        skew = max(skew, np.abs(np.einsum("nij,nik->njk", R, R) - np.eye(3)).max())
        worst = max(worst, max(difference(m, State(q, np.zeros(0))).values()))
    show("full turns in space", {"difference": worst, "orthogonality": skew})
    assert worst < 1e-10 and skew < 1e-13


def test_bushings_near_half_a_turn():
    """The rotation vector of a bushing at 179 degrees: stiffness still as in the reference."""
    m = mb.Model("wound")
    b = m.body("b", mass=1.0, inertia=(1, 1.2, 1.4), at=(0, 0, 0))
    m.revolute("shaft", m.ground, b, at=(0, 0, 0), axis=(1, 1, 0))
    m.bushing("spring", m.ground, b, at=(0, 0, 0), k=(1, 2, 3, 4, 5, 6), orientation=mb.rotation("y", 0.3))
    found = {}
    for degrees in (90, 170, 179, 179.99):
        q = mb.linearize(m).state.q
        state = State(compiled(m).advance(q, np.array([np.radians(degrees)])), np.zeros(0))
        found[str(degrees)] = max(difference(m, state).values())
    show("bushing at", found)
    assert max(found.values()) < 1e-10


def test_mass_ratio_with_general_damping():
    """The light body's damper against 40-digit roots of the quartic, mass ratio 1e9 either way."""
    import mpmath as mp

    for m1, m2 in ((1.0, 1e9), (1e9, 1.0)):
        m = mb.Model("two masses")
        a = m.body("a", mass=m1, inertia=(1, 1, 1), at=(0, 0, 0))
        b = m.body("b", mass=m2, inertia=(1, 1, 1), at=(1, 0, 0))
        m.prismatic("first", m.ground, a, at=(0, 0, 0), axis="x", k=1.0, c=0.03)
        m.prismatic("second", a, b, at=(1, 0, 0), axis="x", k=1.0)
        with mp.workdps(60):
            p, q = mp.mpf(m1), mp.mpf(m2)
            # (p s^2 + .03 s + 2)(q s^2 + 1) - 1
            c = mp.mpf(0.03)
            roots = mp.polyroots([p * q, c * q, p + 2 * q, c, mp.mpf(1)], maxsteps=500, extraprec=400)
            exact = sorted((complex(r) for r in roots if r.imag > 0), key=abs)
        found = mb.modes(m)
        error = float(np.max(np.abs(found.eigenvalue - exact) / np.abs(exact)))
        report(f"damped, masses {m1:g} and {m2:g} ({found.stats.route})", error, 1e-9)


def test_the_mass_factor_is_one_of_the_mass_matrix():
    """F^T F = M, with centres of mass away from the origins, in a tree and in a loop."""
    rng = np.random.default_rng(8)
    for m in (random_tree(rng, 3, ("universal", "spherical"), followers=False), mb.examples.ladder(2, "spherical")):
        lin = mb.linearize(m)
        factor = lin.mass_factor
        report(m.name, float(np.abs(factor.T @ factor - lin.M).max() / np.abs(lin.M).max()), 1e-13)
