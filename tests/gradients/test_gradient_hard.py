"""Hard cases of gradients of motions, each with its measured error, and bad input."""

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.examples import five_bar
from motion_models import blade, open_chain, silent
from test_gradient import LENGTHS, differences, drift, worst


def both(m, psi, parameters, **options):
    direct = mb.gradient(m, psi, parameters, method="direct", **options)
    adjoint = mb.gradient(m, psi, parameters, method="adjoint", **options)
    return direct, worst(adjoint.gradient, direct.gradient)


def four_bar(angle):
    """A parallelogram-like four-bar near its singular pose (all bars in a line at angle 0). Data invented."""
    m = mb.Model("four-bar", gravity=(0, -9.81, 0))
    c, s = np.cos(angle), np.sin(angle)
    p = [(0, 0, 0), (c, s, 0), (2.0 + c, s, 0), (2.0, 0, 0)]
    bars = []
    for i in range(3):
        at = tuple((np.array(p[i]) + p[i + 1]) / 2)
        bars.append(m.body(f"bar{i}", mass=1.0, inertia=(0.05, 0.05, 0.08), at=at))
    links = [m.ground, *bars, m.ground]
    for i in range(4):
        m.revolute(f"J{i}", links[i], links[i + 1], at=p[i], axis="z")
    m.spring_damper("spring", m.ground, bars[1], at=((1.0, 2.0, 0), (1.0 + c, s, 0)), k=30.0, c=0.2)
    return m


@pytest.mark.parametrize("angle", [1e-1, 1e-2, 1e-3])
def test_near_the_singular_pose(angle):
    m = silent(lambda: four_bar(angle))
    # the closer, the faster the geometry turns: 20 steps that shrink with the angle
    options = {"t": angle, "step": 0.05 * angle}
    psi = mb.Integral(lambda s: s.position("bar1")[1] / angle**3)
    direct, agreement = both(m, psi, ["spring.k", "bar0.mass"], **options)
    error = worst(direct.gradient, differences(m, psi, ["spring.k", "bar0.mass"], **options))
    print(f"angle {angle}: adjoint - direct {agreement:.1e}, differences {error:.1e}")
    assert agreement < 1e-9
    # the objective is divided by angle^3
    assert error < 1e-6 + jitter.level() / angle**3


@pytest.mark.parametrize("h", [1e-2, 1e-3, 1e-5, 1e-7])
def test_steps_from_large_to_tiny(h):
    m = silent(five_bar)
    psi = mb.Final(lambda s: 1e6 * (s.point("P2")[0] - 0.5) + s.velocity("left")[1] / h)
    direct, agreement = both(m, psi, LENGTHS, t=20 * h, step=h)
    error = worst(direct.gradient, differences(m, psi, LENGTHS, t=20 * h, step=h))
    print(f"h {h}: adjoint - direct {agreement:.1e}, differences {error:.1e}")
    assert agreement < 1e-9
    assert error < 1e-6


def test_multiplier_that_changes_its_sign():
    m = silent(blade)
    psi = mb.Integral(lambda s: np.sum(s.position("blade") ** 2))
    traj = mb.simulate(m, t=3.0, step=0.02, method="ali3p")
    mu = traj.multipliers[:, -1]
    assert mu.min() < 0 < mu.max()
    direct, agreement = both(m, psi, ["spring.k", "edge.at[0]", "blade.velocity[0]"], t=3.0, step=0.02)
    names = ["spring.k", "edge.at[0]", "blade.velocity[0]"]
    # smaller than elsewhere: the motion bends strongly over 3 s
    error = worst(direct.gradient, differences(m, psi, names, part=2e-4, t=3.0, step=0.02))
    print(f"sign changes: adjoint - direct {agreement:.1e}, differences {error:.1e}")
    assert agreement < 1e-9
    assert error < 1e-7


def test_parameters_of_very_different_size():
    """Stiffness as 1e9 u and a mass as 1e12 w with w = 1e-12: derivatives scale exactly."""
    m = mb.Model("scales")
    u, w = m.parameter("u", 4e-8), m.parameter("w", 1e-12)
    p = m.body("p", mass=1e12 * w, inertia=(1, 1, 1), at=(1, 0, 0))
    m.prismatic("rail", m.ground, p, at=(1, 0, 0), axis="x", k=1e9 * u, preload=40.0)
    psi = mb.Final(lambda s: s.position("p")[0])
    scaled, agreement = both(m, psi, ["u", "w"], t=0.5, step=0.01)
    plain = mb.gradient(m, psi, ["rail.k", "p.mass"], t=0.5, step=0.01).gradient
    error = np.max(np.abs(scaled.gradient / plain / [1e9, 1e12] - 1))
    print(f"sizes 1e-12 and 1e9: adjoint - direct {agreement:.1e}, scaling {error:.1e}")
    assert error < 1e-12
    assert agreement < 1e-10


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_very_different_sizes_in_one_stiff_scene(scheme):
    """A mass of 1e12 w behind a spring of 1e9 N/m: both derivatives at once, each against differences."""
    m = mb.Model("stiff")
    w, u = m.parameter("w", 1e-12), m.parameter("u", 1e9)
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1, 0, 0))
    q = m.body("q", mass=1e12 * w, inertia=(1, 1, 1), at=(1, 0, 0))
    m.prismatic("soft", m.ground, p, at=(0, 0, 0), axis="x", k=50.0)
    m.prismatic("hard", p, q, at=(1, 0, 0), axis="x", k=u, c=1e3)
    psi, options = (
        mb.Final(lambda s: s.position("q")[0] + s.velocity("p")[0]),
        {"t": 0.1, "step": 1e-3, "scheme": scheme},
    )
    direct, agreement = both(m, psi, ["w", "u"], **options)
    assert agreement < 1e-9
    noise = 1e-14 * abs(direct.value)
    # places that are no round numbers are rounded, and a step makes speeds of them: 2 eps |x| / h at each end
    rounding = 0.0 if jitter.seed() is None else 4 * np.finfo(float).eps / 1e-3
    for i, (name, now, part) in enumerate((("w", 1e-12, 1e-3), ("u", 1e9, 1e-3))):
        values = []
        for side in (1, -1, 2, -2):
            m.set({name: now * (1 + side * part)})
            values.append(mb.gradient(m, psi, name, method="direct", **options).value)
        m.set({name: now})
        difference = (8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * part * now)
        error = abs(direct.gradient[i] - difference) * now
        print(f"{scheme}, by {name}: {direct.gradient[i]:.6e}, off by {error:.1e} of the objective")
        assert error < 1e-9 * abs(direct.gradient[i]) * now + (100 * noise + 1.5 * rounding) / part


def test_a_parameter_that_changes_nothing_gives_zero():
    m = silent(five_bar)
    m.parameter("idle", 3.0)
    for method in ("direct", "adjoint"):
        grad = mb.gradient(m, mb.Integral(drift), ["idle", "spring1.length"], t=0.1, step=0.01, method=method).gradient
        assert grad[0] == 0.0
        assert grad[1] != 0.0


def test_one_parameter_in_fifty_places():
    m = mb.Model("row")
    k = m.parameter("k", 100.0)
    last = m.ground
    for i in range(50):
        b = m.body(f"b{i}", mass=1.0, inertia=(1, 1, 1), at=(i + 1.0, 0, 0))
        m.prismatic(f"p{i}", last, b, at=(i + 1.0, 0, 0), axis="x", k=k, preload=1.0 if i == 0 else 0.0)
        last = b
    psi = mb.Final(lambda s: 1e3 * (s.position("b0")[0] - 1.0))
    direct, agreement = both(m, psi, ["k"], t=0.5, step=0.05)
    singles = mb.gradient(m, psi, [f"p{i}.k" for i in range(50)], t=0.5, step=0.05, method="adjoint").gradient
    error = abs(float(np.sum(singles) / direct.gradient[0]) - 1)
    print(f"fifty places: adjoint - direct {agreement:.1e}, sum of the places {error:.1e}")
    assert agreement < 1e-9
    assert error < 1e-9


def double_pendulum():
    m = mb.Model("double pendulum", gravity=(0, -9.81, 0))
    a = m.body("a", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0.5, 0, 0))
    b = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1.5, 0, 0))
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("B", a, b, at=(1, 0, 0), axis="z")
    return m


def test_a_chaotic_horizon_is_reported_not_hidden():
    """The derivative of the discrete motion stays exact while it grows."""
    m = silent(double_pendulum)
    psi = mb.Final(lambda s: s.position("b")[0])
    sizes = []
    for t in (1.0, 5.0, 20.0):
        direct, agreement = both(m, psi, ["a.mass"], t=t, step=0.01)
        sizes.append(abs(float(direct.gradient[0])))
        print(f"t {t}: d x / d m = {direct.gradient[0]:.3e}, adjoint - direct {agreement:.1e}")
        assert agreement < 1e-6
    assert sizes[2] > 10 * sizes[0]


def test_zero_length_is_the_start():
    m = silent(open_chain)
    psi = mb.Final(lambda s: s.position("b")[0] + s.acceleration("b")[1])
    direct, agreement = both(m, psi, ["a.mass", "S.at[1]"], t=0.0)
    error = worst(direct.gradient, differences(m, psi, ["a.mass", "S.at[1]"], t=0.0))
    print(f"zero length: adjoint - direct {agreement:.1e}, differences {error:.1e}")
    assert agreement < 1e-9
    assert error < 1e-8
    assert mb.gradient(m, mb.Integral(lambda s: s.t + 1.0), ["a.mass"], t=0.0).value == 0.0


def test_laws_with_memory():
    m = mb.Model("friction")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1.0, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=20.0, law=mb.Jenkins(50.0, 3.0))
    psi = mb.Integral(lambda s: s.position("p")[0] ** 2)
    direct, agreement = both(m, psi, ["rail.k", "p.mass", "p.velocity[0]"], t=1.0, step=0.01)
    error = worst(direct.gradient, differences(m, psi, ["rail.k", "p.mass", "p.velocity[0]"], t=1.0, step=0.01))
    print(f"memory: adjoint - direct {agreement:.1e}, differences {error:.1e}")
    assert agreement < 1e-9
    assert error < 1e-8


def test_checkpoints_give_the_same():
    """A motion that is not kept: stretches between checkpoints are run again, once."""
    m = silent(five_bar)
    psi = mb.Integral(drift)
    whole = mb.gradient(m, psi, LENGTHS, t=0.5, step=0.01, method="adjoint")
    again = mb.gradient(m, psi, LENGTHS, t=0.5, step=0.01, method="adjoint", keep=0)
    assert np.array_equal(whole.gradient, again.gradient)
    assert whole.stats.counts["checkpoints"] == 1
    assert whole.stats.counts["stored states"] == 51
    assert whole.stats.counts["steps"] == 50
    assert again.stats.counts["steps"] == 100


def single():
    m = mb.Model("single")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1.0, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=50.0)
    return m


@pytest.mark.some(1)
@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_stored_states_grow_like_the_root_of_the_steps(scheme):
    """What the adjoint keeps: checkpoints and one stretch between them, for steps that are run twice."""
    m, psi = single(), mb.Final(lambda s: s.position("p")[0])
    stored = []
    for n in (100, 1600, 6400):
        found = mb.gradient(m, psi, "rail.k", t=1.0, step=1.0 / n, method="adjoint", keep=0, scheme=scheme)
        counts = found.stats.counts
        stored.append(counts["stored states"])
        print(f"{scheme}: {n} steps, {stored[-1]} stored states, {counts['checkpoints']} of them checkpoints")
        assert counts["steps"] == 2 * n
        assert counts["adjoint steps"] == n
        assert stored[-1] <= 4 * np.sqrt(n)
        # x = sin(w t) / w: the derivative by k through w
        w = np.sqrt(50.0)
        exact = (np.cos(w) - np.sin(w) / w) / (2 * 50.0)
        assert found.gradient[0] == pytest.approx(exact, rel=200.0 / n**1.5)
    assert stored[1] < 4.5 * stored[0]
    assert stored[2] < 2.2 * stored[1]


BAD = [
    (lambda s: s.position("crank"), mb.errors.ModelError, "must return one number"),
    (lambda s: np.nan, mb.errors.ModelError, "keep it finite"),
    (lambda s: np.log(s.t - 0.05) if s.t > 0.02 else 1.0, mb.errors.ModelError, "keep it finite"),
    (lambda s: "x", mb.errors.ModelError, "must return one number"),
    (lambda s: None, mb.errors.ModelError, "must return one number"),
    (lambda s: s.position("crnk")[0], mb.errors.NameNotFoundError, "did you mean 'crank'"),
    (lambda s: s.point("P4")[0], mb.errors.NameNotFoundError, "did you mean 'P"),
    (lambda s: np.linalg.norm(s.position("crank")), mb.errors.NotDifferentiableError, "not .*analytic"),
]


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize(("function", "error", "message"), BAD, ids=range(len(BAD)))
def test_bad_objectives(function, error, message):
    with pytest.raises(error, match=message):
        mb.gradient(silent(five_bar), mb.Integral(function), LENGTHS, t=0.1, step=0.01)


WRONG = [
    ({"parameters": ["spring1.lenght"]}, "length"),
    ({"parameters": []}, "no parameter"),
    (
        {"scheme": "bdf-bfgs"},
        "'bdf-bfgs' has no sensitivities; those that have are scheme='explicit', scheme='radau', scheme='bdf', scheme='ali3p'",
    ),
    ({"scheme": "explicit", "rho": 0.5}, "rho= belongs to"),
    ({"scheme": "trapezoidal"}, "no sensitivities"),
    ({"method": "forward"}, '"direct", "adjoint", "auto"'),
    ({"t": np.nan}, "t= must be"),
    ({"t": -1.0}, "t= must be"),
    ({"step": 0.0}, "step= must be"),
    ({"step": "small"}, "step= must be"),
    ({"step": 0.1, "rtol": 1e-5}, "not both"),
    ({"objective": drift}, "mb.Integral"),
    ({"objective": []}, "mb.Integral"),
    ({"weight": "none"}, "'tangent' or 'mass'"),
]


@pytest.mark.parametrize(("change", "message"), WRONG, ids=range(len(WRONG)))
def test_bad_arguments(change, message):
    given = {"objective": mb.Integral(drift), "parameters": LENGTHS, "t": 0.1, **change}
    with pytest.raises(mb.errors.ModelError, match=message):
        mb.gradient(silent(five_bar), given.pop("objective"), given.pop("parameters"), given.pop("t"), **given)


def test_simulations_without_sensitivities_say_so():
    m = silent(five_bar)
    with pytest.raises(mb.errors.ModelError, match="'ali3p'"):
        mb.simulate(m, t=0.1, method="bdf-bfgs", parameters=LENGTHS)
    with pytest.raises(mb.errors.ModelError, match="independent"):
        mb.simulate(m, t=0.1, method="explicit", coordinates="independent", parameters=LENGTHS)
    with pytest.raises(mb.errors.ModelError, match="parameters="):
        mb.simulate(m, t=0.1, step=0.01, method="ali3p").sensitivity("P2")
    traj = mb.simulate(m, t=0.1, step=0.01, parameters=LENGTHS)
    with pytest.raises(mb.errors.NameNotFoundError, match="did you mean 'crank"):
        traj.sensitivity("crnk.position")
    with pytest.raises(mb.errors.NameNotFoundError, match="did you mean 'position'"):
        traj.sensitivity("left.postion")
    with pytest.raises(mb.errors.ModelError, match="t= as a number"):
        mb.simulate(m, t=[0.1, 0.2], step=0.01, parameters=LENGTHS)
    with pytest.raises(mb.errors.ModelError, match="times in s that increase"):
        mb.AtTimes([0.2, 0.1], drift)
    with pytest.raises(mb.errors.ModelError, match="outside the motion"):
        mb.gradient(m, mb.AtTimes([0.2], drift), LENGTHS, t=0.1)
