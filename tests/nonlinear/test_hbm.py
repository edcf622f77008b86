"""Single harmonic-balance solutions: core against reference, and published or independently computed values."""

import numpy as np
import pytest
from mbrs.errors import ConvergenceError, ModelError
from mbrs.examples import duffing
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import (
    CoulombTanh,
    Cubic,
    FunctionLaw,
    Gap,
    Hertz,
    Iwan,
    Jenkins,
    Polynomial1D,
    VanDerPol,
    VaryingStiffness,
)
from mbrs.nonlinear.options import Fourier
from mbrs.nonlinear.periodic import harmonic_balance
from mbrs.reference import hbm_balance


def two_masses(*elements):
    return MechanicalSystem(
        [[1.0, 0.1], [0.1, 2.0]],
        [[0.1, -0.02], [-0.02, 0.05]],
        [[2.0, -1.0], [-1.0, 3.0]],
        G=[[0.0, 0.3], [-0.3, 0.0]],
        N=[[0.0, 0.05], [-0.05, 0.0]],
        elements=elements,
    )


# docs/theory.md (23.5): the Duffing example of NLvib, 8 decimals
@pytest.mark.parametrize(
    ("omega", "expected"),
    [(0.5, 0.23850991), (0.8, 0.47487205), (0.9, 0.75793394), (1.0, 1.30534547), (1.5, 0.14391972)],
)
def test_duffing_amplitudes(omega, expected):
    one = harmonic_balance(duffing(), force=[0.18], omega=omega, harmonics=7)
    assert one.amplitude() == pytest.approx(expected, abs=5e-9)
    assert one.status == "converged" and one.error < 1e-6


def test_duffing_has_three_solutions_at_omega_1_2():
    # docs/theory.md (23.5)
    found = set()
    for a, b in [(1.4, 2.1), (-1.5, 1.7), (-0.4, 0.1)]:
        one = harmonic_balance(duffing(), force=[0.18], omega=1.2, harmonics=7, x0=[[0.0, a, b]])
        found.add(round(one.amplitude(), 8))
    assert found == {2.50919758, 2.26054889, 0.41752045}


SYSTEMS = {
    "cubic": two_masses(Cubic(0.5, w=[1.0, -1.0])),
    "polynomial": two_masses(Polynomial1D([0.1, 0.2, 0.1, 0.3], [0.0, 0.1, 0.0, 0.2], w=[1.0, 0.0])),
    "gap": two_masses(Gap(20.0, 0.1, w=[0.0, 1.0])),
    "smooth gap": two_masses(Gap(20.0, 0.1, smoothing=0.02, bilateral=True, w=[0.0, 1.0])),
    "friction": two_masses(CoulombTanh(0.2, 0.1, w=[1.0, 0.5])),
    "hertz": two_masses(Hertz(3.0, 1.5, 0.05, w=[1.0, -1.0])),
    "van der pol": two_masses(VanDerPol(0.3, w=[0.0, 2.0])),
    "jenkins": two_masses(Jenkins(0.7, 0.2, w=[1.0, 0.0])),
    "iwan": two_masses(Iwan([0.7, 0.3], [0.2, 0.05], w=[1.0, 0.0])),
    "parametric": two_masses(VaryingStiffness(0.4, 2, 0.3, w=[1.0, 0.0])),
    "many": two_masses(Cubic(0.5, w=[1.0, -1.0]), VanDerPol(0.3, w=[0.0, 1.0]), Jenkins(0.5, 0.2, w=[1.0, 1.0])),
}
FORCE = {0: [0.1, 0.0], 1: [0.8, 0.3 - 0.4j], 3: [0.0, 0.2j]}


# The core integrates the force of a sharp contact exactly, the reference samples it: (samples, error of solution and residual, of the
# Jacobian), the errors those of the samples.
SAMPLED = {"gap": (1 << 16, 1e-6, 2e-3)}


@pytest.mark.some(12)
@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize(("harmonics", "subharmonic"), [((1, 2, 3, 4, 5), 1), ((1, 3, 5), 1), ((2, 3, 4, 6), 2)])
def test_core_equals_reference(name, harmonics, subharmonic):
    system = SYSTEMS[name]
    force = FORCE if subharmonic == 1 else {0: [0.1, 0.0], 1: [0.8, 0.3 - 0.4j], 3: [0.0, 0.2j]}
    one = harmonic_balance(system, force=force, omega=1.3, harmonics=harmonics, subharmonic=subharmonic)
    y = one.X[:, [0, *(i for h in harmonics for i in (2 * h - 1, 2 * h))]]
    n, error, _ = SAMPLED.get(name, (one.n_samples, 1e-10, 0.0))
    reference = hbm_balance.harmonic_balance(system, force, 1.3, harmonics, n, y + 1e-4, subharmonic)
    assert np.max(np.abs(y - reference)) < error


@pytest.mark.parametrize("name", SYSTEMS)
def test_jacobian_equals_reference(name):
    from mbrs.nonlinear import balance

    setup = balance.prepare(SYSTEMS[name], FORCE, Fourier(3, 512))
    y = np.sin(np.arange(14.0))
    core = setup.core.residual(y, [1.3])
    n, error, slope_error = SAMPLED.get(name, (512, 1e-12, 1e-11))
    R, J, R_omega = hbm_balance.residual(SYSTEMS[name], y, FORCE, 1.3, (1, 2, 3), n)
    assert np.max(np.abs(core["residual"] - R)) < error
    assert np.max(np.abs(core["jacobian"] - J)) < slope_error
    assert np.max(np.abs(core["slope"] - R_omega)) < 1e-11


@pytest.mark.parametrize(
    "law", [Gap(20.0, 0.1, w=[1.0]), Gap(20.0, 0.4, bilateral=True, w=[1.0]), Gap(5.0, -0.3, w=[1.0])]
)
def test_sharp_contact_is_what_samples_tend_to(law):
    # errors of the samples' force shrink with the square of their number, those of its slope in proportion
    from mbrs.nonlinear import balance

    system = MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[law])
    y = np.sin(np.arange(11.0))
    core = balance.prepare(system, [0.3], Fourier(5, 64)).core.residual(y, [1.3])
    forces, slopes = [], []
    for n in (1 << 8, 1 << 12, 1 << 16):
        R, J, _ = hbm_balance.residual(system, y, {1: [0.3]}, 1.3, (1, 2, 3, 4, 5), n)
        forces.append(np.max(np.abs(core["residual"] - R)))
        slopes.append(np.max(np.abs(core["jacobian"] - J)))
    assert forces[1] < 0.05 * forces[0] and forces[2] < 0.05 * forces[1] and forces[2] < 1e-6
    assert slopes[1] < 0.5 * slopes[0] and slopes[2] < 0.5 * slopes[1] and slopes[2] < 2e-3


def test_jacobian_of_a_sharp_contact_is_exact():
    from mbrs.nonlinear import balance

    system = MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[Gap(20.0, 0.4, bilateral=True, w=[1.0])])
    core = balance.prepare(system, [0.3], Fourier(5)).core
    y, step = np.sin(np.arange(11.0)), 1e-5
    jacobian = core.residual(y, [1.3])["jacobian"]
    for i in range(11):
        e = step * np.eye(11)[i]
        slope = (core.residual(y + e, [1.3])["residual"] - core.residual(y - e, [1.3])["residual"]) / (2 * step)
        assert np.max(np.abs(slope - jacobian[:, i])) < 1e-7


def test_linear_system_is_exact():
    system = two_masses()
    one = harmonic_balance(system, force=FORCE, omega=0.9, harmonics=3)
    C, K = system.C + system.G, system.K + system.N
    for h, f in FORCE.items():
        w = 0.9 * h
        x = np.linalg.solve(K - w**2 * system.M + 1j * w * C, np.asarray(f, complex))
        assert np.allclose([one.coefficient(d, h) for d in range(2)], x, rtol=1e-12)
    assert one.error < 1e-12 and one.amplitude(0, 2) == 0


def test_frequency_is_omega_over_two_pi():
    a = harmonic_balance(duffing(), force=[0.18], frequency=0.8 / (2 * np.pi))
    b = harmonic_balance(duffing(), force=[0.18], omega=0.8)
    assert np.allclose(a.X, b.X, atol=1e-14) and a.frequency == pytest.approx(0.8 / (2 * np.pi))


def test_phase_of_the_force_shifts_the_motion():
    a = harmonic_balance(duffing(), force=[0.18], omega=0.8)
    b = harmonic_balance(duffing(), force=[-0.18j], omega=0.8)  # a sine
    t = np.linspace(0, 5, 11)
    assert np.allclose(b.displacement(t + np.pi / 2 / 0.8), a.displacement(t), atol=1e-10)


def test_estimate_is_of_the_size_of_the_error():
    ratios = []
    for H in (1, 2, 3, 4, 5, 7):
        for omega in (0.6, 0.8, 0.95, 1.4):
            one = harmonic_balance(duffing(), force=[0.18], omega=omega, harmonics=H)
            fine = harmonic_balance(duffing(), force=[0.18], omega=omega, harmonics=25, x0=one)
            t = np.linspace(0, one.period, 500)
            true = np.max(np.abs(fine.displacement(t) - one.displacement(t))) / np.max(np.abs(one.X))
            if true > 1e-12:  # below, rounding is larger than truncation
                ratios.append(true / one.error)
    assert len(ratios) > 18 and min(ratios) > 0.5 and max(ratios) < 2


def test_verify_by_integration():
    assert harmonic_balance(duffing(), force=[0.18], omega=0.9, harmonics=15).verify() < 1e-8
    coarse = harmonic_balance(duffing(), force=[0.18], omega=0.9, harmonics=1)
    assert 1e-3 < coarse.verify() < 0.1
    many = two_masses(
        Cubic(0.5, w=[1.0, -1.0]), VaryingStiffness(0.4, 2, 0.3, w=[1.0, 0.0]), VanDerPol(0.1, w=[1.0, 0.0])
    )
    assert harmonic_balance(many, force=FORCE, omega=1.3, harmonics=25).verify() < 1e-7


def test_zero_force_is_rest():
    one = harmonic_balance(duffing(), force=[0.0], omega=1.0)
    assert not one.X.any() and one.error == 0 and one.status == "converged"


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_scaled_units(scale):
    # x = scale z: the same motion in other units of force and length
    one = harmonic_balance(duffing(0.1 / scale**2), force=[0.18 * scale], omega=0.9)
    assert one.amplitude() / scale == pytest.approx(0.75793394, abs=5e-9)


def test_many_harmonics():
    one = harmonic_balance(duffing(), force=[0.18], omega=0.9, harmonics=255)
    assert one.amplitude() == pytest.approx(0.75793394, abs=5e-9)
    assert np.max(np.abs(one.X[0, 100:])) < 1e-12


def test_light_damping():
    # at the linear resonance of the undamped oscillator, zeta = 1e-6, without nonlinearity: x = -i f / (c omega)
    one = harmonic_balance(duffing(0.0, 2e-6), force=[1e-6], omega=1.0)
    assert one.coefficient() == pytest.approx(-0.5j, rel=1e-9)


def test_static_load_alone():
    # x + 0.1 x^3 = 1.1 has the root 1
    one = harmonic_balance(duffing(), force={0: [1.1]}, omega=1.0)
    assert one.X[0, 0] == pytest.approx(1.0, abs=1e-12) and not one.X[0, 1:].any()


def test_stick_is_the_spring():
    stick = MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[Jenkins(2.0, 1e6, w=[1.0])])
    spring = MechanicalSystem([[1.0]], [[0.1]], [[3.0]])
    a = harmonic_balance(stick, force=[1.0], omega=1.2)
    b = harmonic_balance(spring, force=[1.0], omega=1.2)
    assert np.allclose(a.X, b.X, atol=1e-12)


def test_stiff_contact():
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[Gap(1e4, 1.0, w=[1.0])])
    one = harmonic_balance(system, force=[0.5], omega=0.9, harmonics=60, n_samples=4096)
    assert 1.0 < np.max(one.displacement(np.linspace(0, one.period, 2000))) < 1.05
    print(f"contact 1e4 times stiffer, H = 60: estimated error {one.error:.1e}, integrated {one.verify():.1e}")


def test_result_reads_saves_and_plots(tmp_path):
    import pickle

    one = harmonic_balance(SYSTEMS["many"], force=FORCE, omega=1.3)
    assert "converged" in str(one) and "x1" in str(one)
    twin = pickle.loads(one.save(tmp_path / "one.pkl").read_bytes())
    assert np.array_equal(twin.X, one.X)
    data = one.to_xarray()
    assert float(data.X.sel(coordinate="x0", harmonic=3, part="sin")) == one.X[0, 6]
    import matplotlib

    matplotlib.use("Agg")
    one.plot()
    one.plot_orbit(1)
    assert one.stats.counts["iterations"] > 0 and "Cubic" in one.stats.effects


def test_failure_carries_what_it_reached():
    free = MechanicalSystem([[1.0]], [[0.1]], [[0.0]])  # no periodic motion: the static force accelerates it for ever
    with pytest.raises(ConvergenceError, match="singular") as caught:
        harmonic_balance(free, force={0: [1.0], 1: [0.1]}, omega=0.9)
    assert caught.value.result.X.shape == (1, 15) and caught.value.result.status == "stopped"


def cubic(t, u, v):
    return 0.1 * u**3


def test_function_law_equals_the_law_of_the_core():
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[FunctionLaw(cubic, w=[1.0])])
    one = harmonic_balance(system, force=[0.18], omega=0.9, n_samples=32)
    same = harmonic_balance(duffing(), force=[0.18], omega=0.9, n_samples=32)
    assert np.max(np.abs(one.X - same.X)) < 1e-10
    assert one.verify() < 1e-6


def test_function_that_returns_nan_or_fails_is_named():
    def nan(t, u, v):
        return np.full_like(u, np.nan)

    def slopes(t, u, v):
        return np.zeros_like(u), np.zeros_like(u)

    def broken(t, u, v):
        raise RuntimeError("no force today")

    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[FunctionLaw(nan, slopes, w=[1.0])])
    with pytest.raises(ConvergenceError, match=r"elements\[0\], FunctionLaw\(nan.*not finite") as caught:
        harmonic_balance(system, force=[0.18], omega=0.9)
    assert caught.value.result is not None
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[FunctionLaw(broken, slopes, w=[1.0])])
    with pytest.raises(RuntimeError, match="no force today") as raised:
        harmonic_balance(system, force=[0.18], omega=0.9)
    assert "raised by the function of FunctionLaw(broken" in raised.value.__notes__[0]


def test_overflowing_law_is_named():
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[Polynomial1D([0.0] * 200 + [1e300], w=[1.0])])
    with pytest.raises(ConvergenceError, match=r"elements\[0\]|did not converge"):
        harmonic_balance(system, force=[1e6], omega=0.9)


def call(system=None, **changes):
    arguments = dict(force=[0.18], omega=0.8, harmonics=3) | changes
    return harmonic_balance(duffing() if system is None else system, **arguments)


@pytest.mark.parametrize(
    ("run", "text"),
    [
        (lambda: call(force=[0.18, 0.0]), r"shape \(1,\)"),
        (lambda: call(force=0.18), r"shape \(1,\)"),
        (lambda: call(force="x"), "must be a vector"),
        (lambda: call(force=[np.nan]), "NaN"),
        (lambda: call(force={5: [1.0]}), "harmonic 5"),
        (lambda: call(force={0: [1j]}), "must be real"),
        (lambda: call(force={-1: [1.0]}), "from 0"),
        (lambda: call(omega=-1.0), "positive"),
        (lambda: call(omega=np.nan), "positive"),
        (lambda: call(omega="a"), "omega must hold numbers"),
        (lambda: call(omega=(0.5, 1.0)), "frequency_response"),
        (lambda: call(omega=None), "exactly one"),
        (lambda: call(frequency=1.0), "exactly one"),
        (lambda: call(harmonics=0), "at least 1"),
        (lambda: call(harmonics=[]), "sequence"),
        (lambda: call(harmonics=[1, 1]), "twice"),
        (lambda: call(harmonics=[0, 1]), "positive integers"),
        (lambda: call(harmonics=[2, 3]), "harmonic 1, which is not"),
        (lambda: call(harmonics=2.5), "number or a sequence"),
        (lambda: call(subharmonic=0), "subharmonic"),
        (lambda: call(n_samples=10), "at least 13"),
        (lambda: call(n_samples=-1), "n_samples"),
        (lambda: call(x0=[[1.0, 2.0]]), "x0 must be"),
        (lambda: call(x0=[[np.nan, 0.0, 0.0]]), "x0 contains"),
        (lambda: call(tol=-1.0), "tol must be"),
        (lambda: call(system=MechanicalSystem([[1.0]], None, [[1.0]], elements=[Cubic(0.1)])), "no direction"),
        (
            lambda: call(system=MechanicalSystem([[1.0]], None, [[1.0]], elements=[Cubic(0.1, w=[1.0, 2.0])])),
            "2 entries",
        ),
        (lambda: call(system=MechanicalSystem([[1.0]], None, [[1.0]], elements=["cubic"])), "must be a law"),
        (lambda: call(system=3.0), "needs a MechanicalSystem"),
    ],
)
def test_bad_input_names_object_and_remedy(run, text):
    with pytest.raises(ModelError, match=text):
        run()
