"""Sensitivities in block layout (docs/theory.md (10.7), (10.8)) against the production path and against ALI3-P."""

import mbrs as mb
import numpy as np
import pytest
from mbrs import matrix_calculus as mc
from mbrs import reference as ref
from mbrs.model.directions import directions
from mbrs.model.tables import tables
from mbrs.reference import dynamics as dyn
from mbrs.reference import motion as rm
from mbrs.reference.kinematics import advance, drawn_state
from mbrs.reference.simulate import mass_matrix
from oracles.ali3p import Scheme
from oracles.ali3p_models import FiveBar
from oracles.runge_kutta import accelerations


def double_pendulum():
    """Data invented; V drives masses, a spring and an inertia."""
    m = mb.Model("double pendulum", gravity=(0, -9.81, 0))
    V = m.parameter("V", np.array([[1.0, 2.0, 0.3], [0.7, 1.5, 0.2]]))
    a = m.body("a", mass=V[0, 0], inertia=(0.2, 0.2, V[0, 2]), at=(0.3, 0, 0))
    b = m.body("b", mass=V[1, 0] * V[0, 1], inertia=(0.1, 0.1, 0.03 + V[1, 2] ** 2), at=(0.8, 0.1, 0))
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z", k=V[1, 1])
    m.revolute("B", a, b, at=(0.6, 0, 0), axis="z", c=0.1)
    return m


@pytest.mark.oracle
def test_rigid_form_is_the_production_path():
    m = double_pendulum()
    t, h, n = tables(m), 0.01, 40
    V0 = m.value("V")
    # x is an analytic function of V: evaluated by expressions for real V, so its complex step is taken by hand

    def x_of(V):
        real = m.copy()
        real.set({"V": V.real})
        x = tables(real)["x"] + 0j
        return x + 1j * (directions(real, "V").dense @ V.imag.ravel())

    def scene(V, q):
        sys = ref.System(t, x_of(V) if np.iscomplexobj(V) else x_of(V + 0j).real)
        return sys, rm.Motion(advance(sys, drawn_state(sys), q), 0 * q, np.zeros(sys.n_memory))

    def mass(V, q, t):
        sys, motion = scene(V, q)
        return mass_matrix(sys, motion.state)

    def force(V, q, v, t):
        sys, motion = scene(V, q)
        motion.rate = v
        return mass(V, q, t) @ accelerations(sys, motion, np.array([], dtype=int))

    form = mc.rigid(mass, force)
    motion, tangent = form.integrate(V0, lambda V: (np.zeros(2) + 0 * V[0, 0], np.zeros(2) + 0 * V[0, 0]), h, n)
    # body a turns about the origin: the derivative of its x, y is theta' times the perpendicular
    theta = motion[-1][0]
    turn = 0.3 * np.array([-np.sin(theta), np.cos(theta)])
    known = np.einsum("c,ij->cij", turn, tangent[-1][[0, 2]])
    found = mb.gradient(
        m, [mb.Final(lambda at, c=c: at.position("a")[c]) for c in range(2)], ["V"], t=h * n, step=h / 10
    )
    differs = np.abs(found.gradient - known).max() / np.abs(known).max()
    print(f"rigid form against gradients of the core: {differs:.1e}")
    assert differs < 1e-4
    assert tangent[-1].shape == (4, 3)
    assert np.abs(tangent[-1]).max() > 1e-3


def test_flexible_form_holds_along_ali3p():
    """Eq. 18 for the five-bar: numbers as the matrix V (2, 4), blocks Dq/DV from the tangent linear model."""
    mech, h, n = FiveBar(), 0.01, 20
    V = mech.p.reshape(2, 4)
    flat = lambda w: w.reshape(-1)  # noqa: E731
    form = mc.flexible(
        M=lambda w, q, t: mech.mass(q, flat(w)),
        K=lambda w, q, t: mech.tangents(t, q, None, None, flat(w))[0],
        C=lambda w, q, t: mech.phi(t, q, flat(w)),
        C_q=lambda w, q, t: mech.rows(t, q, flat(w)),
        Q=lambda w, q, v, t: mech.force(q, flat(w)),
        F=lambda w, q, t: mech.tangents(t, q, None, None, flat(w))[0] @ q,
    )
    scheme = Scheme(mech, mech.p, h)
    last, d_last = scheme.begin(), scheme.begin_tangent()
    for _ in range(n):
        done = scheme.step(last)
        tangent = scheme.step_tangent(last, d_last, done)
        star = 2 / h * (tangent.q - d_last.q) - d_last.v
        d_star = 2 / h * (star - d_last.v) - d_last.a
        blocks = [mc.vetter(x.reshape(-1, 2, 4), (2, 4), 1) for x in (tangent.q, star, d_star, tangent.lam)]
        last, d_last = done.end, tangent
    at = (last.q, done.v_star, done.a_star, last.lam)
    balance = form.balance(V, *at, last.t)
    first, second = form.defect(V, at, blocks, last.t)
    size = np.abs(mech.mass(last.q, mech.p) @ d_star).max()
    print(f"balance {np.abs(balance).max():.1e}, eq. 18 {np.abs(first).max() / size:.1e}, {np.abs(second).max():.1e}")
    assert np.abs(balance).max() < 1e-9
    assert np.abs(first).max() / size < 1e-9
    assert np.abs(second).max() < 1e-10


@pytest.mark.oracle
def test_flexible_form_of_a_flexible_body():
    """Eqs 17 to 23 for a blade in a floating frame on a driven hub, V = [[stiffness, mass], [inertia, speed]]; the tangents
    of a motion that satisfies eq. 17 by complex steps through the accelerations and multipliers that follow from it.
    """
    from flexible_models import rotor_blade
    from mbrs.reference.kinematics import advance, moving
    from mbrs.reference.motion import tree_map, with_rates

    m = rotor_blade(modes=2, twist=0.3)[0]
    m.gravity = (1.0, -9.0, 2.0)
    t = tables(m)
    place, modes, time = int(t["flexible_x"][0]), 2, 0.7
    x0 = np.asarray(t["x"])
    K_at = place + 12 * modes + 9 * modes**2
    P2_at = place + 3 * modes + 9 * modes
    inertia_at = int(t["body_x"][t["body_name"].index("hub")]) + 13

    def system(V):
        x = x0.astype(np.result_type(x0, V))
        x[K_at : K_at + 4] *= V[0, 0]
        x[P2_at : P2_at + 36] *= V[0, 1]
        x[inertia_at] += V[1, 0]
        return ref.System(t, x)

    def at(V, q, v):
        sys = system(V)
        return sys, with_rates(sys, advance(sys, drawn_state(sys), q), v)

    def M(V, q, t):
        sys, state = at(V, q, 0 * q)
        return mass_matrix(sys, state)

    def K(V, q, t):
        out = np.zeros((3, 3), dtype=np.result_type(V, q))
        out[1:, 1:] = system(V).flexible[0].K
        return out

    def Q(V, q, v, t):
        sys, state = at(V, q, v)
        T = tree_map(sys, state, moving=True)[0]
        left = dyn.applied_residual(sys, state, T.derivative(1) @ v, without=("gravity",))
        return K(V, q, t) @ q - T.value.T @ left

    def F(V, q, t):
        sys, state = at(V, q, 0 * q)
        return tree_map(sys, state)[0].value.T @ dyn.loads(sys, moving(state, np.zeros(6 * sys.nb))).value[0]

    form = mc.flexible(
        M=M, K=K, Q=Q, F=F, C=lambda V, q, t: np.array([q[0] - V[1, 1] * t]), C_q=lambda V, q, t: np.eye(1, 3)
    )

    def motion(V):
        q = np.array([V[1, 1] * time, 8.0 * V[0, 0] + V[1, 0], -3.0 * V[0, 1] * V[1, 1]])
        v = np.array([V[1, 1], 20.0 * V[0, 1], 5.0 * V[0, 0] ** 2])
        right = Q(V, q, v, time) + F(V, q, time) - K(V, q, time) @ q
        bordered = np.block([[M(V, q, time), np.eye(3, 1)], [np.eye(1, 3), np.zeros((1, 1))]])
        both = np.linalg.solve(bordered, np.append(right, 0.0))
        return q, v, both[:3], both[3:]

    V = np.array([[1.1, 0.9], [0.4, 1.8]])
    tangent = [mc.derivative(lambda w, i=i: motion(w)[i], V) for i in range(4)]
    balance = form.balance(V, *motion(V), time)
    first, second = form.defect(V, motion(V), tangent, time)
    size = np.abs(form.by_design(V, *motion(V), time)).max()
    print(
        f"balance {np.abs(balance).max():.1e}, eq. 18 {np.abs(first).max() / size:.1e} and {np.abs(second).max():.1e}"
    )
    assert size > 1.0 and np.abs(tangent[3]).max() > 1.0
    assert np.abs(balance).max() < 1e-8 * np.abs(motion(V)[3]).max()
    assert np.abs(first).max() < 1e-10 * size and np.abs(second).max() < 1e-12
    # the block of one entry against the slope of the balance at fixed motion, by complex steps
    fixed = motion(V)
    for i in range(2):
        for j in range(2):
            step = np.zeros((2, 2), dtype=complex)
            step[i, j] = 1e-30j
            slope = form.balance(V + step, *fixed, time).imag / 1e-30
            found = form.by_design(V, *fixed, time)[3 * i : 3 * i + 3, j]
            assert found == pytest.approx(slope, rel=1e-9, abs=1e-11 * size)
