"""Cases of the verification manual: equilibrium, modes, transfer functions, responses and sensitivities of small models.

Every model is turned into a frame along no axis of the world, so that no zero helps.
"""

from __future__ import annotations

import mbrs as mb
import mpmath
import numpy as np
import pytest
from scipy import linalg, optimize

G = 9.80665
R = linalg.expm(np.cross(np.eye(3), [0.31, -0.74, 0.52]))
X, Y, Z = R.T
DOWN = tuple(-G * Z)


def slider(m, name, mass, at=0.0, onto=None, **more):
    """A body that slides along the frame's first axis."""
    b = m.body(name, mass=mass, inertia=(0.1, 0.2, 0.15), at=at * X)
    m.prismatic(f"rail {name}", onto or m.ground, b, at=at * X, axis=X, **more)
    return b


def pendulum(gravity=DOWN, mass=2.3, arm=0.7, inertia=0.11, below=1.0, **hinge):
    """A compound pendulum about the second axis; ``below=-1`` draws it above its hinge."""
    m = mb.Model("pendulum", gravity=gravity)
    b = m.body("bob", mass=mass, inertia=R @ np.diag([0.05, inertia, 0.07]) @ R.T, at=-below * arm * Z)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=Y, **hinge)
    return m


def fallen(eq):
    """Angle by which a rod that was drawn along the first axis has turned downwards."""
    at = eq.position("rod")
    return np.arctan2(-at @ Z, at @ X)


# --- equilibrium -----


def test_a_spring_that_hangs(case):
    m = mb.Model("spring", gravity=tuple(G * X))
    slider(m, "mass", 3.7, k=812.0)
    eq = mb.equilibrium(m)
    case(
        "mass on a spring under gravity: sag",
        topic="statics",
        ours=eq.position("mass") @ X,
        known=3.7 * G / 812.0,
        within=1e-10,
        source="x = m g / k",
        estimate=eq.error,
        unit="m",
    )


def test_a_rod_on_a_torsion_spring(case):
    k, mass, arm = 31.0, 2.3, 0.7
    m = mb.Model("rod", gravity=DOWN)
    b = m.body("rod", mass=mass, inertia=(0.1, 0.1, 0.1), at=arm * X)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=Y, k=k)
    eq = mb.equilibrium(m)
    with mpmath.workdps(50):
        w = mpmath.mpf(mass) * mpmath.mpf(G) * mpmath.mpf(arm)
        known = float(mpmath.findroot(lambda x: mpmath.mpf(k) * x - w * mpmath.cos(x), 0.4))
    case(
        "rod on a torsion spring: angle at rest",
        topic="statics",
        kind="high precision",
        ours=fallen(eq),
        known=known,
        within=1e-10,
        source="k a = m g l cos a, root in 50 digits",
        estimate=eq.error,
        unit="rad",
    )


def test_a_rope_of_rods_hangs_like_its_polygon(case):
    """n equal rods between two supports: tan of rod i = w (n/2 - i - 1/2) / H, H from the span."""
    n, length, mass, span = 7, 0.4, 0.9, 1.9
    weight = mass * G

    def width(pull):
        t = weight * (np.arange(n) - (n - 1) / 2) / pull
        return np.sum(length / np.hypot(1, t)) - span

    pull = optimize.brentq(width, 1e-3, 1e4, xtol=1e-14)
    t = weight * (np.arange(n) - (n - 1) / 2) / pull
    along, up = length / np.hypot(1, t), length * t / np.hypot(1, t)
    ends = np.vstack([[0, 0], np.cumsum(np.c_[along, up], axis=0)])
    m = mb.Model("rope", gravity=DOWN)
    rng = np.random.default_rng(3)
    drawn = ends + np.r_[[[0, 0]], 0.004 * rng.normal(size=(n - 1, 2)), [[0, 0]]]
    last = m.ground
    world = drawn @ np.array([X, Z])
    for i in range(n):
        b = m.body(f"rod {i}", mass=mass, inertia=(1e-3, 1e-3, 1e-3), at=(world[i] + world[i + 1]) / 2)
        m.revolute(f"hinge {i}", last, b, at=world[i], axis=Y)
        last = b
    m.revolute("end", last, m.ground, at=world[-1], axis=Y)
    eq = mb.equilibrium(m)
    # the drawn lengths differ a little from those of the formula: compare with the polygon of the drawn lengths
    drawn_lengths = np.linalg.norm(np.diff(drawn, axis=0), axis=1)

    def residual(pull, shift):
        t = (weight * np.arange(n) + shift) / pull
        return np.sum(drawn_lengths / np.hypot(1, t)) - span, np.sum(drawn_lengths * t / np.hypot(1, t))

    pull, shift = optimize.fsolve(lambda z: residual(*z), [pull, -weight * (n - 1) / 2], xtol=1e-14)
    t = (weight * np.arange(n) + shift) / pull
    steps = np.c_[drawn_lengths / np.hypot(1, t), drawn_lengths * t / np.hypot(1, t)]
    known = np.cumsum(steps, axis=0) - steps / 2
    found = np.array([eq.position(f"rod {i}") @ np.array([X, Z]).T for i in range(n)])
    case(
        "seven rods between two supports: centres at rest",
        topic="statics",
        kind="independent script",
        ours=found,
        known=known,
        within=1e-8,
        uncertainty=1e-12,
        source="polygon of forces: tan a_i = (s + i m g) / H",
        estimate=eq.error,
        unit="m",
    )


def test_an_inverted_pendulum(case):
    k, arm, mass = 53.0, 0.6, 1.7
    m = mb.Model("inverted", gravity=DOWN)
    b = m.body("rod", mass=mass, inertia=R @ np.diag([0.05, 0.11, 0.07]) @ R.T, at=arm * Z)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=Y, k=k)
    known = np.sqrt((k - mass * G * arm) / (0.11 + mass * arm**2)) / (2 * np.pi)
    found = mb.modes(m)
    case(
        "inverted pendulum on a torsion spring: frequency",
        topic="modes",
        ours=found.frequency[0],
        known=known,
        within=1e-10,
        source="w^2 = (k - m g l) / (I + m l^2)",
        estimate=found.error,
        unit="Hz",
    )


# --- modes -----


def test_a_pendulum_swings_and_falls(case):
    for below, word in ((1.0, "hangs"), (-1.0, "is upside down")):
        found = mb.modes(pendulum(below=below))
        square = below * 2.3 * G * 0.7 / (0.11 + 2.3 * 0.49)
        case(
            f"compound pendulum that {word}: root",
            topic="modes",
            ours=found.roots[np.argmax(found.roots.real + found.roots.imag)],
            known=np.sqrt(complex(-square)),
            within=1e-10,
            source="s^2 = -m g l / (I + m l^2)",
            estimate=found.error,
            unit="1/s",
        )


def test_a_double_pendulum(case):
    """Two point masses on massless rods; the angle of the second is that between the rods, which changes no frequency."""
    m1, m2, l1, l2 = 2.1, 0.8, 0.9, 0.55
    M = np.array([[(m1 + m2) * l1**2, m2 * l1 * l2], [m2 * l1 * l2, m2 * l2**2]])
    K = np.diag([(m1 + m2) * G * l1, m2 * G * l2])
    m = mb.Model("double", gravity=DOWN)
    tiny = (1e-9, 1e-9, 1e-9)
    a = m.body("a", mass=m1, inertia=tiny, at=-l1 * Z)
    b = m.body("b", mass=m2, inertia=tiny, at=-(l1 + l2) * Z)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis=Y)
    m.revolute("B", a, b, at=-l1 * Z, axis=Y)
    M = M + 1e-9 * np.eye(2)
    known = np.sqrt(linalg.eigh(K, M, eigvals_only=True)) / (2 * np.pi)
    found = mb.modes(m)
    case(
        "double pendulum of two masses: frequencies",
        topic="modes",
        ours=found.frequency,
        known=known,
        within=1e-10,
        uncertainty=1e-14,
        source="Timoshenko, Young and Weaver (1974), small angles of both rods",
        estimate=found.error,
        unit="Hz",
    )


def test_a_chain_of_masses(case):
    n, k, mass = 25, 1.7e4, 0.31
    m = mb.Model("chain")
    last = m.ground
    for i in range(n):
        last = slider(m, f"b{i}", mass, at=0.1 * i, onto=last, k=k)
    known = 2 * np.sqrt(k / mass) * np.sin((2 * np.arange(1, n + 1) - 1) * np.pi / (2 * (2 * n + 1))) / (2 * np.pi)
    found = mb.modes(m)
    case(
        "25 masses in a row, fixed at one end: frequencies",
        topic="modes",
        ours=found.frequency,
        known=known,
        within=1e-10,
        source="w_j = 2 sqrt(k/m) sin((2 j - 1) pi / (4 n + 2))",
        estimate=found.error,
        unit="Hz",
    )


def test_the_lowest_modes_of_a_long_chain(case):
    n, k, mass = 3000, 1.7e4, 0.31
    m = mb.Model("long chain")
    last = m.ground
    for i in range(n):
        last = slider(m, f"b{i}", mass, at=0.1 * i, onto=last, k=k)
    known = 2 * np.sqrt(k / mass) * np.sin((2 * np.arange(1, 11) - 1) * np.pi / (2 * (2 * n + 1))) / (2 * np.pi)
    found = mb.modes(m, n=10)
    case(
        "3000 masses in a row: the ten lowest frequencies",
        topic="modes",
        ours=found.frequency,
        known=known,
        within=1e-7,
        source="w_j = 2 sqrt(k/m) sin((2 j - 1) pi / (4 n + 2))",
        estimate=found.error,
        unit="Hz",
    )


def test_the_isolator(case):
    edge, k, mass, inertia = 0.23, 1.1e5, 18.0, 0.17
    m = mb.examples.cubic_hexapod(edge=edge, k=k, c=0.0, mass=mass, inertia=inertia)
    squares = [2 * k / mass] * 3 + [k * edge**2 / (2 * inertia)] * 2 + [2 * k * edge**2 / inertia]
    found = mb.modes(m)
    case(
        "cubic isolator on six legs: frequencies",
        topic="modes",
        ours=found.frequency,
        known=np.sort(np.sqrt(squares)) / (2 * np.pi),
        within=1e-10,
        source="docs/theory.md (23.1)",
        estimate=found.error,
        unit="Hz",
    )


@pytest.mark.parametrize("zeta", [0.03, 0.7, 1.6])
def test_a_damped_oscillator(case, zeta):
    mass, k = 2.9, 4.1e3
    w = np.sqrt(k / mass)
    m = mb.Model("damped")
    slider(m, "b", mass, k=k, c=2 * zeta * np.sqrt(k * mass))
    found = mb.modes(m)
    known = np.roots([1, 2 * zeta * w, w * w])
    case(
        f"oscillator with damping ratio {zeta}: roots",
        topic="modes",
        ours=np.sort_complex(found.roots),
        known=np.sort_complex(known),
        within=1e-9,
        uncertainty=1e-15,
        source="s^2 + 2 zeta w s + w^2 = 0",
        estimate=found.error,
        unit="1/s",
    )


def test_a_bar_on_springs_at_its_ends(case):
    """Bounce and pitch of a rigid bar: M = diag(m, I), K = [[k1 + k2, k2 b - k1 a], [., k1 a^2 + k2 b^2]]."""
    mass, inertia, a, b, k1, k2 = 900.0, 700.0, 1.2, 1.5, 3.1e4, 2.7e4
    m = mb.Model("bar")
    bar = m.body("bar", mass=mass, inertia=R @ np.diag([350, inertia, 800]) @ R.T, at=(0, 0, 0))
    m.planar("plane", m.ground, bar, at=(0, 0, 0), axis=Y)
    for name, place, k in (("front", -a, k1), ("rear", b, k2)):
        m.spring_damper(name, m.ground, bar, at=(place * X - 0.5 * Z, place * X), k=k)
    known = np.sqrt(
        linalg.eigh(
            np.array([[k1 + k2, k2 * b - k1 * a], [k2 * b - k1 * a, k1 * a**2 + k2 * b**2]]),
            np.diag([mass, inertia]),
            eigvals_only=True,
        )
    ) / (2 * np.pi)
    found = mb.modes(m)
    case(
        "bar on two springs: bounce and pitch",
        topic="modes",
        ours=found.frequency[-2:],
        known=known,
        within=1e-10,
        uncertainty=1e-14,
        source="Den Hartog, Mechanical Vibrations, two degrees of freedom",
        estimate=found.error,
        unit="Hz",
    )


def test_a_tensioned_string_of_beads(case):
    """n beads on a wire under the tension T: w_j = 2 sqrt(T / (m d)) sin(j pi / (2 (n + 1)))."""
    n, tension, mass, d = 9, 340.0, 0.05, 0.12
    m = mb.Model("beads")
    last, at = m.ground, np.zeros(3)
    for i in range(1, n + 2):
        here = i * d * X
        b = m.ground
        if i <= n:
            b = m.body(f"b{i}", mass=mass, inertia=(1e-6, 1e-6, 1e-6), at=here)
            m.prismatic(f"p{i}", m.ground, b, at=here, axis=Z)
        m.spring_damper(f"s{i}", last, b, at=(at, here), k=1e5, preload=tension)
        last, at = b, here
    known = 2 * np.sqrt(tension / (mass * d)) * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1))) / (2 * np.pi)
    found = mb.modes(m)
    case(
        "nine beads on a tensioned wire: frequencies",
        topic="modes",
        ours=found.frequency,
        known=known,
        within=1e-9,
        source="w_j = 2 sqrt(T / (m d)) sin(j pi / (2 n + 2))",
        estimate=found.error,
        unit="Hz",
    )


def test_beck_and_ziegler(case):
    """Ziegler's column: two rods under a follower force flutters at P l / k = 7/2 - sqrt(2) for masses 2 m and m at the joints."""
    k, arm, mass = 7.3, 0.8, 1.3

    def growth(share):
        m = mb.Model("column")
        tiny = (1e-12, 1e-12, 1e-12)
        a = m.body("a", mass=2 * mass, inertia=tiny, at=arm * Z)
        b = m.body("b", mass=mass, inertia=tiny, at=2 * arm * Z)
        m.revolute("A", m.ground, a, at=(0, 0, 0), axis=Y, k=k)
        m.revolute("B", a, b, at=arm * Z, axis=Y, k=k)
        m.force("P", b, at=2 * arm * Z, value=-share * k / arm * Z, frame="body")
        return mb.modes(m).roots.real.max() * np.sqrt(mass * arm**2 / k)

    low, high = 1.9, 2.3
    while high - low > 1e-10:
        middle = (low + high) / 2
        low, high = (low, middle) if growth(middle) > 1e-4 else (middle, high)
    case(
        "Ziegler's column under a follower force: load of flutter",
        topic="modes",
        kind="publication",
        ours=high,
        known=3.5 - np.sqrt(2),
        within=1e-7,
        source="H. Ziegler, Ing.-Arch. 20 (1952) 49: P l / k = 7/2 - sqrt(2)",
        unit="k / l",
    )


# --- transfer functions and responses -----


def test_receptance_and_transmissibility(case):
    mass, k, c = 4.3, 2.2e4, 17.0
    m = mb.Model("sdof")
    b = slider(m, "b", mass, k=k, c=c)
    omega = np.linspace(1.0, 200.0, 57)
    h = mb.frf(m, b.force(X), b.motion(X), omega=omega)
    case(
        "oscillator: receptance at 57 frequencies",
        topic="transfer",
        ours=h.value.ravel(),
        known=1 / (k - mass * omega**2 + 1j * c * omega),
        within=1e-10,
        source="1 / (k - m w^2 + i c w)",
        estimate=h.error,
        unit="m/N",
    )
    t = mb.frf(m, mb.base_motion(X), b.motion(X), omega=omega, kind="transmissibility")
    known = (k + 1j * c * omega) / (k - mass * omega**2 + 1j * c * omega)
    case(
        "oscillator: transmissibility at 57 frequencies",
        topic="transfer",
        ours=t.value.ravel(),
        known=known,
        within=1e-10,
        source="(k + i c w) / (k - m w^2 + i c w)",
        estimate=t.error,
    )


def test_den_hartogs_absorber(case):
    """The tuned mass damper: both fixed points have the height sqrt(1 + 2/mu) at the tuning 1 / (1 + mu), at any damping."""
    mu, k, mass = 0.07, 3.0e4, 11.0
    w = np.sqrt(k / mass)
    tuned = w / (1 + mu)
    m = mb.Model("absorber")
    a = slider(m, "main", mass, k=k)
    slider(m, "small", mu * mass, at=0.3, onto=a, k=mu * mass * tuned**2, c=2 * 0.17 * mu * mass * tuned)
    # squares of the frequencies of the fixed points over w^2
    f = 1 / (1 + mu)
    squares = np.roots([2 + mu, -2 * (1 + f**2 + mu * f**2), 2 * f**2])
    h = mb.frf(m, a.force(X), a.motion(X), omega=np.sqrt(np.sort(squares)) * w)
    case(
        "tuned mass damper: height of both fixed points",
        topic="transfer",
        kind="publication",
        ours=np.abs(h.value.ravel()) * k,
        known=np.full(2, np.sqrt(1 + 2 / mu)),
        within=1e-9,
        uncertainty=1e-15,
        estimate=h.error,
        source="J. P. Den Hartog, Mechanical Vibrations, section 3.3: sqrt(1 + 2/mu)",
    )


def test_a_step_and_a_half_sine(case):
    mass, k, zeta = 1.9, 3.3e3, 0.04
    w = np.sqrt(k / mass)
    wd = w * np.sqrt(1 - zeta**2)
    m = mb.Model("step")
    b = slider(m, "b", mass, k=k, c=2 * zeta * mass * w)
    t = np.linspace(0, 0.9, 400)
    y = mb.response(m, t=t, loads={b.force(X): np.full(t.size, 7.0)}, outputs=b.motion(X))
    known = 7.0 / k * (1 - np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t)))
    case(
        "oscillator: response to a step, 400 times",
        topic="transfer",
        ours=y.value.ravel(),
        known=known,
        within=1e-9,
        source="F/k (1 - exp(-zeta w t) (cos w_d t + zeta w / w_d sin w_d t))",
        estimate=y.error,
        unit="m",
    )


def test_a_ramp_is_followed(case):
    mass, k = 2.6, 5.1e3
    w = np.sqrt(k / mass)
    m = mb.Model("ramp")
    b = slider(m, "b", mass, k=k)
    t = np.linspace(0, 1.3, 53)
    y = mb.response(m, t=t, loads={b.force(X): 40.0 * t}, outputs=b.motion(X))
    case(
        "undamped oscillator: response to a ramp, 53 times",
        topic="transfer",
        ours=y.value.ravel(),
        within=1e-9,
        known=40.0 / k * (t - np.sin(w * t) / w),
        source="a/k (t - sin(w t)/w)",
        estimate=y.error,
        unit="m",
    )


# --- sensitivities -----


def test_derivatives_of_a_frequency(case):
    mass, arm, inertia = 2.3, 0.7, 0.11
    m = pendulum(mass=mass, arm=arm, inertia=inertia, k=4.0)
    found = mb.modes(m)
    s = mb.sensitivity(found, ["bob.mass", "hinge.k"])
    J, K = inertia + mass * arm**2, mass * G * arm + 4.0
    f = np.sqrt(K / J) / (2 * np.pi)
    known = f / 2 * np.array([G * arm / K - arm**2 / J, 1 / K])
    case(
        "pendulum with a spring: df/dm and df/dk",
        topic="sensitivity",
        ours=s.frequency[0],
        known=known,
        within=1e-9,
        source="df/dp = f/2 (K'/K - J'/J), K = m g l + k, J = I + m l^2",
        unit="Hz per unit",
    )


def test_derivative_of_a_receptance(case):
    mass, k, c = 4.3, 2.2e4, 170.0
    m = mb.Model("sdof")
    b = m.body("b", mass=mass, inertia=(0.1, 0.2, 0.15))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=k, c=c)
    omega = np.linspace(1.0, 200.0, 31)
    h = mb.frf(m, b.force("x"), b.motion("x"), omega=omega)
    s = mb.sensitivity(h, ["b.mass", "rail.k", "rail.c"]).value.reshape(31, 3)
    value = 1 / (k - mass * omega**2 + 1j * c * omega)
    known = -(value[:, None] ** 2) * np.stack([-(omega**2), np.ones(31), 1j * omega], axis=1)
    case(
        "oscillator: derivatives of the receptance by m, k and c",
        topic="sensitivity",
        ours=s / np.abs(known).max(0),
        known=known / np.abs(known).max(0),
        within=1e-9,
        source="dH/dp = -H^2 dZ/dp",
        estimate=h.error,
    )


def test_derivatives_of_a_repeated_frequency(case):
    """The isolator's bounce is threefold: one leg softer splits it; the derivative of the sum of squares is the trace."""
    m = mb.examples.cubic_hexapod(edge=0.2, k=1e5, c=0.0, mass=20.0, inertia=0.15)
    found = mb.modes(m)
    s = mb.sensitivity(found, ["k_leg"])
    case(
        "cubic isolator: df/dk of all six modes, three and two of them equal",
        topic="sensitivity",
        ours=s.frequency[:, 0],
        known=found.frequency / (2 * 1e5),
        within=1e-9,
        source="w^2 is proportional to k: df/dk = f / (2 k)",
        unit="Hz m/N",
    )


def test_derivative_of_an_equilibrium(case):
    k, mass, arm = 31.0, 2.3, 0.7
    m = mb.Model("rod", gravity=DOWN)
    b = m.body("rod", mass=mass, inertia=(0.1, 0.1, 0.1), at=arm * X)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=Y, k=k)
    eq = mb.equilibrium(m)
    a = fallen(eq)
    s = mb.sensitivity(eq, ["rod.mass", "hinge.k"])
    # k |a| = m g l cos a, differentiated
    w = mass * G * arm
    known = np.array([G * arm * np.cos(a), -a]) / (k + w * np.sin(a))
    case(
        "rod on a torsion spring: derivatives of its angle",
        topic="sensitivity",
        ours=np.sign(s.coordinate[0, 0]) * s.coordinate[0],
        known=known,
        within=1e-8,
        uncertainty=1e-12,
        source="implicit derivative of k a = m g l cos a",
        estimate=eq.error,
    )


# --- rotors -----


def test_nutation_of_a_free_rotor(case):
    inertia, axial, speed = 0.31, 0.43, 87.0
    m = mb.Model("rotor")
    b = m.body(
        "rotor", mass=3.0, inertia=R @ np.diag([inertia, inertia, axial]) @ R.T, angular_velocity=tuple(speed * Z)
    )
    m.spherical("point", m.ground, b, at=(0, 0, 0))
    found = mb.modes(m)
    case(
        "free symmetric rotor: nutation",
        topic="rotors",
        ours=found.frequency.max(),
        known=speed * axial / inertia / (2 * np.pi),
        within=1e-9,
        source="w = J W / I (Euler)",
        estimate=found.error,
        unit="Hz",
    )


def test_a_rotor_on_elastic_bearings(case):
    """A symmetric disc on a rotational spring k about both diameters: I w^2 - J W w - k = 0 for w of both signs."""
    inertia, axial, k, speed = 0.31, 0.43, 950.0, 87.0
    m = mb.Model("whirl")
    b = m.body(
        "rotor", mass=3.0, inertia=R @ np.diag([inertia, inertia, axial]) @ R.T, angular_velocity=tuple(speed * Z)
    )
    m.spherical("point", m.ground, b, at=(0, 0, 0))
    hub = m.body("hub", mass=1e-6, inertia=(1e-9, 1e-9, 1e-9))
    m.revolute("bearing", hub, b, at=(0, 0, 0), axis=Z)
    m.bushing("spring", m.ground, hub, at=(0, 0, 0), orientation=R, k=(0, 0, 0, k, k, 1e3))
    found = mb.modes(m)
    small = 1e-9
    known = np.sort(np.abs(np.roots([inertia + small, -axial * speed, -k]))) / (2 * np.pi)
    f = np.sort(found.frequency)
    ours = [f[np.argmin(np.abs(f - one))] for one in known]
    case(
        "disc on an elastic bearing: backward and forward whirl",
        topic="rotors",
        ours=ours,
        known=known,
        within=1e-8,
        source="I w^2 - J W w - k = 0 (Genta, Dynamics of Rotating Systems, chapter 2)",
        estimate=found.error,
        unit="Hz",
    )
