"""Forces at nodes of beams: the stiffness of a column, a follower, a mass at the tip, against finite elements and closed forms."""

import mbrs as mb
import numpy as np
import pytest
from mbrs._lib.rotations import quaternion_matrix


def column(seed, share, frame="world", parts=1):
    """A cantilever under ``share`` of its buckling load pi^2 EI/(4 L^2) at the tip, in a random frame; and sqrt(EI/(m L^4)), rad/s."""
    rng = np.random.default_rng(seed)
    length, mass, EI = np.exp(rng.uniform([-1, -1, 2], [1, 1, 4]))
    R = mb.rotation(rng.normal(size=3), rng.uniform(0.3, 2.5))
    m, before, at = mb.Model("column"), None, rng.normal(size=3)
    for i in range(parts):
        beam = mb.flexible.beam(
            length / parts, mass=mass, EI_flap=EI, EI_edge=2.7 * EI, modes=8 if parts == 1 else 4, attach=["tip"]
        )
        part = m.flexible_body(f"beam{i}", beam, at=at, orientation=R)
        m.fixed(f"weld{i}", m.ground if before is None else before, part.node("root"))
        before, at = part.node("tip"), part.node("tip").at
    load = share * np.pi**2 * EI / (4 * length**2)
    along = np.array([-load, 0.0, 0.0])
    m.force("load", before, value=quaternion_matrix(R) @ along, frame=frame)
    return m, np.sqrt(EI / (mass * length**4))


def loaded_cantilever(load, n=20):
    """omega_1^2 of EI = mass = length = 1 under an axial tip load, by Hermite elements with their geometric stiffness."""
    h = 1.0 / n
    bend = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]) / h**3
    axial = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]) / (30 * h)
    heavy = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) * h / 420
    units = np.outer([1, h, 1, h], [1, h, 1, h])
    K, M = np.zeros((2, 2 * n + 2, 2 * n + 2))
    for i in range(n):
        own = np.ix_(range(2 * i, 2 * i + 4), range(2 * i, 2 * i + 4))
        K[own] += (bend - load * axial) * units
        M[own] += heavy * units
    return float(np.min(np.linalg.eigvals(np.linalg.solve(M[2:, 2:], K[2:, 2:])).real))


def euler(seed):
    """The lowest omega^2 over EI/(m L^4) of a random column as a function of the share of its Euler load."""

    def square(share, **kwargs):
        m, unit = column(seed, share, **kwargs)
        s = mb.modes(m).eigenvalue
        s = s[np.argmin(np.abs(s))]
        return float(-(s * s).real) / unit**2

    return square


@pytest.mark.some(4)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("share", [-0.5, 0.02, 0.3, 0.9, 0.99])
def test_a_dead_load(seed, share):
    found, truth = euler(seed)(share), loaded_cantilever(share * np.pi**2 / 4)
    print(f"share {share}: omega^2 {found:.8f}, finite elements {truth:.8f}")
    assert found == pytest.approx(truth, rel=2e-3, abs=2e-4)


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(2))
def test_eulers_load(seed):
    """Modes of the unloaded column are no buckling shape: eight leave 1e-5 of the load, one with a static shape of the tip less."""
    square = euler(seed)
    assert square(0.9999) > 0.0 > square(1.0001)


def test_becks_column():
    """A force that follows the tip: no divergence but flutter, at 20.0510 EI/L^2 (Beck 1952; V. V. Bolotin, Nonconservative Problems)."""

    def growth(load):
        m, unit = column(5, load / (np.pi**2 / 4), frame="body")
        return float(np.max(mb.modes(m).eigenvalue.real)) / unit

    print(f"growth at 20.0: {growth(20.0):.2e}, at 20.1: {growth(20.1):.3f}")
    assert growth(20.03) < 1e-4 < 0.1 < growth(20.07)


@pytest.mark.some(1)
@pytest.mark.parametrize("parts", [2, 4])
def test_welded_parts_agree(parts):
    share = 0.7
    truth = loaded_cantilever(share * np.pi**2 / 4)
    assert euler(1)(share, parts=parts) == pytest.approx(truth, rel=1e-3)


def tension(n, force, weight=0.0, spin=None):
    """omega (rad/s) of flapping of a cantilever (EI, m, L = 1) with the axial force ``force(x)`` and a tip mass, by Hermite elements."""
    h = 1.0 / n
    K, M = np.zeros((2, 2 * n + 2, 2 * n + 2))
    spots, weights = np.polynomial.legendre.leggauss(4)
    for i in range(n):
        own = np.arange(2 * i, 2 * i + 4)
        for s, w in zip(0.5 * (spots + 1), 0.5 * h * weights, strict=True):
            N = np.array([1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, h * (s**3 - s**2)])
            d = np.array([-6 * s + 6 * s**2, h * (1 - 4 * s + 3 * s**2), 6 * s - 6 * s**2, h * (3 * s**2 - 2 * s)]) / h
            c = np.array([12 * s - 6, h * (6 * s - 4), 6 - 12 * s, h * (6 * s - 2)]) / h**2
            K[np.ix_(own, own)] += w * (np.outer(c, c) + force((i + s) * h) * np.outer(d, d))
            M[np.ix_(own, own)] += w * np.outer(N, N)
    M[-2, -2] += weight
    return np.sqrt(np.min(np.linalg.eigvals(np.linalg.solve(M[2:, 2:], K[2:, 2:])).real))


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(3))
def test_a_mass_at_the_tip_of_a_rotor(seed):
    """Centrifugal stiffening by a mass that is welded to the tip: N(x) = W^2 (M (1 + r) + (1 - x)(r + (1 + x)/2))."""
    rng = np.random.default_rng(seed)
    weight, hub, speed = rng.uniform(0.3, 3.0), rng.uniform(0.0, 0.5), rng.uniform(1.0, 6.0)
    R = mb.rotation(rng.normal(size=3), rng.uniform(0.3, 2.5))
    turn = quaternion_matrix(R)
    m = mb.Model("rotor")
    beam = mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=90.0, modes=6, attach=["tip"])
    axis = m.body("axis", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.revolute("bearing", m.ground, axis, at=(0, 0, 0), axis=turn[:, 2])
    blade = m.flexible_body("blade", beam, at=turn @ [hub, 0, 0], orientation=R)
    m.fixed("root", axis, blade.node("root"))
    tip = m.body("tip", mass=weight, inertia=(1e-12, 1e-12, 1e-12), at=turn @ [1 + hub, 0, 0])
    m.fixed("weld", blade.node("tip"), tip)
    m.drive("speed", "bearing", mb.Ramp(speed))
    at = mb.steady_motion(m, speed={"bearing": speed})
    truth = tension(30, lambda x: speed**2 * (weight * (1 + hub) + (1 - x) * (hub + (1 + x) / 2)), weight)
    omega = mb.modes(m, at=at).omega
    found = omega[np.argmin(np.abs(omega - truth))]
    print(f"speed {speed:.3f}, mass {weight:.3f}: {found:.6f}, finite elements {truth:.6f} rad/s")
    assert found == pytest.approx(truth, rel=1e-3)


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(2))
def test_a_mass_on_a_column(seed):
    """Under gravity its own weight and that of the mass on top soften the column: N(x) = -g (M + 1 - x)."""
    rng = np.random.default_rng(seed)
    weight, g = rng.uniform(0.5, 2.0), rng.uniform(0.3, 0.7)
    R = mb.rotation(rng.normal(size=3), rng.uniform(0.3, 2.5))
    up = quaternion_matrix(R)[:, 0]
    m = mb.Model("column", gravity=-g * up)
    beam = mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=3.1, modes=6, attach=["tip"])
    part = m.flexible_body("column", beam, orientation=R)
    m.fixed("root", m.ground, part.node("root"))
    m.fixed("weld", part.node("tip"), m.body("top", mass=weight, inertia=(1e-12, 1e-12, 1e-12), at=up))
    truth = tension(30, lambda x: -g * (weight + 1 - x), weight)
    assert mb.modes(m).omega[0] == pytest.approx(truth, rel=1e-4)


@pytest.mark.some(1)
@pytest.mark.parametrize("free", [False, True])
def test_a_pinned_column(free):
    """Both ends hinged: pi^2 EI/L^2, of a beam that is held at its root and of a free one."""
    rng = np.random.default_rng(3)
    R = mb.rotation(rng.normal(size=3), 1.1)
    along, across = quaternion_matrix(R)[:, 0], quaternion_matrix(R)[:, 1]

    def square(share):
        m = mb.Model("pinned")
        given = dict(attach=["root", "tip"], fixed=None) if free else dict(attach=["tip"])
        turning = dict(GJ=1.9, inertia_flap=1e-7, inertia_edge=1e-7)
        beam = mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=2.7, modes=6, **turning, **given)
        part = m.flexible_body("beam", beam, orientation=R)
        m.revolute("left", m.ground, part.node("root"), at=(0, 0, 0), axis=across)
        block = m.body("block", mass=1e-3, inertia=(1e-3, 1e-3, 1e-3), at=along)
        m.prismatic("guide", m.ground, block, at=along, axis=along)
        m.revolute("right", block, part.node("tip"), at=along, axis=across)
        m.force("load", block, value=-share * np.pi**2 * along)
        s = mb.modes(m).eigenvalue
        return float(-(s[np.argmin(np.abs(s))] ** 2).real)

    exact = [np.pi**4 * (1 - share) for share in (0.0, 0.5, -0.4)]
    found = [square(share) for share in (0.0, 0.5, -0.4)]
    print(found, exact)
    assert found == pytest.approx(exact, rel=2e-3)


def test_energy_is_kept():
    """A heavy ball on a soft rod that swings and turns: the inertia of the nodes' second order belongs to their stiffness."""
    rng = np.random.default_rng(11)
    R = mb.rotation(rng.normal(size=3), 0.9)
    m = mb.Model("pendulum", gravity=(0.7, -5.3, 7.9))
    beam = mb.flexible.beam(0.83, mass=0.37, EI_flap=9.1, EI_edge=21.0, modes=2, attach=["tip"])
    turn = (0.3, 1.1, -2.3)
    part = m.flexible_body("rod", beam, orientation=R, angular_velocity=turn)
    m.spherical("pivot", m.ground, part.node("root"), at=(0, 0, 0))
    end = quaternion_matrix(R) @ [0.83, 0, 0]
    ball = m.body(
        "ball", mass=0.41, inertia=(1e-3, 2e-3, 1.7e-3), at=end, velocity=np.cross(turn, end), angular_velocity=turn
    )
    m.fixed("weld", part.node("tip"), ball)
    motion = mb.simulate(m, 1.5, rtol=1e-9)
    energy = motion.energy.total
    print("energy:", np.ptp(energy), "of", np.ptp(motion.energy.kinetic))
    assert np.ptp(energy) < 1e-6 * np.ptp(motion.energy.kinetic)


def narrow(seed, load, weight):
    """The lowest omega^2 of a deep, narrow cantilever under a tip load over sqrt(EI GJ)/L^2 and a weight over sqrt(EI GJ)/L^3."""
    rng = np.random.default_rng(seed)
    EI, GJ, length = np.exp(rng.uniform(-1, 1, 3))
    R = mb.rotation(rng.normal(size=3), rng.uniform(0.3, 2.5))
    down = -quaternion_matrix(R)[:, 1]
    size = np.sqrt(EI * GJ) / length**2
    mass = 0.83
    m = mb.Model("plate", gravity=down * weight * size / (mass * length))
    beam = mb.flexible.beam(
        length, mass=mass, EI_flap=EI, EI_edge=3e5 * EI, GJ=GJ, inertia_flap=1e-3, inertia_edge=1e-3, modes=24
    )
    part = m.flexible_body("plate", beam, orientation=R)
    m.fixed("clamp", m.ground, part.node("root"))
    m.force("load", part.node("tip"), value=load * size * down)
    lin = mb.linearize(m, at=mb.equilibrium(m))
    return float(np.min(np.linalg.eigvals(np.linalg.solve(lin.M, lin.K)).real))


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(2))
def test_lateral_buckling(seed):
    """Prandtl 1899: a tip load of 4.0126 sqrt(EI GJ)/L^2, a weight of 12.854 sqrt(EI GJ)/L^2 on the whole (S. P. Timoshenko,
    J. M. Gere, Theory of Elastic Stability, section 6.3).
    """
    for load, weight in ((4.0126, 0.0), (0.0, 12.854)):
        below, above = (narrow(seed, f * load, f * weight) for f in (0.997, 1.003))
        print(f"load {load}, weight {weight}: lowest omega^2 {below:.4g} and {above:.4g}")
        assert below > 0.0 > above
