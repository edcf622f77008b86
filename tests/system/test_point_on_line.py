"""A point on a line in every analysis, about leaning axes: against closed forms, SciPy, the reference and differences."""

import mbrs as mb
import numpy as np
import pytest
from agreement import ANALYSES
from scipy.integrate import solve_ivp

SEEDS = range(3)


class Wire:
    """A rod whose end slides on a leaning wire; the other end hangs. Two equations in a plane."""

    def __init__(self, seed, **spring):
        rng = np.random.default_rng(seed)
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        frame *= np.sign(np.linalg.det(frame))
        self.n, self.down, self.side = frame.T
        self.mass, self.length, self.J = rng.uniform(0.5, 2.0), rng.uniform(0.4, 0.9), rng.uniform(0.05, 0.2)
        self.g, self.k = rng.uniform(4.0, 9.0), spring.get("k", 0.0)
        at = rng.normal(size=3)
        self.at = at
        m = self.m = mb.Model("wire", gravity=tuple(self.g * self.down))
        turn = 0.7
        self.start = turn
        arm = self.length * (np.cos(turn) * self.down + np.sin(turn) * self.n)
        rod = m.body("rod", mass=self.mass, inertia=self.J * np.eye(3), at=at + arm)
        m.point_on_line("wire", m.ground, rod, at=at, axis=self.n, **spring)
        m.marker("end", rod, at=at)

    def motion(self, times):
        """(s, phi): (m s + m l sin phi)" + k s = 0, J phi" + m l (s" cos phi + l phi" + g sin phi) = 0."""
        m, arm, J, g = self.mass, self.length, self.J, self.g

        def slope(_, y):
            s, phi, ds, w = y
            A = np.array([[m, m * arm * np.cos(phi)], [m * arm * np.cos(phi), J + m * arm * arm]])
            f = [m * arm * w * w * np.sin(phi) - self.k * s, -m * g * arm * np.sin(phi)]
            return [ds, w, *np.linalg.solve(A, f)]

        return solve_ivp(
            slope, (0.0, times[-1]), [0.0, self.start, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times
        ).y


@pytest.mark.some(4)
@pytest.mark.parametrize("method", ["explicit", "generalized-alpha", "ali3p", "radau", "bdf", "bdf-bfgs"])
def test_motion(method):
    wire = Wire(3, k=2.3)
    times = np.linspace(0.0, 1.5, 6)
    traj = mb.simulate(wire.m, times, rtol=1e-7, method=method)
    s = wire.motion(times)[0]
    assert np.ptp(s) > 0.1
    assert np.abs(np.ravel(traj.joint("wire")) - s).max() < 2e-4
    end = traj.point("end") - wire.at
    assert np.abs(end - np.outer(end @ wire.n, wire.n)).max() < 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_modes(seed):
    """Hanging straight down: m s" + m l phi" + k s = 0, m l s" + (J + m l^2) phi" + m g l phi = 0; across it a pendulum."""
    wire = Wire(seed, k=3.7)
    m, arm, J, g = wire.mass, wire.length, wire.J, wire.g
    modes = mb.modes(wire.m, at=mb.equilibrium(wire.m))
    A = np.linalg.solve([[m, m * arm], [m * arm, J + m * arm * arm]], np.diag([3.7, m * g * arm]))
    known = np.sqrt([*np.linalg.eigvals(A).real, m * g * arm / (J + m * arm * arm)]) / (2 * np.pi)
    found = np.asarray(modes.frequency)
    for f in known:
        assert np.min(np.abs(found - f)) < 1e-8 * f
    assert mb.System(wire.m).dof == 4


def mechanism(seed, reverse, gravity=1.0, **spring):
    """A crank whose pin runs in a slot of a lever (or the other way round): one degree of freedom, closed by the slot."""
    rng = np.random.default_rng(seed)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    x, y, z = frame.T
    m = mb.Model("slot", gravity=tuple(gravity * (0.3 * z - 7.0 * y)))
    crank = m.body("crank", mass=0.8, inertia=(0.03, 0.04, 0.05), at=0.2 * x)
    lever = m.body("lever", mass=1.7, inertia=(0.2, 0.3, 0.1), at=0.3 * x - 0.5 * y)
    m.revolute("A", m.ground, crank, at=(0, 0, 0), axis=z, k=1.9, c=0.2)
    m.revolute("B", m.ground, lever, at=-0.9 * y, axis=z)
    line = 0.4 * x + 0.9 * y
    line = line / np.linalg.norm(line)
    ends = (lever, crank) if not reverse else (crank, lever)
    m.point_on_line("slot", *ends, at=0.4 * x, axis=line, k=11.0, c=0.4, **spring)
    m.marker("tip", lever, at=0.3 * x)
    return m


@pytest.mark.oracle
@pytest.mark.filterwarnings("ignore:the frequency points miss")
@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("name", ANALYSES)
def test_the_reference_agrees(name, reverse):
    table = mb.compare(ANALYSES[name](mechanism(4, reverse), "lever"))
    assert bool(table), str(table)


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_gradients(scheme):
    """Direct and adjoint against differences of four points through the same discrete motion."""
    names = ["slot.at[1]", "crank.mass", "slot.k"]
    psi = mb.Final(lambda s: s.position("lever") @ np.array([1.0, -2.0, 0.5]) + 0.1 * np.sum(s.velocity("crank") ** 2))
    options = {"t": 0.3, "step": 0.02, "scheme": scheme}
    m = mechanism(2, False)
    direct = mb.gradient(m, psi, names, method="direct", **options)
    adjoint = mb.gradient(m, psi, names, method="adjoint", **options)
    assert adjoint.gradient == pytest.approx(direct.gradient, rel=1e-8, abs=1e-10)
    for i, name in enumerate(names):
        assert direct.gradient[i] == pytest.approx(slope(psi, name, options), rel=1e-6, abs=1e-8), name


def slope(psi, name, options):
    """Differences of four points of a parameter, or of one entry "name[i]" of it."""
    name, _, entry = name.partition("[")
    base, d, value = np.asarray(mechanism(2, False).value(name), float), 1e-3, {}
    step = np.zeros(base.shape)
    step[int(entry[:-1]) if entry else ...] = d
    for s in (-2, -1, 1, 2):
        other = mechanism(2, False)
        other.set({name: base + s * step})
        value[s] = mb.gradient(other, psi, ["slot.k"], method="direct", **options).value
    return (8 * (value[1] - value[-1]) - (value[2] - value[-2])) / (12 * d)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sensitivity(seed):
    """The sum of w^2 is the trace of M^-1 K: its derivative by k is (J + m l^2)/(m J)."""
    wire = Wire(seed, k=3.7)
    modes = mb.modes(wire.m, at=mb.equilibrium(wire.m))
    slope = np.asarray(mb.sensitivity(modes, "wire.k").eigenvalue).reshape(len(modes.eigenvalue), -1)[:, 0]
    moving = modes.frequency > 1e-3
    found = np.sum((-2 * modes.eigenvalue * slope)[moving].real)
    assert found == pytest.approx((wire.J + wire.mass * wire.length**2) / (wire.mass * wire.J), rel=1e-8)


def test_a_drive_on_a_line():
    m = mechanism(5, False)
    m.drive("push", "slot", mb.Sine(0.05, 3.0))
    times = np.linspace(0.0, 1.0, 5)
    traj = mb.simulate(m, times, rtol=1e-9)
    assert np.ravel(traj.joint("slot")) == pytest.approx(0.05 * np.sin(3.0 * times), abs=1e-9)


def test_a_file_keeps_it(tmp_path):
    m = mechanism(1, False)
    again = mb.Model.load(m.save(tmp_path / "slot.toml"))
    before, after = (mb.linearize(model, without=("gravity",)).K[0, 0] for model in (m, again))
    assert after == pytest.approx(before, rel=1e-13)


@pytest.mark.parametrize("seed", SEEDS)
def test_harmonic_balance(seed):
    """u = |P - B| - |P0 - B|: with u' = l_u, psi' = l_psi at the drawn pose, J phi" + c phi' + k phi + 40 l_u^4 phi^3 = T cos(w t)."""
    m = mechanism(seed, False, gravity=0.0, law=mb.Cubic(40.0))
    z = np.asarray(m.value("A.axis"))
    long = np.hypot(0.4, 0.9)
    l_u, l_psi = 0.36 / long, 0.16 / long**2
    J = z @ np.diag([0.03, 0.04, 0.05]) @ z + 0.8 * 0.2**2
    J += l_psi**2 * (z @ np.diag([0.2, 0.3, 0.1]) @ z + 1.7 * 0.25)
    c, k, k3 = 0.2 + 0.4 * l_u**2, 1.9 + 11.0 * l_u**2, 40.0 * l_u**4
    w, torque = 1.2 * np.sqrt(k / J), 2.0
    (X,) = mb.harmonic_balance(m, force=[torque], omega=w, harmonics=15, tol=1e-8).X
    start = [X[0] + np.sum(X[1::2]), w * np.sum(np.arange(1, 16) * X[2::2])]

    def slope(t, y):
        return [y[1], (torque * np.cos(w * t) - c * y[1] - k * y[0] - k3 * y[0] ** 3) / J]

    end = solve_ivp(slope, (0.0, 2 * np.pi / w), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert k3 * start[0] ** 2 > 0.02 * k
    assert end == pytest.approx(start, abs=1e-6 * np.linalg.norm(start))


@pytest.mark.parametrize("seed", SEEDS)
def test_assembly_brings_the_point_onto_the_line(seed):
    rng = np.random.default_rng(seed)
    m = mb.Model("apart")
    beam = m.body("beam", mass=1.0, inertia=(1.0, 1.1, 1.2), at=rng.normal(size=3))
    on, off, n = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
    m.point_on_line("slot", m.ground, beam, at=(on, off), axis=n)
    m.marker("pin", beam, at=off)
    away = mb.simulate(m, np.linspace(0.0, 0.2, 3)).point("pin") - on
    assert np.linalg.norm(np.cross(n, off - on)) > 0.1
    assert np.abs(np.cross(n, away)).max() < 1e-9
