"""Flexible bodies in mbrs.reference: its cloud of particles against sums over finite elements, closed forms, energy."""

from __future__ import annotations

from dataclasses import replace

import mbrs as mb
import numpy as np
import pytest
from flexible_models import beam, beam_pendulum, flying_beam, rotor_blade
from mbrs import reference as ref
from mbrs.flexible._elements import Section, mesh
from mbrs.flexible._integrals import shape_integrals
from mbrs.model.tables import tables
from mbrs.reference import dynamics as dyn
from mbrs.reference import flexible as fx
from mbrs.reference import so3
from mbrs.reference.kinematics import advance, moving
from mbrs.reference.motion import with_rates
from mbrs.reference.reader import Body
from mbrs.reference.simulate import begin
from oracles.bdf import bdf4
from oracles.bdf_bfgs import bdf_bfgs
from oracles.explicit import explicit
from oracles.generalized_alpha import generalized_alpha
from oracles.runge_kutta import start


def somewhere(sys, rng, size=0.3, rate=1.0):
    """A state away from the drawn one, moving."""
    state = ref.assemble(sys, ref.drawn_state(sys))
    state = advance(sys, state, size * rng.normal(size=sys.ny))
    begun = start(sys, state, rate * rng.normal(size=sys.ny))
    return with_rates(sys, begun.state, begun.rate)


def test_the_cloud_has_the_integrals():
    """Every inner product of the fields over the particles, those of the second order included."""
    b = beam(6)
    own = Body("", np.zeros(3), np.eye(3), b.com, np.asarray(b.mass), b.inertia, np.zeros(3), np.zeros(3))
    c = fx.particles(own, b.S, b.P1, b.P2, b.KG)
    second = 0.5 * np.trace(b.inertia) * np.eye(3) - b.inertia + b.mass * np.outer(b.com, b.com)
    sums = {
        "mass": (np.sum(c.w * c.one**2), b.mass),
        "com": (np.einsum("p,p,pa", c.w, c.one, c.r), b.mass * b.com),
        "r r": (np.einsum("p,pa,pb->ab", c.w, c.r, c.r), second),
        "S": (np.einsum("p,p,pak->ak", c.w, c.one, c.phi), b.S),
        "P1": (np.einsum("p,pa,pbk->kab", c.w, c.r, c.phi), b.P1),
        "P2": (np.einsum("p,pak,pbl->klab", c.w, c.phi, c.phi), b.P2),
        "KG a0": (np.einsum("p,p,pakl->akl", c.w, c.one, c.psi), b.KG[:3]),
        "KG W": (np.einsum("p,pb,pakl->abkl", c.w, c.r, c.psi), b.KG[3:].reshape(3, 3, 6, 6)),
        "phi psi": (np.einsum("p,pak,pbij->kijab", c.w, c.phi, c.psi), 0.0),
    }
    for name, (found, expected) in sums.items():
        assert found == pytest.approx(expected, abs=1e-10 * max(1.0, np.abs(expected).max())), name
    assert np.any(c.w < 0), "without second orders over each other no true mass has these integrals"


def test_inertia_forces_against_particles_of_the_finite_elements():
    """The beam taken apart into four particles per section, each accelerated by differences of its own path."""

    def section(x):
        return Section(2.0 - 0.5 * x, 30.0, 90.0, 20.0, 500.0, 400.0, 300.0, 0.02, 0.05, 0.4 - 0.3 * x)

    grid = mesh(np.linspace(0, 1.5, 4), section, shear=True)
    rng = np.random.default_rng(7)
    T = 0.3 * rng.normal(size=(grid.n_dof, 3))
    particles = []
    for p in grid.points:
        moved = p.N @ T[p.dofs]
        moments, axes = np.linalg.eigh(p.section.mass_moments()[1:, 1:] / p.section.mass)
        for i in (-1, 1):
            for j in (-1, 1):
                s = np.r_[0, axes @ (np.sqrt(moments) * [i, j])]
                phi = moved[:3] + np.cross(moved[3:].T, s).T
                particles.append((p.weight * p.section.mass / 4, np.array([p.x, 0, 0]) + s, phi))
    dm, r, phi = (np.array([p[i] for p in particles]) for i in range(3))
    com = dm @ r / dm.sum()
    arm = r - com
    inertia = np.einsum("p,pa,pa", dm, arm, arm) * np.eye(3) - np.einsum("p,pa,pb->ab", dm, arm, arm)
    own = Body("", np.zeros(3), np.eye(3), com, dm.sum(), inertia, np.zeros(3), np.zeros(3))
    cloud = fx.particles(own, **shape_integrals(grid, T), KG=np.zeros((12, 3, 3)))
    f = fx.Flexible("", 0, 3, [], [1], cloud, np.zeros((3, 3)), np.zeros((3, 3)))
    zero = np.zeros(3)
    R, w, q, v, qd = so3.exp(rng.normal(size=3)), *rng.normal(size=(4, 3))
    a = rng.normal(size=12)
    state = ref.State(np.array([zero, q]), np.array([R, np.eye(3)]), np.array([v, qd]), np.array([w, zero]))
    found = fx.inertia(f, fx.moving(f, moving(state, a))).value[0]

    def path(t):
        turn = so3.exp(w * t + 0.5 * a[3:6] * t**2)  # to second order
        here = r + phi @ (q + qd * t + 0.5 * a[6:9] * t**2)
        return v * t + 0.5 * a[:3] * t**2 + here @ (turn @ R).T

    h = 1e-4
    acceleration = (path(h) - 2 * path(0.0) + path(-h)) / h**2
    s = (r + phi @ q) @ R.T
    expected = np.concatenate(
        [
            dm @ acceleration,
            np.einsum("p,pa->a", dm, np.cross(s, acceleration)),
            np.einsum("p,pak,pa->k", dm, np.einsum("ab,pbk->pak", R, phi), acceleration),
        ]
    )
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


def test_tangents_against_differences():
    """K, C and M of inertia, and K of weight, about a state that moves."""
    sys = ref.System(tables(beam_pendulum()))
    rng = np.random.default_rng(1)
    state = somewhere(sys, rng)
    a = rng.normal(size=6 * sys.nb)
    unit = np.eye(6 * sys.nb)
    K, C, M = (
        dyn.inertia(sys, moving(state, a, **{change: unit})).derivative_along(6 * sys.nb)[:, 0].T
        for change in ("pose", "twist", "rate")
    )
    weight = -dyn.loads(sys, moving(state, a, pose=unit)).derivative_along(6 * sys.nb)[:, 0].T
    h = 1e-6

    def turned(s, i, e):
        r, R = s.r.copy(), s.R.copy()
        frame, c = divmod(i, 6)
        if c < 3:
            r[frame, c] += e
        else:
            R[frame] = so3.exp(e * np.eye(3)[c - 3]) @ R[frame]
        return replace(s, r=r, R=R)

    def faster(s, i, e):
        v, w = s.v.copy(), s.w.copy()
        frame, c = divmod(i, 6)
        (v if c < 3 else w)[frame, c % 3] += e
        return replace(s, v=v, w=w)

    for i in range(6 * sys.nb):
        ends = [dyn.inertia(sys, moving(turned(state, i, e), a)).value[0] for e in (h, -h)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(K[:, i], abs=1e-7 * np.abs(K).max())
        ends = [dyn.loads(sys, moving(turned(state, i, e), a)).value[0] for e in (h, -h)]
        assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(weight[:, i], abs=1e-7 * np.abs(weight).max())
        ends = [dyn.inertia(sys, moving(faster(state, i, e), a)).value[0] for e in (h, -h)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(C[:, i], abs=1e-7 * np.abs(C).max())
    force = dyn.inertia(sys, moving(state, a)).value[0] - dyn.inertia(sys, moving(state, 0 * a)).value[0]
    assert M @ a == pytest.approx(force, abs=1e-10 * np.abs(force).max())


def test_held_shapes_are_a_rigid_body():
    """At q = q' = 0 force and moment of inertia, and weight, are those of the rigid body, in any motion."""
    b = beam(3)
    rng = np.random.default_rng(2)
    v, w, a, alpha = rng.normal(size=(4, 3))
    wrench = {}
    for kind in ("flexible", "rigid"):
        m = mb.Model("one", gravity=(1, 2, -9.81))
        place = dict(at=(0.1, 0.2, 0.3), orientation=mb.rotation((1, 1, 0), 0.7))
        if kind == "flexible":
            m.flexible_body("rod", b, **place)
        else:
            m.body("rod", mass=b.mass, inertia=b.inertia, com=b.com, **place)
        sys = ref.System(tables(m))
        state = ref.drawn_state(sys)
        given = np.zeros(6 * sys.nb)
        state.v[0], state.w[0], given[:3], given[3:6] = v, w, a, alpha
        now = moving(state, given)
        wrench[kind] = (dyn.inertia(sys, now) - dyn.loads(sys, now)).value[0][:6]
    assert wrench["flexible"] == pytest.approx(wrench["rigid"], rel=1e-11)


@pytest.mark.some(1)
@pytest.mark.parametrize("stiffening", [True, False])
def test_energy_of_a_free_flight(stiffening):
    """Large rotation and bending, second-order shapes included: inertia, weight and elasticity keep the energy."""
    sys = ref.System(tables(flying_beam(stiffening=stiffening, EI_flap=4.0, EI_edge=9.0, GJ=5.0, modes=3)))
    bent = advance(sys, ref.drawn_state(sys), np.r_[np.zeros(6), 0.1, -0.07, 0.03])
    rate = np.r_[1.0, 2.0, 3.0, 0.3, 2.2, -1.4, 0.2, 0.3, -0.2]
    lost = []
    for n in (5, 10):
        history = explicit(sys, begin(sys, bent, rate), 0.05 / n, n)
        energy = history.energies(sys)
        lost.append(np.ptp(energy) / abs(energy[0]))
    q = np.array([sys.flexible[0].held(i.motion.state.r) for i in history.instants])
    print(f"energy {energy[0]:.6g} J kept to {lost[0]:.1e}, {lost[1]:.1e}; q moves by {np.ptp(q, axis=0)}")
    # what is lost is the scheme's, of eighth order
    assert lost[1] < 1e-8 and (lost[1] < 1e-14 or lost[1] < lost[0] / 100) and np.all(np.ptp(q, axis=0) > 0.01)


def test_tree_through_either_end():
    """A joint at the tip reaches the body through a node, one at the root through the frame: one mechanism, held at both
    ends by springs, has the same roots.
    """
    found = []
    for held in ("root", "tip"):
        m = mb.Model("held at both ends")
        f = m.flexible_body("rod", beam(), at=(0, 0, 0))
        stiff = dict(k=(900.0, 1000, 1100, 70, 80, 90))
        other = "tip" if held == "root" else "root"
        block = m.body("block", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(2.0, 0, 0))
        plate = m.body("plate", mass=2.0, inertia=(0.2, 0.1, 0.3), at=(0.0, 0, 0))
        m.bushing("at the root", m.ground, plate, at=(0, 0, 0), **stiff)
        m.bushing("at the tip", m.ground, block, at=(2, 0, 0), k=(500.0, 600, 700, 20, 30, 40))
        bodies = {"root": plate, "tip": block}
        m.free("mobile", m.ground, bodies[held], at=(0, 0, 0))
        m.fixed("first", bodies[held], f.node(held))
        m.fixed("second", f.node(other), bodies[other])
        sys = ref.System(tables(m))
        assert sys.coordinates[-4:] == [f"rod.q{k}" for k in range(1, 5)]
        signs = [t.sign for t in sys.tree if t.link.kind == "modal"]
        assert signs == ([1] if held == "root" else [-1])
        state = ref.assemble(sys, ref.drawn_state(sys))
        lin = ref.linearize(sys, state)
        found.append(ref.modes(lin.M, lin.C, lin.G, lin.K, lin.N).frequency)
        moving = somewhere(sys, np.random.default_rng(4), 0.2).at_rest
        h, last = 1e-5, np.eye(sys.ny)[-1]
        ends = [ref.linearize(sys, advance(sys, moving, e * last)).residual for e in (h, -h)]
        S = ref.linearize(sys, moving).S
        # off equilibrium only rows of coordinates that do not turn with the others are plain differences
        assert (ends[0] - ends[1])[-4:] / (2 * h) == pytest.approx(S[-4:, -1], abs=1e-6 * np.abs(S).max())
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_weight_bends_a_cantilever():
    """Deflection of a uniform beam under its weight, w L^4 / (8 EI), the modal part of it that four modes hold."""
    b = mb.flexible.beam(2.0, mass=0.3, EI_flap=400.0, EI_edge=900.0, modes=20)
    m = mb.Model("cantilever", gravity=(0, 0, -9.81))
    f = m.flexible_body("rod", b)
    m.fixed("clamp", m.ground, f.node("root"), at=(0, 0, 0))
    m.marker("end", f.node("tip"))
    sys = ref.System(tables(m))
    state, _, _ = ref.equilibrium(sys)
    tip = sys.bodies.index(next(b for b in sys.bodies if b.name == "rod.tip"))
    assert state.r[tip, 2] == pytest.approx(-0.3 * 9.81 * 2.0**4 / (8 * 400.0), rel=2e-6)


def test_rotating_blade():
    """Gyroscopic, centrifugal and geometric terms of a blade that turns, against the formula with its integrals."""
    m, blade = rotor_blade()
    speed = 17.2 * 2 * np.pi / 60
    sys = ref.System(tables(m))
    lin, torque = ref.steady_motion(sys, {"shaft": speed})
    a0, W = np.array([-(speed**2) * 1.75, 0, 0]), -(speed**2) * np.diag([1.0, 1, 0])
    K = blade.K + np.einsum("i,ikl", np.concatenate([a0, W.ravel()]), blade.KG) + np.einsum("ab,klab->kl", W, blade.P2)
    assert lin.S[1:, 1:] == pytest.approx(K, rel=1e-10, abs=1e-10 * np.abs(K).max())
    assert lin.M[1:, 1:] == pytest.approx(np.eye(4), abs=1e-9)
    assert np.abs(torque).max() < 1e-9 * np.abs(K).max()
    f = np.sqrt(np.linalg.eigvalsh(lin.S[1:, 1:])) / (2 * np.pi)
    assert f == pytest.approx([1.288, 1.889, 3.736, 6.400], rel=1e-3)


@pytest.mark.oracle
def test_schemes_agree_on_a_turning_blade():
    """Generalised-alpha and BDF come to the explicit scheme's motion with orders 2 and 4; flexible, starting bent."""
    sys = ref.System(tables(rotor_blade(modes=2, twist=0.2)[0]))
    t, bent = 0.4, advance(sys, ref.drawn_state(sys), np.array([0.0, 20.0, -10.0]))

    def end(method, n):
        begun = begin(sys, bent, np.array([3.0, 60.0, 40.0]))
        scheme = {"generalized-alpha": generalized_alpha, "bdf": bdf4, "explicit": explicit}[method]
        return scheme(sys, begun, t / n, n).instants[-1].motion.state.r

    exact = end("explicit", 40)
    for method, order, n in (("generalized-alpha", 2, 10), ("bdf", 4, 20)):
        errors = [np.abs(end(method, k) - exact).max() for k in (n, 2 * n)]
        print(f"{method}: errors {errors[0]:.1e}, {errors[1]:.1e}")
        assert np.log2(errors[0] / errors[1]) > order - 0.4


@pytest.mark.oracle
def test_bdf_bfgs_of_a_turning_blade():
    """The derivative-free scheme steps through modal coordinates like others, with the fourth order of its formula."""
    sys = ref.System(tables(rotor_blade(modes=1)[0]))
    bent, rate, t = advance(sys, ref.drawn_state(sys), np.array([0.0, 20.0])), np.array([3.0, 60.0]), 0.32
    exact = explicit(sys, begin(sys, bent, rate), t / 20, 20).instants[-1].motion.state.r
    errors = [np.abs(bdf_bfgs(sys, bent, rate, t / n, n).motions[-1].state.r - exact).max() for n in (16, 32)]
    print(f"bdf-bfgs: errors {errors[0]:.1e}, {errors[1]:.1e}")
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_complex_steps_through_the_integrals():
    """Derivatives of M, D and S by any number of a flexible body."""
    t = tables(beam_pendulum(modes=2))
    rng = np.random.default_rng(5)
    start_, size = int(t["flexible_x"][0]), 12 * 2 + 23 * 4
    x = np.array(t["x"])
    base = ref.System(t)
    where = advance(base, ref.assemble(base, ref.drawn_state(base)), 0.2 * rng.normal(size=base.ny))
    direction = np.zeros(len(x))
    spread = rng.normal(size=size)
    # symmetric parts of P2, K, C and KG only, as a model's numbers are
    P2 = spread[24:60].reshape(2, 2, 3, 3)
    spread[24:60] = (P2 + P2.transpose(1, 0, 3, 2)).ravel()
    for block in range(60, size, 4):
        s = spread[block : block + 4].reshape(2, 2)
        spread[block : block + 4] = (s + s.T).ravel()
    direction[start_ : start_ + size] = spread

    def matrices(sys):
        lin = ref.linearize(sys, where)
        return np.concatenate([lin.M.ravel(), lin.S.ravel()])

    h = 1e-6
    ends = [matrices(ref.System(t, x + e * direction)) for e in (h, -h)]
    found = matrices(ref.System(t, x + 1e-20j * direction)).imag / 1e-20
    assert found == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-6, abs=1e-6 * np.abs(found).max())
