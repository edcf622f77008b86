"""Transfer functions against closed forms, plain direct solves and 50-digit solves."""

from __future__ import annotations

import warnings

import mpmath
import numpy as np
import pytest
from mbrs.errors import MbrsWarning, ModelError, NameNotFoundError
from mbrs.linear.frf import _Dense, frf, frf_sensitivity
from mbrs.linear.matrices import MechanicalSystem
from problems import spring_row


def random_system(rng, n, damping=0.05, gyroscopic=False, circulatory=False):
    """Invented: well conditioned masses, stiffness spread over two decades, damping without structure."""
    X = rng.normal(size=(n, n))
    M = X @ X.T / n + np.eye(n)
    Y = rng.normal(size=(n, n))
    K = Y @ np.diag(10.0 ** rng.uniform(0, 2, n)) @ Y.T / n + 0.1 * np.eye(n)
    W = rng.normal(size=(n, n))
    C = damping * (W @ W.T / n + 0.05 * np.eye(n))
    Q = rng.normal(size=(n, n))
    G = 0.3 * (Q - Q.T) if gyroscopic else None
    N = 0.02 * (Q - Q.T) if circulatory else None
    return MechanicalSystem(M, C, K, G=G, N=N)


def direct(system, F, L, omega, power=0):
    D = sum((a for a in (system.C, system.G) if a is not None), np.zeros((system.n, system.n)))
    S = system.K if system.N is None else system.K + system.N
    values = [L @ np.linalg.solve(S - w * w * system.M + 1j * w * D, F) * (1j * w) ** power for w in omega]
    return np.stack(values, axis=-1)


def distance(a, b):
    """Largest difference over the frequencies, relative to the largest entry at each."""
    return np.max(np.abs(a - b).max(axis=(0, 1)) / np.abs(b).max(axis=(0, 1)))


def exact(system, F, L, omega):
    """One frequency in 50 digits."""
    with mpmath.workdps(50):
        D = sum((a for a in (system.C, system.G) if a is not None), np.zeros((system.n, system.n)))
        S = system.K if system.N is None else system.K + system.N
        w = mpmath.mpf(float(omega))
        Z = mpmath.matrix(S.tolist()) - w**2 * mpmath.matrix(system.M.tolist()) + 1j * w * mpmath.matrix(D.tolist())
        H = mpmath.matrix(L.tolist()) * mpmath.lu_solve(Z, mpmath.matrix(F.tolist()))
        return np.array([complex(h) for h in H])


@pytest.mark.parametrize("kind, power", [("receptance", 0), ("mobility", 1), ("accelerance", 2)])
def test_one_degree_of_freedom_is_the_closed_form(kind, power):
    m, c, k = 2.0 + power, 0.4, 8.0
    omega = np.array([0.0, 0.1, 1.9, 2.0, 2.1, 50.0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        h = frf(MechanicalSystem([[m]], [[c]], [[k]]), 0, 0, omega=omega, kind=kind)
    expected = (1j * omega) ** power / (k - m * omega**2 + 1j * c * omega)
    np.testing.assert_allclose(h.value[0, 0], expected, rtol=1e-14, atol=1e-300)
    assert h.stats.counts["symmetric eigensolutions"] == 1


@pytest.mark.parametrize("n", [1, 2, 5, 12, 40])
@pytest.mark.parametrize("kind", ["undamped", "proportional", "general", "gyroscopic", "circulatory", "heavy"])
def test_every_route_equals_direct_solves(n, kind):
    rng = np.random.default_rng([n, len(kind)])
    s = random_system(rng, n, damping=20.0 if kind == "heavy" else 0.05, gyroscopic=kind == "gyroscopic")
    if kind == "circulatory":
        s = random_system(rng, n, circulatory=True)
    if kind == "undamped":
        s = MechanicalSystem(s.M, None, s.K)
    if kind == "proportional":
        s = MechanicalSystem(s.M, 0.02 * s.M + 0.001 * s.K, s.K)
    F, L = rng.normal(size=(n, 2)), rng.normal(size=(n, 3))
    omega = np.linspace(0.0, 15.0, 37)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        h = frf(s, F, L, omega=omega)
    route = {"undamped": "real modes", "proportional": "real modes"}.get(kind)
    if route:
        assert h.stats.route == route
    measured = distance(h.value, direct(s, F, L.T, omega))
    print(f"n={n} {kind}: {measured:.1e} from direct solves, estimated {h.error:.1e}, route {h.stats.route}")
    assert measured < 1e-10
    assert h.error < 1e-10


def test_300_states_equal_direct_solves():
    rng = np.random.default_rng(5)
    n = 150
    K = spring_row(np.full(n, 1e4))
    s = MechanicalSystem(np.diag(rng.uniform(1, 2, n)), 1e-3 * K + np.diag(rng.uniform(0, 30, n)), K)
    ports = list(range(0, 36, 6))
    omega = np.linspace(1.0, 250.0, 50)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        h = frf(s, ports, ports, omega=omega)
    E = np.eye(n)[:, ports]
    assert distance(h.value, direct(s, E, E.T, omega)) < 1e-10
    assert h.stats.counts["frequencies"] == 50


@pytest.mark.slow
def test_estimated_error_is_the_true_one_over_random_cases():
    """true/estimated in [.01, 10] in 95 % of 200 random systems; true from 50 digits at 3 points per case.

    References are rounded to numbers, so that a true error below half of that rounding is not known.
    """
    rng = np.random.default_rng(11)
    good = 0
    for case in range(200):
        n = int(rng.integers(1, 7))
        s = random_system(rng, n, damping=10.0 ** rng.uniform(-6, 1), gyroscopic=case % 3 == 0)
        F, L = rng.normal(size=(n, 1)), rng.normal(size=(n, 1))
        omega = np.sort(rng.uniform(0.2, 12.0, 3))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            h = frf(s, F, L, omega=omega)
        reference = np.array([exact(s, F, L.T, w)[0] for w in omega])
        true = np.max(np.abs(h.value[0, 0] - reference) / np.abs(reference))
        good += 0.01 <= max(true, np.finfo(float).eps / 2) / h.error <= 10.0
    print(f"estimates within [.01, 10]: {good} of 200")
    assert good >= 190


def test_damping_ratio_1e6_at_resonance():
    """zeta = 1e-6: the peak is right to the condition of the problem, about eps / zeta."""
    n = 6
    K = spring_row(np.ones(n))
    s = MechanicalSystem(np.eye(n), 2e-6 * K, K)
    peaks = np.sqrt(np.linalg.eigvalsh(K))
    h = frf(s, 0, n - 1, omega=peaks)
    E = np.eye(n)
    reference = np.array([exact(s, E[:, :1], E[n - 1 :], w)[0] for w in peaks])
    measured = np.max(np.abs(h.value[0, 0] - reference) / np.abs(reference))
    print(f"zeta 1e-6 at the peaks: true error {measured:.1e}, estimated {h.error:.1e}, route {h.stats.route}")
    assert measured < 1e-9
    assert measured < 10 * h.error


@pytest.mark.filterwarnings("ignore:the frequency points miss")
def test_stiffness_ratio_1e12():
    k = 1e12
    K = np.array([[k + 3.0, -k, 0.0], [-k, k + 2.0, -2.0], [0.0, -2.0, 2.0]])
    s = MechanicalSystem(np.diag([1.0, 2.0, 3.0]), 1e-3 * np.diag([1.0, 5.0, 2.0]), K)
    omega = np.array([0.0, 0.3, 0.9, 1.4, 3.0])
    h = frf(s, 0, [0, 2], omega=omega)
    E = np.eye(3)
    reference = np.stack([exact(s, E[:, :1], E[[0, 2]], w) for w in omega], axis=-1)[:, None, :]
    measured = distance(h.value, reference)
    print(f"stiffness ratio 1e12: true error {measured:.1e}, estimated {h.error:.1e}, route {h.stats.route}")
    assert measured < 1e-10


def test_critical_damping_is_no_harder():
    """Two equal critically damped oscillators in a row: a defective state matrix."""
    s = MechanicalSystem(np.eye(2), 2.0 * np.eye(2), [[1.0, 0.0], [0.0, 1.0]], N=[[0.0, 0.5], [-0.5, 0.0]])
    t = MechanicalSystem(np.eye(2), 2.0 * np.eye(2), [[1.0, 0.25], [0.25, 1.0]], N=[[0.0, 0.25], [-0.25, 0.0]])
    for system in (s, t):
        omega = np.linspace(0.0, 3.0, 13)
        h = frf(system, [0, 1], [0, 1], omega=omega)
        assert distance(h.value, direct(system, np.eye(2), np.eye(2), omega)) < 1e-12


def test_undamped_resonance_is_infinite_with_a_warning():
    s = MechanicalSystem(M=np.eye(2), K=[[2.0, -1.0], [-1.0, 2.0]])
    antisymmetric = np.array([1.0, -1.0])
    with pytest.warns(MbrsWarning, match="singular at 0.159155 Hz"):
        h = frf(s, [0], np.column_stack([[1.0, 0.0], antisymmetric]), omega=[1.0])
    assert np.isinf(h.value[0, 0, 0])
    # the antisymmetric output does not see the symmetric mode at omega = 1: (1/2) * 2 / (3 - 1)
    assert abs(h.value[1, 0, 0] - 0.5) < 1e-14
    assert h.status == "singular"


@pytest.mark.parametrize("damped", [False, True])
def test_rigid_modes_at_zero_frequency(damped):
    """Two masses on a spring, free: infinite receptance, the rigid mass line as accelerance."""
    K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    s = MechanicalSystem(
        np.diag([1.0, 3.0]), 0.1 * np.diag([1.0, 1.0]) @ K @ np.diag([1.0, 1.0]) if damped else None, K
    )
    with pytest.warns(MbrsWarning, match="can move freely"):
        h = frf(s, 0, [0, 1], omega=[0.0, 1e-3])
    assert np.all(np.isinf(h.value[:, 0, 0]))
    assert np.all(np.isfinite(h.value[:, 0, 1]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        a = frf(s, 0, [0, 1], omega=[0.0], kind="accelerance")
        np.testing.assert_allclose(a.value[:, 0, 0], [0.25, 0.25], atol=1e-14)
        v = frf(s, 0, [0, 1], omega=[0.0], kind="mobility")
        assert np.all(np.isinf(v.value))


def test_a_damper_to_ground_makes_the_mobility_finite():
    s = MechanicalSystem([[2.0]], [[0.5]], [[0.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert abs(frf(s, 0, 0, omega=[0.0], kind="mobility").value[0, 0, 0] - 2.0) < 1e-14
        assert frf(s, 0, 0, omega=[0.0], kind="accelerance").value[0, 0, 0] == 0.0
        assert np.isinf(frf(s, 0, 0, omega=[0.0]).value[0, 0, 0])


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("share, infinite", [(1e-11, False), (1e-9, True)])
def test_a_free_motion_that_an_output_hardly_sees_is_none(share, infinite):
    s = MechanicalSystem(np.eye(2), None, np.diag([0.0, 1.0]))
    h = frf(s, np.array([1.0, 1.0]), np.array([share, 1.0]), omega=[0.0])
    assert np.isinf(h.value[0, 0, 0]) == infinite
    assert infinite or abs(h.value[0, 0, 0] - 1.0) < 1e-14


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("damping, infinite", [(1e-13, True), (1e-11, False)])
def test_damping_of_a_free_motion_that_is_rounding_is_none(damping, infinite):
    s = MechanicalSystem(np.eye(2), np.diag([damping, 1.0]), np.diag([0.0, 1.0]))
    value = frf(s, 0, 0, omega=[0.0], kind="mobility").value[0, 0, 0]
    assert np.isinf(value) if infinite else abs(value * damping - 1.0) < 1e-12


def test_singular_mass_goes_direct():
    s = MechanicalSystem(np.diag([1.0, 0.0]), np.diag([0.1, 0.2]), [[2.0, -1.0], [-1.0, 1.0]])
    omega = np.linspace(0.0, 3.0, 7)
    h = frf(s, [0, 1], [0, 1], omega=omega)
    assert h.stats.route == "direct"
    assert h.poles is None
    assert distance(h.value, direct(s, np.eye(2), np.eye(2), omega)) < 1e-13


def test_a_range_finds_the_peaks_and_points_warn_about_missed_ones():
    zeta = 1e-4
    s = MechanicalSystem(np.eye(2), np.diag([2 * zeta * 10.0, 2 * zeta * 20.0]), np.diag([100.0, 400.0]))
    h = frf(s, 0, 0, omega=(1.0, 40.0))
    assert abs(h.magnitude.max() * 2 * zeta * 100.0 - 1.0) < 1e-3
    # only the mode at 10 rad/s shows in x0; the other must not be named
    with pytest.warns(MbrsWarning, match=r"miss 1 resonance at 1\.59155 Hz"):
        frf(s, 0, 0, omega=np.linspace(1.0, 40.0, 50))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frf(s, 0, 0, omega=np.linspace(9.9, 10.1, 2001))


def test_missed_resonances_of_undamped_systems(monkeypatch):
    """All that the ports see are told, those they do not see are not, and no pole costs a decomposition."""
    rng, n = np.random.default_rng(3), 23
    omega = np.linspace(1.3, 4.1, n)
    q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    # mode 4 stands still at the port, mode 11 hardly moves there
    rows = q.copy()
    rows[0, [4, 11]] = 0.0, 3e-4
    shape = np.linalg.inv(rows)
    s = MechanicalSystem(shape.T @ shape, None, shape.T @ np.diag(omega**2) @ shape)
    evaluate, singular = _Dense.evaluate, []

    def counted(self, points, checked=True):
        raw = evaluate(self, points, checked)
        singular.extend(raw["singular"])
        return raw

    monkeypatch.setattr(_Dense, "evaluate", counted)
    with pytest.warns(MbrsWarning, match=f"miss {n - 1} resonances"):
        frf(s, 0, 0, omega=np.array([1.1, 1.31417, 4.2]))
    assert not singular


def test_base_motion_orders_and_feedthrough_through_the_core():
    """Absolute motion over base motion of one mass: (k + i w c) / (k - w^2 m + i w c)."""
    from mbrs import _core

    m, c, k = 2.0, 0.4, 8.0
    one = np.ones((1, 1))
    system = _core.SecondOrder(m * one, c * one, None, k * one, None)
    omega = np.linspace(0.0, 5.0, 11)
    raw = system.evaluate((one, -m * one, np.array([2]), one), 0, omega)
    expected = (k + 1j * omega * c) / (k - m * omega**2 + 1j * omega * c)
    np.testing.assert_allclose(raw["value"][0, 0], expected, rtol=1e-14)


@pytest.mark.filterwarnings("ignore:the frequency points miss")
def test_switching_damping_off_takes_the_symmetric_route():
    rng = np.random.default_rng(8)
    s = random_system(rng, 6, gyroscopic=True)
    omega = np.linspace(0.5, 1.0, 9)
    full, bare = frf(s, 0, 0, omega=omega), frf(s, 0, 0, omega=omega, without=("damping", "gyroscopic"))
    assert full.stats.effects == ("damping", "gyroscopic") and bare.stats.effects == ()
    assert bare.stats.route == "real modes"
    assert not np.allclose(full.value, bare.value)
    assert np.all(bare.value.imag == 0.0)


def test_sensitivity_against_50_digit_differences():
    rng = np.random.default_rng(21)
    n = 4
    s = random_system(rng, n, gyroscopic=True)
    changes = {x: rng.normal(size=(n, n, 2)) for x in ("dM", "dD", "dS")}
    dF, dL = rng.normal(size=(n, 1, 2)), rng.normal(size=(1, n, 2))
    F, L = rng.normal(size=(n, 1)), rng.normal(size=(n, 1))
    omega = np.array([0.7, 3.0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        h = frf(s, F, L, omega=omega)
    result = frf_sensitivity(h.linear, omega, ["a", "b"], **changes, dF=dF, dL=dL)
    for k, w in enumerate(omega):
        for p in range(2):
            with mpmath.workdps(60):
                eps = mpmath.mpf(10) ** -20

                def at(sign, w=w, p=p, eps=eps):
                    def moved(a, da):
                        return mpmath.matrix(a.tolist()) + sign * eps * mpmath.matrix(da[..., p].tolist())

                    wm = mpmath.mpf(float(w))
                    Z = moved(s.K, changes["dS"]) - wm**2 * moved(s.M, changes["dM"])
                    Z += 1j * wm * moved(s.C + s.G, changes["dD"])
                    return (moved(L.T, dL) * mpmath.lu_solve(Z, moved(F, dF)))[0]

                expected = complex((at(1) - at(-1)) / (2 * eps))
            assert abs(result.value[0, 0, k, p] - expected) < 1e-11 * abs(expected)
    assert result.stats.counts["factorisations"] == 2


def test_sensitivity_is_nan_where_the_function_is_infinite():
    s = MechanicalSystem(M=np.eye(1), K=np.eye(1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        h = frf(s, 0, 0, omega=[1.0, 2.0])
    result = frf_sensitivity(h.linear, h.omega, ["k"], dS=np.ones((1, 1, 1)))
    assert np.isnan(result.value[0, 0, 0, 0]) and result.status == "singular"
    assert abs(result.value[0, 0, 1, 0] + 1 / 9) < 1e-15


@pytest.mark.parametrize(
    "call, error, text",
    [
        (lambda s: frf(s, 0, 0), ModelError, "exactly one"),
        (lambda s: frf(s, 0, 0, omega=[1.0], frequency=[1.0]), ModelError, "exactly one"),
        (lambda s: frf(s, 0, 0, omega=[np.nan]), ModelError, "NaN"),
        (lambda s: frf(s, 0, 0, omega=[]), ModelError, "at least one"),
        (lambda s: frf(s, 0, 0, omega=(2.0, 1.0)), ModelError, "not a range"),
        (lambda s: frf(s, 0, 0, omega="fast"), ModelError, "omega"),
        (lambda s: frf(s, 0, 0, omega=[1.0], kind="dynamic"), ModelError, "kind"),
        (lambda s: frf(s, 5, 0, omega=[1.0]), ModelError, "coordinate 5"),
        (lambda s: frf(s, "x7", 0, omega=[1.0]), NameNotFoundError, "did you mean"),
        (lambda s: frf(s, [1.0, 2.0, 3.0], 0, omega=[1.0]), ModelError, r"\(2,\)"),
        (lambda s: frf(s, [np.inf, 0.0], 0, omega=[1.0]), ModelError, "NaN or infinite"),
        (lambda s: frf(s, 0, None, omega=[1.0]), ModelError, "outputs"),
        (lambda s: frf(s, 0, 0, omega=[1.0], kind="transmissibility"), ModelError, "base"),
        (lambda s: frf(s, 0, 0, omega=[1.0], without=("gravity",)), ModelError, "gravity"),
        (lambda s: frf(s, 0, 0, omega=[1.0], at=1.0), ModelError, "at="),
        (lambda s: frf(3.0, 0, 0, omega=[1.0]), ModelError, "float"),
    ],
)
def test_wrong_input_is_named(call, error, text):
    with pytest.raises(error, match=text):
        call(MechanicalSystem(np.eye(2), K=np.eye(2)))


def test_wrong_shapes_at_the_border():
    from mbrs import _core

    none = np.zeros((0, 0))
    with pytest.raises(_core.CoreModelError, match="2 rows"):
        _core.SecondOrder(np.eye(2), None, None, np.eye(3), None)
    with pytest.raises(_core.CoreModelError, match="no coordinates"):
        _core.SecondOrder(none, None, None, none, None).evaluate((none, none, [], None), 0, np.ones(1))
    r = _core.SecondOrder(np.eye(2), None, None, np.eye(2), None)
    with pytest.raises(_core.CoreModelError, match="derivative orders"):
        r.evaluate((np.eye(2), np.eye(2), np.array([0]), None), 0, np.array([1.0]))
    with pytest.raises(_core.CoreModelError, match="dM has shape"):
        changes = (1, np.zeros((3, 2, 1)), None, None, None, None, None)
        r.sensitivity((np.eye(2), np.eye(2), [0, 0], None), 0, np.ones(1), changes)


def test_result_prints_labels_and_pickles(tmp_path):
    import pickle

    s = MechanicalSystem(np.eye(2), 0.1 * np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], coordinates=["left", "right"])
    h = frf(s, "left", ["left", "right"], frequency=(0.01, 1.0))
    assert "right / left" in str(h) and "route" in str(h)
    data = h.to_xarray()
    assert data.H.dims == ("output", "input", "frequency") and list(data.output.values) == ["left", "right"]
    path = h.save(tmp_path / "h.pkl")
    again = pickle.loads(path.read_bytes())
    np.testing.assert_array_equal(again.value, h.value)


def test_a_sum_of_few_modes_says_what_is_missing():
    """Truncation error falls with the number of modes and the estimate follows it."""
    n = 30
    s = MechanicalSystem(np.eye(n), 0.02 * np.eye(n), spring_row(np.ones(n)))
    omega = np.linspace(0.01, 0.5, 300)
    full = frf(s, 0, n - 1, omega=omega)
    errors = []
    for modes in (2, 6, 12, 29, 30):
        few = frf(s, 0, n - 1, omega=omega, modes=modes)
        true = np.max(np.abs(few.value - full.value) / np.abs(full.value))
        print(f"{modes} modes: true {true:.1e}, estimated {few.error:.1e}")
        errors.append(true)
        if modes < 30:
            assert 0.01 < true / few.error < 10.0
    assert errors[-1] == 0.0 and errors[0] > 10 * errors[2] > 10 * errors[3] > 0.0
    with pytest.raises(ModelError, match="modes"):
        frf(s, 0, 0, omega=omega, modes=31)
    with pytest.raises(ModelError, match="modes"):
        frf(s, 0, 0, omega=omega, modes=0)


@pytest.mark.slow
@pytest.mark.parametrize("damped", [False, True])
def test_large_sparse_systems_stay_sparse(damped):
    import scipy.sparse as sp

    n = 2000
    K = sp.csc_matrix(spring_row(np.ones(n)))
    C = sp.diags(np.linspace(0.0, 1e-3, n)) if damped else None
    s = MechanicalSystem(sp.identity(n, format="csc"), C, K)
    h = frf(s, 0, [0, n - 1], omega=(1e-4, 5e-3))
    assert h.stats.route == "sparse direct" and h.error < 1e-15
    ends = np.eye(n)[:, [0, n - 1]]
    picked = [0, 50, 120]
    reference = direct(
        MechanicalSystem(np.eye(n), None if C is None else C.toarray(), K.toarray()),
        ends[:, :1],
        ends.T,
        h.omega[picked],
    )
    # without damping the range has points at 2.5e-5 of a resonance: the condition of the reference there times eps
    assert distance(h.value[:, :, picked], reference) < (1e-9 if damped else 1e-6)
    inside = h.poles.imag[(h.poles.imag > 1e-4) & (h.poles.imag < 5e-3)]
    expected = 2 * np.sin((2 * np.arange(1, 60) - 1) * np.pi / (2 * (2 * n + 1)))
    expected = expected[(expected > 1e-4) & (expected < 5e-3)]
    assert inside.size == expected.size
    if not damped:
        np.testing.assert_allclose(np.sort(inside), expected, rtol=1e-8)
        with pytest.warns(MbrsWarning, match="miss"):
            frf(s, 0, 0, omega=np.linspace(1e-3, 5e-3, 4))


@pytest.mark.parametrize(("short", "is_summed"), [(1e-11, True), (1e-14, False)])
def test_modes_that_nearly_meet_are_no_longer_summed_up(short, is_summed):
    """Two roots at -1, but for the root of what the damping is short of; sums over them lose as many digits as their vectors are alike."""
    s, omega = (
        MechanicalSystem(np.eye(2), np.diag([3.0 - short, 1.0]), [[3.0, -1.0], [-1.0, 1.0]]),
        np.linspace(0.1, 3.0, 20),
    )
    if not is_summed:
        with pytest.raises(ModelError, match="no well-conditioned modes"):
            frf(s, 0, 0, omega=omega, modes=2)
        return
    found = frf(s, 0, 0, omega=omega, modes=2).value[0, 0]
    np.testing.assert_allclose(found, [exact(s, np.eye(2)[:, :1], np.eye(2)[:1], w)[0] for w in omega], rtol=1e-9)
