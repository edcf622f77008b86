"""Steady rotation against closed forms: any axis, any units, any order of definition; what is not steady is refused by name."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from scipy.integrate import solve_ivp

# kg, m, s, and tonne, mm, s: factors of mass and length
UNITS = {"m-kg-s": (1.0, 1.0), "mm-t-s": (1e-3, 1e3)}
CASES = [(0, "m-kg-s", False), (1, "mm-t-s", True), (2, "mm-t-s", False), (3, "m-kg-s", True)]
cases = pytest.mark.parametrize("seed, units, backwards", CASES)


def about_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


class Setting:
    """A random frame with the axis of rotation as x, a random place, units, and order of definition."""

    def __init__(self, seed: int, units: str = "m-kg-s", backwards: bool = False) -> None:
        rng = np.random.default_rng(100 + seed)
        q, r = np.linalg.qr(rng.normal(size=(3, 3)))
        q = q * np.sign(np.diag(r))
        self.R = q * np.sign(np.linalg.det(q))
        self.origin = rng.normal(size=3)
        self.mass, self.length = UNITS[units]
        self.backwards = backwards

    @property
    def force(self) -> float:
        return self.mass * self.length

    @property
    def moment(self) -> float:
        return self.mass * self.length**2

    def place(self, *p: float) -> np.ndarray:
        return self.length * (self.origin + self.R @ p)

    @property
    def axis(self) -> np.ndarray:
        return self.R[:, 0]

    def body(self, m: mb.Model, name: str, mass: float, inertia: tuple, at=(0.0, 0.0, 0.0), turn: float = 0.0):
        R = self.R @ about_x(turn) if turn else self.R
        return m.body(
            name, mass=mass * self.mass, inertia=np.array(inertia) * self.moment, at=self.place(*at), orientation=R
        )

    def bushing(self, m: mb.Model, name: str, a, b, k, at=(0.0, 0.0, 0.0), c=None):
        unit = np.array([self.mass] * 3 + [self.moment] * 3)
        more = {} if c is None else {"c": np.array(c) * unit}
        return m.bushing(name, a, b, at=self.place(*at), k=np.array(k) * unit, orientation=self.R, **more)


def hertz(found: mb.ModalResult) -> np.ndarray:
    return np.sort(found.frequency_damped[found.kind != "rigid"])


def holds(f: np.ndarray, *known: float, rel: float = 1e-6) -> None:
    for one in known:
        assert np.min(np.abs(f - one)) < rel * one, (one, f)


# --- what elastic elements carry around -----


def hub_and_disc(s: Setting) -> mb.Model:
    m = mb.Model("hub and disc")
    parts = {"hub": (1.0, (0.01,) * 3), "disc": (10.0, (0.1, 0.05, 0.05))}
    made = {name: s.body(m, name, *parts[name]) for name in sorted(parts, reverse=s.backwards)}
    m.revolute("spin", m.ground, made["hub"], at=s.place(0, 0, 0), axis=s.axis)
    ends = ("disc", "hub") if s.backwards else ("hub", "disc")
    s.bushing(m, "shaft", made[ends[0]], made[ends[1]], (1e8, 1e6, 1e6, 1e5, 1e4, 1e4))
    return m


@cases
def test_a_disc_on_an_elastic_shaft_turns_with_its_hub(seed, units, backwards):
    """I w^2 -+ J W w - k = 0 with I = .05, J = .1, k = 1e4, W = 400: w = 1000 and 200 rad/s."""
    s = Setting(seed, units, backwards)
    m = hub_and_disc(s)
    turning = mb.steady_motion(m, {"spin": 400.0})
    assert turning.frame == "fixed" and turning.carried == ("disc",) and turning.error <= 1e-8
    f = hertz(mb.modes(m, at=turning))
    holds(f, 1000 / (2 * np.pi), 200 / (2 * np.pi))
    assert round(200 / (2 * np.pi), 3) == 31.831 and round(1000 / (2 * np.pi), 3) == 159.155
    w = mb.simulate(m, t=[0.01], at=turning, rtol=1e-9).angular_velocity("disc")[0]
    assert w == pytest.approx(400.0 * s.axis, rel=1e-6, abs=1e-4)


def test_what_ties_the_rotor_to_ground_is_named():
    s = Setting(5)
    m = hub_and_disc(s)
    s.bushing(m, "brake spring", m.ground, m["disc"], (0, 0, 0, 50.0, 0, 0))
    with pytest.raises(mb.ModelError, match="'brake spring' ties 'disc'"):
        mb.steady_motion(m, {"spin": 400.0})


def test_a_bushing_is_no_bearing_that_tilts():
    """Its angles are those of the whole turn: a spinning body needs one that stands around it."""
    s = Setting(6)
    m = mb.Model("disc in a bushing")
    d = s.body(m, "disc", 10.0, (0.1, 0.05, 0.05))
    s.bushing(m, "support", m.ground, d, (1e9, 1e6, 1e6, 0, 2e3, 2e3))
    with pytest.raises(mb.ModelError, match="several ways"):
        mb.steady_motion(m, {"disc": 200.0})
    m = mb.Model("disc in a bushing along z")
    d = m.body("disc", mass=10.0, inertia=(0.05, 0.05, 0.1), at=(0, 0, 0))
    m.bushing("support", m.ground, d, at=(0, 0, 0), k=(1e6, 1e6, 1e9, 2e3, 2e3, 0))
    with pytest.raises(mb.ModelError, match="support") as raised:
        mb.steady_motion(m, {"disc.rz": 200.0})
    assert "symmetric" in str(raised.value) and len(str(raised.value)) <= 700


@cases
def test_blades_on_bushings_are_carried_around(seed, units, backwards):
    """Three blades off the axis on soft bushings: they move outwards by m W^2 r / (k - m W^2), and whirl as carried masses do."""
    s = Setting(seed, units, backwards)
    m = mb.Model("blades")
    hub = s.body(m, "hub", 5.0, (0.3, 0.2, 0.2))
    m.revolute("spin", m.ground, hub, at=s.place(0, 0, 0), axis=s.axis)
    unit = np.array([s.mass] * 3 + [s.moment] * 3)
    for i in range(3):
        angle = 2 * np.pi * i / 3 + 0.3
        at = (0.0, 0.5 * np.cos(angle), 0.5 * np.sin(angle))
        b = s.body(m, f"blade{i}", 0.4, (0.01, 0.002, 0.01), at, turn=angle)
        R = s.R @ about_x(angle)
        k = np.array((1e4, 4e3, 9e3, 50.0, 60.0, 70.0)) * unit
        m.bushing(f"root{i}", hub, b, at=s.place(*at), k=k, orientation=R)
    W = 30.0
    turning = mb.steady_motion(m, {"spin": W})
    r = np.linalg.norm(turning.poses["position"][1] - s.length * s.origin) / s.length
    assert r == pytest.approx(0.5 * 4e3 / (4e3 - 0.4 * W**2), rel=1e-9)
    assert turning.frame == "rotating" and set(turning.carried) == {"blade0", "blade1", "blade2"}
    # along the axis nothing turns: sqrt(k / m)
    holds(hertz(mb.modes(m, at=turning)), np.sqrt(1e4 / 0.4) / (2 * np.pi))


# --- one disc, its supports equal or not -----


def supported_disc(s: Setting, k=(1e4, 2e4), inertia=(0.1, 0.05, 0.05), stator=1e-9):
    """A disc that turns in a ring without mass to speak of; the ring tilts on springs."""
    m = mb.Model("disc on supports")
    ring = s.body(m, "ring", 1e-6, (stator,) * 3)
    disc = s.body(m, "disc", 10.0, inertia)
    m.universal("gimbal", m.ground, ring, at=s.place(0, 0, 0), axis=s.R[:, 1], axis2=s.R[:, 2],
                k=np.array(k) * s.moment)  # fmt: skip
    m.revolute("spin", ring, disc, at=s.place(0, 0, 0), axis=s.axis)
    return m


@cases
def test_a_round_disc_on_unequal_supports(seed, units, backwards):
    """(k1 - I w^2)(k2 - I w^2) = (J W w)^2."""
    s = Setting(seed, units, backwards)
    m = supported_disc(s)
    turning = mb.steady_motion(m, {"spin": 400.0})
    assert turning.frame == "fixed"
    across, J, W, k1, k2 = 0.05, 0.1, 400.0, 1e4, 2e4
    exact = np.sqrt(np.sort(np.roots([across**2, -(across * (k1 + k2) + (J * W) ** 2), k1 * k2]))) / (2 * np.pi)
    assert exact == pytest.approx([41.58650, 172.27922], rel=1e-6)
    assert hertz(mb.modes(m, at=turning)) == pytest.approx(exact, rel=1e-6)


def unequal_shaft(s: Setting, gravity: bool = False) -> mb.Model:
    """A mass on a shaft with two stiffnesses across, between fixed bearings: the classic of Jeffcott's rotor with a flat shaft."""
    m = mb.Model("flat shaft", gravity=tuple(-9.81 * s.length * s.R[:, 2]) if gravity else None)
    hub = s.body(m, "hub", 1.0, (0.01,) * 3)
    disc = s.body(m, "disc", 10.0, (0.1, 0.05, 0.05))
    m.revolute("spin", m.ground, hub, at=s.place(0, 0, 0), axis=s.axis)
    s.bushing(m, "shaft", hub, disc, (1e8, 1e5, 4e5, 1e6, 1e6, 1e6))
    return m


@pytest.mark.some(2)
@cases
def test_an_unequal_shaft_is_unstable_between_its_two_frequencies(seed, units, backwards):
    """In turning axes m (u" - W^2 u - 2 W v') + k1 u = 0, m (v" - W^2 v + 2 W u') + k2 v = 0: unstable for k1/m < W^2 < k2/m."""
    s = Setting(seed, units, backwards)
    m = unequal_shaft(s)
    low, high = np.sqrt(1e5 / 10.0), np.sqrt(4e5 / 10.0)
    for W in (0.5 * low, 0.9999 * low, 1.0001 * low, 0.5 * (low + high), 0.9999 * high, 1.0001 * high, 2 * high):
        turning = mb.steady_motion(m, {"spin": W})
        assert turning.frame == "rotating"
        found = mb.modes(m, at=turning)
        w2 = np.roots([1.0, -(low**2 + high**2 + 2 * W**2), (low**2 - W**2) * (high**2 - W**2)])
        exact = np.sort(np.abs(np.sqrt(w2.astype(complex))))
        for one in exact:
            assert np.min(np.abs(np.abs(found.eigenvalue) - one)) < 1e-6 * max(one, 1.0)
        assert np.any(found.kind == "divergence") == (low < W < high), (W, found.kind)


def test_unequal_shaft_on_unequal_supports_is_refused():
    s = Setting(8)
    m = mb.Model("both unequal")
    ring = s.body(m, "ring", 1.0, (0.01,) * 3)
    hub = s.body(m, "hub", 1.0, (0.01,) * 3)
    disc = s.body(m, "disc", 10.0, (0.1, 0.05, 0.05))
    s.bushing(m, "pedestal", m.ground, ring, (1e6, 2e5, 3e5, 1e5, 1e5, 1e5))
    m.revolute("spin", ring, hub, at=s.place(0, 0, 0), axis=s.axis)
    s.bushing(m, "shaft", hub, disc, (1e8, 1e5, 4e5, 1e6, 1e6, 1e6))
    with pytest.raises(mb.ModelError) as raised:
        mb.steady_motion(m, {"spin": 50.0})
    assert "'shaft'" in str(raised.value) and "'pedestal'" in str(raised.value)
    m.set({"pedestal.k": (1e6, 3e5, 3e5, 1e5, 1e5, 1e5)})
    assert mb.steady_motion(m, {"spin": 50.0}).frame == "rotating"


def test_an_unbalanced_rotor_and_weight_across_the_axis_are_refused():
    s = Setting(9)
    m = mb.Model("unbalance")
    ring = s.body(m, "ring", 1.0, (0.01,) * 3)
    disc = s.body(m, "disc", 10.0, (0.1, 0.05, 0.05), at=(0.0, 1e-3, 0.0))
    s.bushing(m, "pedestal", m.ground, ring, (1e6, 2e5, 2e5, 1e5, 1e5, 1e5))
    m.revolute("spin", ring, disc, at=s.place(0, 0, 0), axis=s.axis)
    with pytest.raises(mb.ModelError, match="balanced"):
        mb.steady_motion(m, {"spin": 50.0})
    with pytest.raises(mb.ModelError, match="weight"):
        mb.steady_motion(unequal_shaft(s, gravity=True), {"spin": 50.0})


def windmill(s: Setting, n: int, gravity=None, tower=(1e6, 3e5, 8e5, 4e4, 5e4, 7e4), hinge=30.0) -> mb.Model:
    """Blades on sprung lead-lag hinges around a hub in an elastic tower head."""
    m = mb.Model("windmill", gravity=gravity)
    head = s.body(m, "head", 8.0, (0.4, 0.5, 0.5))
    s.bushing(m, "tower", m.ground, head, tower)
    hub = s.body(m, "hub", 2.0, (0.02, 0.03, 0.03) if n == 2 else (0.02, 0.02, 0.02))
    m.revolute("spin", head, hub, at=s.place(0, 0, 0), axis=s.axis)
    order = list(range(n))
    for i in reversed(order) if s.backwards else order:
        angle = 2 * np.pi * i / n + 0.4
        c, q = np.cos(angle), np.sin(angle)
        b = s.body(m, f"blade{i}", 0.5, (0.04, 1e-3, 0.04), (0.0, 0.6 * c, 0.6 * q), turn=angle)
        m.revolute(f"hinge{i}", hub, b, at=s.place(0, 0.2 * c, 0.2 * q), axis=s.axis, k=hinge * s.moment)
    return m


@pytest.mark.slow
@cases
def test_three_blades_on_an_unequal_tower_need_multiblade_coordinates(seed, units, backwards):
    """The eigenvalues s against the multipliers exp(2 pi s/W) of the periodic equations of motion in the plane of the blades."""
    s = Setting(seed, units, backwards)
    W = 9.0
    turning = mb.steady_motion(windmill(s, 3), {"spin": W})
    assert turning.frame == "multiblade"
    found = mb.modes(turning.linearization)
    rho = np.exp(found.roots * 2 * np.pi / W)
    for one in multipliers(W):
        if abs(one - 1) > 1e-3:  # the turning itself is a double root, which rounding splits by its root
            assert np.min(np.abs(rho - one)) < 1e-6, (one, rho)


def multipliers(W: float) -> np.ndarray:
    """Of the linear equations of hub (x, y), turning f and lags z_i, written down by hand: with n_i, u_i the directions along and
    across each blade's motion and s_i = e f + l (f + z_i), the blade's mass has r" = X" + (s" - W^2 s) n - 2 W s' u.
    """
    mass, e, arm_length, own, hub, hinge, heavy = 0.5, 0.2, 0.4, 0.04, 0.02, 30.0, 10.0
    K = np.diag([3e5, 8e5, 0.0, hinge, hinge, hinge])

    def rates(t: float, q: np.ndarray) -> np.ndarray:
        M, D, S = np.diag([heavy, heavy, hub, 0, 0, 0]).astype(float), np.zeros((6, 6)), K.copy()
        for i in range(3):
            psi = W * t + 2 * np.pi * i / 3 + 0.4
            u, n = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
            arm = np.zeros(6)
            arm[2], arm[3 + i] = e + arm_length, arm_length  # s_i
            turn = np.zeros(6)
            turn[2] = turn[3 + i] = 1.0  # f + z_i
            X = np.zeros((2, 6))
            X[0, 0] = X[1, 1] = 1.0
            to = X + np.outer(n, arm)  # velocity of the mass over the rates
            M += mass * to.T @ to + own * np.outer(turn, turn)
            # X rows: the whole r"; blade rows: n . r" and the centrifugal pull of the arms, which turn with f and f + z
            D[:2] += -2 * W * mass * np.outer(u, arm)
            S[:2] += -W * W * mass * np.outer(n, arm)
            S -= W * W * mass * np.outer(arm, arm)
            pull = (e + arm_length) * W * W * mass
            first = np.zeros(6)
            first[2] = 1.0
            S += pull * (e * np.outer(first, first) + arm_length * np.outer(turn, turn))
        return np.r_[q[6:], -np.linalg.solve(M, D @ q[6:] + S @ q[:6])]

    columns = [
        solve_ivp(rates, (0, 2 * np.pi / W), row, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1] for row in np.eye(12)
    ]
    return np.linalg.eigvals(np.array(columns).T)


@cases
def test_two_blades_on_an_unequal_tower_and_blades_under_their_weight_are_refused(seed, units, backwards):
    s = Setting(seed, units, backwards)
    with pytest.raises(mb.ModelError, match="no axes"):
        mb.steady_motion(windmill(s, 2), {"spin": 9.0})
    weight = tuple(-9.81 * s.length * s.R[:, 2])
    for n in (2, 3):
        with pytest.raises(mb.ModelError, match="weight"):
            mb.steady_motion(windmill(s, n, weight), {"spin": 9.0})
    equal = mb.steady_motion(windmill(s, 2, tower=(1e6, 3e5, 3e5, 4e4, 5e4, 5e4)), {"spin": 9.0})
    assert equal.frame == "rotating"


# --- elastic shafts -----

R_SHAFT, LENGTH, YOUNG, RHO = 0.1, 1.0, 2.1e11, 7800.0
AREA, SECOND = np.pi * R_SHAFT**2, np.pi * R_SHAFT**4 / 4


def whirl(n: int, W: float) -> np.ndarray:
    """Roots of (rho A + rho I l^2) w^2 - 2 rho I W l^2 w - E I l^4 = 0 with l = n pi / L: forward positive."""
    q = n * np.pi / LENGTH
    return np.sort(np.roots([RHO * AREA + RHO * SECOND * q**2, -2 * RHO * SECOND * W * q**2, -YOUNG * SECOND * q**4]))


def shaft(s: Setting, modes: int = 12) -> mb.Model:
    """A pinned round shaft that is a flexible body, in fixed bearings (stiff bushings without moments)."""
    per_length = s.mass / s.length
    stiff = YOUNG * SECOND * s.mass * s.length**3
    section = RHO * SECOND * s.mass * s.length
    body = mb.flexible.beam(
        LENGTH * s.length, mass=RHO * AREA * per_length, EI_flap=stiff, EI_edge=stiff, inertia_flap=section,
        inertia_edge=section, modes=modes, fixed=None, attach=["root", "tip"],
    )  # fmt: skip
    m = mb.Model("shaft")
    rotor = m.flexible_body("shaft", body, at=s.place(0, 0, 0), orientation=s.R)
    # its coordinates in axes along the shaft
    m.free("spin", m.ground, rotor.node("root"), at=s.place(0, 0, 0), orientation=s.R)
    ends = [("root", 0.0, 1e14), ("tip", LENGTH, 0.0)]
    for node, x, along in reversed(ends) if s.backwards else ends:
        s.bushing(m, f"bearing at {node}", m.ground, rotor.node(node), (along, 1e14, 1e14, 0, 0, 0), (x, 0, 0))
    return m


@pytest.mark.some(1)
@cases
def test_a_pinned_spinning_shaft(seed, units, backwards):
    s = Setting(seed, units, backwards)
    m = shaft(s)
    assert whirl(1, 0.0)[-1] / (2 * np.pi) == pytest.approx(402.5866, rel=1e-6)
    assert np.abs(whirl(1, 3000.0)) / (2 * np.pi) == pytest.approx([391.2535, 414.2481], rel=1e-6)
    for W in (0.0, 1000.0, 3000.0):
        turning = mb.steady_motion(m, {"spin.rx": W})
        assert turning.frame == "fixed"
        f = hertz(mb.modes(m, at=turning))
        holds(f, *np.abs(whirl(1, W)) / (2 * np.pi), rel=1e-5)
        holds(f, *np.abs(whirl(2, W)) / (2 * np.pi), rel=1e-4)


@pytest.mark.parametrize("seed, ratio", [(11, 0.5), (12, 3.0)])
def test_damping_that_turns_is_unstable_above_its_threshold(seed, ratio):
    """m r" + (c_i + c_e) r' + (k - i W c_i) r = 0: unstable above w_n (1 + c_e/c_i)."""
    s = Setting(seed)
    m = mb.Model("internal damping")
    hub = s.body(m, "hub", 1.0, (0.01,) * 3)
    disc = s.body(m, "disc", 10.0, (0.1, 0.05, 0.05))
    ring = s.body(m, "ring", 1e-6, (1e-9,) * 3)
    m.revolute("spin", m.ground, hub, at=s.place(0, 0, 0), axis=s.axis)
    s.bushing(m, "shaft", hub, disc, (1e8, 1e5, 1e5, 1e6, 1e6, 1e6), c=(0, 2.0, 2.0, 0, 0, 0))
    m.revolute("seal", ring, disc, at=s.place(0, 0, 0), axis=s.axis)
    s.bushing(m, "air", m.ground, ring, (0,) * 5 + (0,), c=(0, 2.0 * ratio, 2.0 * ratio, 0, 0, 0))
    threshold = np.sqrt(1e5 / 10.0) * (1 + ratio)
    for W, unstable in ((0.999 * threshold, False), (1.001 * threshold, True)):
        found = mb.modes(m, at=mb.steady_motion(m, {"spin": W}))
        whirling = np.abs(found.eigenvalue.imag) > 1.0
        assert np.any(found.eigenvalue.real[whirling] > 1e-9) == unstable, (W, found.eigenvalue)


def test_a_bending_pair_that_is_cut_in_two_is_named():
    """On equal bearings the turning axes serve then, on unequal ones nothing."""
    assert mb.steady_motion(shaft(Setting(13), modes=11), {"spin.rx": 500.0}).frame == "rotating"
    m = shaft(Setting(13), modes=11)
    m.set({"bearing at tip.k": (0.0, 1e8, 3e8, 0.0, 0.0, 0.0)})
    with pytest.raises(mb.ModelError, match="'shaft' do not turn into each other"):
        mb.steady_motion(m, {"spin.rx": 500.0})
    m = shaft(Setting(13), modes=12)
    m.set({"bearing at tip.k": (0.0, 1e8, 3e8, 0.0, 0.0, 0.0), "bearing at root.k": (1e8, 1e8, 3e8, 0.0, 0.0, 0.0)})
    assert mb.steady_motion(m, {"spin.rx": 500.0}).frame == "fixed"
