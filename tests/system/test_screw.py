"""The screw joint in every analysis, about leaning axes, against closed forms, SciPy and differences."""

import jitter
import mbrs as mb
import numpy as np
import pytest
from agreement import ANALYSES
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

SEEDS = range(3)


class Nut:
    """A body on a screw, its centre of mass off the axis: one equation J phi" + k phi = Q(phi)."""

    def __init__(self, seed, gravity=True, reverse=False, **spring):
        rng = np.random.default_rng(seed)
        self.n = rng.normal(size=3)
        self.n /= np.linalg.norm(self.n)
        self.at, self.arm = rng.normal(size=3), rng.normal(size=3)
        self.mass, self.pitch, self.k = rng.uniform(0.5, 2.0), rng.uniform(-0.4, 0.4), spring.get("k", 0.0)
        half = rng.normal(size=(3, 3))
        self.inertia = np.sum(half**2) * np.eye(3) - half @ half.T
        self.g = 3.0 * rng.normal(size=3) if gravity else np.zeros(3)
        self.rate = rng.uniform(1.0, 2.0)
        m = self.m = mb.Model("nut", gravity=tuple(self.g))
        com = self.at + self.arm
        spin = self.rate * self.n
        b = m.body(
            "nut",
            mass=self.mass,
            inertia=self.inertia,
            at=com,
            angular_velocity=spin,
            velocity=np.cross(spin, self.arm) + self.pitch * spin,
        )
        ends = (b, m.ground) if reverse else (m.ground, b)
        m.screw("thread", *ends, at=self.at, axis=self.n, pitch=self.pitch, **spring)

    @property
    def reduced(self):
        """n.J n + m (|n x r|^2 + p^2)."""
        across = np.cross(self.n, self.arm)
        return self.n @ self.inertia @ self.n + self.mass * (across @ across + self.pitch**2)

    def place(self, phi):
        """The centre of mass at an angle."""
        turned = Rotation.from_rotvec(phi * self.n).apply(self.arm)
        return self.at + turned + self.pitch * phi * self.n

    def force(self, phi):
        turned = Rotation.from_rotvec(phi * self.n).apply(self.arm)
        return self.mass * self.g @ (np.cross(self.n, turned) + self.pitch * self.n) - self.k * phi

    def motion(self, times):
        slope = lambda _, y: [y[1], self.force(y[0]) / self.reduced]  # noqa: E731
        return solve_ivp(
            slope, (0.0, times[-1]), [0.0, self.rate], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times
        ).y


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_modes(seed, reverse):
    """w^2 = k/J without gravity."""
    nut = Nut(seed, gravity=False, reverse=reverse, k=7.3)
    lin = mb.linearize(nut.m, without=("gravity",))
    assert lin.coordinates == ("thread",)
    assert lin.M[0, 0] == pytest.approx(nut.reduced, rel=1e-13)
    nut.m.set({"nut.velocity": (0, 0, 0), "nut.angular_velocity": (0, 0, 0)})
    modes = mb.modes(nut.m)
    assert 2 * np.pi * modes.frequency[0] == pytest.approx(np.sqrt(7.3 / nut.reduced), rel=1e-12)
    # dw/dp = -w m p/J
    found = mb.sensitivity(modes, "thread.pitch")
    w = np.sqrt(7.3 / nut.reduced)
    slope = np.ravel(found.eigenvalue)[0].imag
    assert slope == pytest.approx(-w * nut.mass * nut.pitch / nut.reduced, rel=1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_equilibrium_over_turns(seed):
    """A force along the axis and a torque about it wind up a spring: k phi = F p + T."""
    nut = Nut(seed, gravity=False, k=2.0)
    force, torque = 17.0, 9.0
    nut.m.set({"nut.velocity": (0, 0, 0), "nut.angular_velocity": (0, 0, 0)})
    nut.m.force("push", "nut", at=nut.at, value=force * nut.n)
    nut.m.torque("twist", "nut", value=torque * nut.n)
    eq = mb.equilibrium(nut.m)
    phi = (force * nut.pitch + torque) / 2.0
    assert eq.state.q[0] == pytest.approx(phi, rel=1e-12)
    # force, torque, stiffness, pitch and axis have noise each
    noise = 5 * jitter.level() * abs(phi) * np.linalg.norm(nut.place(phi))
    assert eq.position("nut") == pytest.approx(nut.place(phi), abs=1e-12 + noise)
    # the thread carries what the spring does not: all of the force along the axis
    assert eq.reactions["thread"][:3] @ nut.n == pytest.approx(-force, rel=1e-12)


@pytest.mark.some(6)
@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("method", ["explicit", "generalized-alpha", "ali3p", "radau", "bdf", "bdf-bfgs"])
def test_motion(method, reverse):
    nut = Nut(5, reverse=reverse, k=0.4)
    times = np.linspace(0.0, 3.0, 7)
    traj = mb.simulate(nut.m, times, rtol=1e-8, method=method)
    phi = nut.motion(times)[0]
    # ground against the nut turns the other way
    found = -traj.joint("thread") if reverse else traj.joint("thread")
    print(f"{method}: {np.abs(found - phi).max():.1e} rad of {np.ptp(phi):.1f}")
    assert np.abs(found - phi).max() < 2e-4
    assert np.abs(traj.position("nut") - [nut.place(x) for x in found]).max() < 1e-12
    if method == "explicit":
        assert np.abs(found - phi).max() < 1e-6
        assert np.ptp(np.asarray(traj.energy)) < 1e-6


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_gradients(scheme, reverse):
    """Direct and adjoint against differences of four points through the same discrete motion."""
    nut = Nut(2, reverse=reverse, k=0.9)
    names = ["thread.pitch", "thread.at[1]", "nut.mass", "thread.k"]
    psi = mb.Final(lambda s: s.position("nut") @ np.array([1.0, -2.0, 0.5]) + 0.1 * np.sum(s.velocity("nut") ** 2))
    options = {"t": 0.5, "step": 0.025, "scheme": scheme}
    direct = mb.gradient(nut.m, psi, names, method="direct", **options)
    adjoint = mb.gradient(nut.m, psi, names, method="adjoint", **options)
    assert adjoint.gradient == pytest.approx(direct.gradient, rel=1e-9, abs=1e-10)
    d = 1e-3
    value = {}
    for s in (-2, -1, 1, 2):
        other = Nut(2, reverse=reverse, k=0.9).m
        other.set({"thread.pitch": nut.pitch + s * d})
        value[s] = mb.gradient(other, psi, names[:1], method="direct", **options).value
    slope = (8 * (value[1] - value[-1]) - (value[2] - value[-2])) / (12 * d)
    assert direct.gradient[0] == pytest.approx(slope, rel=1e-8, abs=1e-9)


def vice(rng, order):
    """A spindle in a bearing, a jaw on rails and the screw between them; any of the three joints closes the loop."""
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    at = rng.normal(size=3)
    J, mass, pitch = rng.uniform(0.2, 0.6), rng.uniform(0.5, 2.0), rng.uniform(0.1, 0.3)
    m = mb.Model("vice")
    if order == 2:
        m.body("jaw", mass=mass, inertia=np.eye(3), at=at + 0.3 * n)
    m.body("spindle", mass=1.0, inertia=J * np.eye(3), at=at)
    if order != 2:
        m.body("jaw", mass=mass, inertia=np.eye(3), at=at + 0.3 * n)
    joints = [
        lambda: m.revolute("bearing", m.ground, "spindle", at=at, axis=n),
        lambda: m.prismatic("rails", m.ground, "jaw", at=at + 0.4 * n, axis=n),
        lambda: m.screw("thread", "spindle", "jaw", at=at + 0.1 * n, axis=n, pitch=pitch),
    ]
    for i in range(3):
        joints[(order + i) % 3]()
    m.torque("crank", "spindle", value=2.0 * n)
    return m, J, mass, pitch


@pytest.mark.parametrize("order", range(3))
@pytest.mark.parametrize("seed", SEEDS)
def test_a_closed_loop_over_many_turns(seed, order):
    """(J + m p^2) phi" = T; the jaw moves by -p phi against the thread that turns under it."""
    m, J, mass, pitch = vice(np.random.default_rng(seed), order)
    assert mb.System(m).dof == 1
    times = np.array([0.0, 2.0, 5.0])
    traj = mb.simulate(m, times, rtol=1e-9)
    phi = 0.5 * 2.0 / (J + mass * pitch**2) * times**2
    assert phi[-1] > 4 * np.pi
    assert np.ravel(traj.joint("bearing")) == pytest.approx(phi, rel=1e-7, abs=1e-9)
    assert np.ravel(traj.joint("rails")) == pytest.approx(-pitch * phi, rel=1e-7, abs=1e-9)
    assert np.ravel(traj.joint("thread")) == pytest.approx(-phi, rel=1e-7, abs=1e-9)
    names = ["thread.pitch"]
    psi = mb.Final(lambda s: s.joint("rails"))
    # s = -p T t^2/2 / (J + m p^2)
    t = 2.0
    exact = -(t**2) * (J - mass * pitch**2) / (J + mass * pitch**2) ** 2
    for method in ("direct", "adjoint"):
        found = mb.gradient(m, psi, names, t=t, step=0.01, method=method)
        assert found.gradient[0] == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_it_is_a_cylindrical_joint_with_a_coupler(seed):
    """The same rows by other means: matrices of the equilibrium under gravity."""
    found = []
    for kind in ("screw", "coupled"):
        nut = Nut(seed, k=40.0)
        m = mb.Model("twin", gravity=tuple(nut.g))
        b = m.body("nut", mass=nut.mass, inertia=nut.inertia, at=nut.at + nut.arm)
        if kind == "screw":
            m.screw("thread", m.ground, b, at=nut.at, axis=nut.n, pitch=nut.pitch, k=40.0, c=0.3)
        else:
            m.cylindrical("thread", m.ground, b, at=nut.at, axis=nut.n, k=(0.0, 40.0), c=(0.0, 0.3))
            m.coupler("lead", "thread", "thread", nut.pitch, first_coordinate="rz", second_coordinate="z")
        found.append(mb.modes(m, at=mb.equilibrium(m)).roots)
    assert found[0] == pytest.approx(found[1], rel=1e-10)


def press(seed):
    """The vice with a spring on the thread: a screw in a loop, or in the tree, as the order of definition says."""
    m, *_ = vice(np.random.default_rng(seed), seed % 3)
    n = np.asarray(m.value("bearing.axis"))
    m.torsion("hold", m.ground, "spindle", at=(0, 0, 0), axis=n, k=3.1, c=0.2)
    m.spring_damper("stop", m.ground, "jaw", at=((1, 2, 0.5), (0.4, 0.1, -0.3)), k=19.0, c=0.4)
    m.force("weight", "jaw", at=(0, 0, 0), value=1.3 * n)
    m.marker("tip", "jaw", at=(0.2, -0.1, 0.4))
    return m


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ANALYSES)
def test_the_reference_agrees(name, seed):
    table = mb.compare(ANALYSES[name](press(seed), "jaw"))
    assert bool(table), str(table)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_drive_on_a_screw(seed):
    """The driven nut moves by the lead for every turn, and the drive carries J phi" less gravity's share."""
    nut = Nut(seed)
    nut.m.drive("motor", "thread", mb.Ramp(nut.rate))
    times = np.linspace(0.0, 9.0, 5)
    traj = mb.simulate(nut.m, times, rtol=1e-9)
    assert nut.rate * times[-1] > 2 * np.pi
    assert np.ravel(traj.joint("thread")) == pytest.approx(nut.rate * times, abs=1e-9)
    supplied = [-nut.force(nut.rate * t) for t in times]
    assert np.ravel(traj.drive_force("motor")) == pytest.approx(supplied, abs=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_harmonic_balance(seed):
    """J phi" + c phi' + k phi + k3 phi^3 = T cos(w t): SciPy's motion from the start of the balance comes back after a period."""
    nut = Nut(seed, gravity=False, k=2.1, c=0.2, law=mb.Cubic(0.7))
    nut.m.set({"nut.velocity": (0, 0, 0), "nut.angular_velocity": (0, 0, 0)})
    w, torque = 1.3 * np.sqrt(2.1 / nut.reduced), 1.3
    X = mb.harmonic_balance(nut.m, force=[torque], omega=w, harmonics=15, tol=1e-8).X[0]
    order = np.arange(1, len(X[1::2]) + 1)
    start = [X[0] + np.sum(X[1::2]), w * np.sum(order * X[2::2])]

    def slope(t, y):
        return [y[1], (torque * np.cos(w * t) - 0.2 * y[1] - 2.1 * y[0] - 0.7 * y[0] ** 3) / nut.reduced]

    end = solve_ivp(slope, (0.0, 2 * np.pi / w), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert np.abs(start[0]) > 0.1
    assert end == pytest.approx(start, abs=1e-6 * np.linalg.norm(start))


def test_a_file_keeps_its_pitch(tmp_path):
    nut = Nut(1, k=3.0)
    again = mb.Model.load(nut.m.save(tmp_path / "nut.toml"))
    assert again.value("thread.pitch") == nut.pitch
    before, after = (mb.linearize(m).K[0, 0] for m in (nut.m, again))
    assert after == pytest.approx(before, rel=1e-13)
    with pytest.raises(mb.ModelError, match="screw joint 'thread'"):
        nut.m.save(tmp_path / "nut.urdf")


def test_a_screw_needs_its_pitch():
    m = mb.Model("bare")
    b = m.body("b", mass=1.0, inertia=np.eye(3), at=(0, 0, 0))
    with pytest.raises(mb.ModelError, match=r"thread\.pitch.*m per radian"):
        m.screw("thread", m.ground, b, at=(0, 0, 0), axis="z")
