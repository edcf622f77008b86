"""Beams as modal bodies: closed forms, the WindPACT blade, integrals against sums over particles, bad input."""

from __future__ import annotations

from dataclasses import replace

import jitter
import mbrs as mb
import numpy as np
import pytest
from beam_meshes import fem, full_section
from mbrs.flexible import ModalBody, beam, craig_bampton
from mbrs.flexible._elements import Section, mesh
from mbrs.flexible._integrals import inertial_stiffness, shape_integrals
from scipy import linalg, optimize

# WindPACT 1.5 MW blade, OpenFAST r-test, WP_Baseline_Blade.dat (docs/theory.md (23.14)): span fraction, kg/m, EI flap and edge
STEEL = dict(E=2.1e11, G=8.1e10, rho=7850.0)


def clamped_free_roots(n):
    """cos x cosh x = -1 (Euler-Bernoulli)."""
    guess = [1.875, *((k + 0.5) * np.pi for k in range(1, n))]
    return np.array(
        [optimize.brentq(lambda x: np.cos(x) + 1 / np.cosh(x), g - 0.3, g + 0.3, xtol=1e-14) for g in guess]
    )


def free_free_roots(n):
    """cos x cosh x = 1."""
    return np.array(
        [
            optimize.brentq(lambda x: np.cos(x) - 1 / np.cosh(x), (k + 0.5) * np.pi - 0.3, (k + 0.5) * np.pi + 0.3)
            for k in range(1, n + 1)
        ]
    )


def test_uniform_clamped_beam_in_bending_stretching_and_twisting():
    L, mass, flap, edge, EA, GJ, i = 2.0, 3.0, 700.0, 2000.0, 4e4, 500.0, 0.02
    b = beam(L, mass=mass, EI_flap=flap, EI_edge=edge, EA=EA, GJ=GJ, inertia_flap=i, inertia_edge=0.0, modes=9)
    assert b.mass == pytest.approx(L * mass, rel=1e-14)
    roots = clamped_free_roots(4)
    odd = (2 * np.arange(4) + 1) * np.pi / 2 / L
    # cubic shapes: frequencies too high by (beta h)^4 / 1440
    exact = {
        "edge": (roots / L) ** 2 * np.sqrt(edge / mass),
        "EA": odd * np.sqrt(EA / mass),
        "GJ": odd * np.sqrt(GJ / i),
    }
    found = 2 * np.pi * b.frequencies()
    n = 0
    for name, expected in exact.items():
        for root, w in zip(roots, expected, strict=True):
            if w < found[-1]:
                n += 1
                assert np.min(np.abs(found / w - 1)) < 1.05 * (root / 60) ** 4 / 1440 + 1e-8, name
    assert n >= 5
    plain = 2 * np.pi * beam(L, mass=mass, EI_flap=flap, EI_edge=edge, modes=6).frequencies()
    pairs = sorted(
        (w, r) for s in (flap, edge) for r, w in zip(roots, (roots / L) ** 2 * np.sqrt(s / mass), strict=True)
    )
    for w, (expected, root) in zip(plain, pairs, strict=False):
        assert -1e-8 < w / expected - 1 < 1.05 * (root / 60) ** 4 / 1440 + 1e-8


def test_free_beam():
    b = beam(2.0, mass=3.0, EI_flap=700.0, EI_edge=2000.0, modes=10, fixed=None, attach=["tip"])
    roots = free_free_roots(3)
    expected = np.sort(np.concatenate([(roots / 2) ** 2 * np.sqrt(s / 3) for s in (700.0, 2000.0)]))
    lowest = 2 * np.pi * b.frequencies()[:3]
    assert lowest == pytest.approx(
        expected[:3], rel=2e-3
    )  # ten modes with the tip held and its static ones span them nearly
    plain = beam(2.0, mass=3.0, EI_flap=700.0, EI_edge=2000.0, modes=4, fixed=None)
    assert 2 * np.pi * plain.frequencies() == pytest.approx(expected[:4], rel=1e-6)
    for one in (b, plain):  # mean axes
        moment = np.swapaxes(one.P1, 1, 2) - one.P1
        assert np.abs(one.S).max() < 1e-9 and np.abs(moment).max() < 1e-9
        assert one.frequencies(fixed=False)[5:] == pytest.approx(one.frequencies(), rel=1e-8)


def timoshenko_frequency(EI, GA, m, i, L, guess):
    """A clamped-free Timoshenko beam: the zero of the determinant of its four end conditions (own derivation).

    V = GA (v' - t), Mb = EI t':  m v" = V', i t" = Mb' + V, as a linear system in x whose exponential carries the state.
    """

    def determinant(w):
        A = np.array([[0, 1, 0, 1 / GA], [0, 0, 1 / EI, 0], [0, -i * w * w, 0, -1], [-m * w * w, 0, 0, 0]], dtype=float)
        return linalg.det(linalg.expm(A * L)[2:, 2:])  # (v, t, Mb, V): clamped at 0, Mb = V = 0 at L

    return optimize.brentq(determinant, 0.8 * guess, 1.1 * guess, xtol=1e-12 * guess)


def test_timoshenko():
    """Frequencies to 1e-6, and errors that fall with the fourth power of the element length."""
    L, h = 1.0, 0.2
    area, second = h * h, h**4 / 12
    rho, E, GA = STEEL["rho"], STEEL["E"], 5 / 6 * STEEL["G"] * area
    worst = []
    for n in (10, 20, 40):
        b = beam(L, **STEEL, area=area, I_flap=second, I_edge=2 * second, modes=8, theory="timoshenko", elements=n)
        found, errors = 2 * np.pi * b.frequencies(), []
        for root in clamped_free_roots(2):
            for area_moment in (second, 2 * second):
                thin = (root / L) ** 2 * np.sqrt(E * area_moment / (rho * area))
                guess = thin / np.sqrt(1 + (root / L) ** 2 * (area_moment / area) * (1 + E * area / GA))
                exact = timoshenko_frequency(E * area_moment, GA, rho * area, rho * area_moment, L, guess)
                assert exact < 0.99 * thin, "shear and rotary inertia must matter here"
                errors.append(np.min(np.abs(found / exact - 1)))
        worst.append(max(errors))
    print("Timoshenko, 10, 20, 40 elements:", worst)
    assert worst[2] < 1e-6 and np.log2(worst[0] / worst[1]) > 3.7 and np.log2(worst[1] / worst[2]) > 3.7


def test_a_thin_timoshenko_beam_does_not_lock():
    L, h = 1.0, 1e-4
    section = dict(area=h * h, I_flap=h**4 / 12, I_edge=h**4 / 12)
    thin = [beam(L, **STEEL, **section, modes=4, theory=t, elements=8).frequencies() for t in
            ("timoshenko", "euler-bernoulli")]  # fmt: skip
    assert thin[0] == pytest.approx(thin[1], rel=1e-5)


def windpact(**options):
    data = mb.examples.windpact_blade()
    return beam(data.station, mass=data.mass, EI_flap=data.EI_flap, EI_edge=data.EI_edge, modes=6, **options)


def rotating(b, hub, speed):
    """Hz of the blade that turns about the axis z through a point hub metres inside its root."""
    a0, W = np.array([-(speed**2) * hub, 0, 0]), -(speed**2) * np.diag([1.0, 1, 0])
    K = b.K + np.einsum("i,ikl", np.concatenate([a0, W.ravel()]), b.KG) + np.einsum("ab,klab->kl", W, b.P2)
    return np.sqrt(linalg.eigh(K, b.M, eigvals_only=True)) / (2 * np.pi)


def test_windpact_blade():
    """docs/theory.md (23.14): an integral formulation, independent of these elements."""
    b = windpact()
    found = b.frequencies()
    print("WindPACT:", found)
    assert b.mass == pytest.approx(4355.9, abs=0.05)
    assert found[[0, 2]] == pytest.approx([1.230858, 3.674065], rel=1e-5)
    assert found[[1, 3]] == pytest.approx([1.877751, 6.374249], rel=1e-5)
    turning = rotating(b, 1.75, 17.2 * 2 * np.pi / 60)
    assert turning[[0, 2]] == pytest.approx([1.288, 3.736], rel=1e-3)
    assert turning[[1, 3]] == pytest.approx([1.889, 6.400], rel=1e-3)
    assert rotating(windpact(stiffening=False), 1.75, 17.2 * 2 * np.pi / 60)[0] < 1.24


def test_stiffening_of_a_rotating_uniform_blade():
    """Ratio of rotating to standstill frequency in flap: Southwell's bounds w^2 = w0^2 + a W^2, a in (1, 1.2) from
    Rayleigh's quotient with the exact standstill shape, int N phi'^2 over int m phi^2 = 1.193 for the first mode.
    """
    b = beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=50.0, modes=8)
    x, lam = np.linspace(0, 1, 4001), clamped_free_roots(1)[0]
    sigma = (np.cosh(lam) + np.cos(lam)) / (np.sinh(lam) + np.sin(lam))
    phi = np.cosh(lam * x) - np.cos(lam * x) - sigma * (np.sinh(lam * x) - np.sin(lam * x))
    slope = lam * (np.sinh(lam * x) + np.sin(lam * x) - sigma * (np.cosh(lam * x) - np.cos(lam * x)))
    a = np.trapezoid(0.5 * (1 - x**2) * slope**2, x) / np.trapezoid(phi**2, x)
    assert b.KG[3, 0, 0] == pytest.approx(-a, rel=1e-5)


def test_integrals_against_particles():
    """Sums over 21 x 3 x 3 particles per element section against the integrals, twist and rotary inertia included."""
    sec = dict(mass=2.0, EI_flap=30.0, EI_edge=90.0, GJ=20.0, EA=500.0, GA_flap=400.0, GA_edge=300.0)

    def section(x):
        return Section(**sec, inertia_flap=0.02, inertia_edge=0.05, twist=0.4 - 0.3 * x)

    grid = mesh(np.linspace(0, 1.5, 4), section, shear=True)
    T = np.random.default_rng(3).normal(size=(grid.n_dof, 3))
    found = shape_integrals(grid, T)
    S, P1, P2 = np.zeros((3, 3)), np.zeros((3, 3, 3)), np.zeros((3, 3, 3, 3))
    for p in grid.points:
        moved = p.N @ T[p.dofs]
        moments, axes = np.linalg.eigh(p.section.mass_moments()[1:, 1:] / p.section.mass)
        corners = [np.r_[0, axes @ (np.sqrt(moments) * [i, j])] for i in (-1, 1) for j in (-1, 1)]
        for s in corners:  # four particles with the section's mass, first and second moments
            dm, r = p.weight * p.section.mass / 4, np.array([p.x, 0, 0]) + s
            phi = moved[:3] + np.cross(moved[3:].T, s).T
            S += dm * phi
            P1 += dm * np.einsum("a,bk->kab", r, phi)
            P2 += dm * np.einsum("ak,bl->klab", phi, phi)
    for name, summed in (("S", S), ("P1", P1), ("P2", P2)):
        assert found[name] == pytest.approx(summed, rel=1e-12, abs=1e-12), name


def test_twist_turns_the_axes():
    straight = beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=9.0, modes=4)
    turned = beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=9.0, modes=4, twist=0.7)
    assert turned.frequencies() == pytest.approx(straight.frequencies(), rel=1e-8)
    tip = turned.node_shape[turned.node("tip"), :3, 0]
    assert abs(tip @ [0, np.cos(0.7), np.sin(0.7)]) < 1e-9 * abs(tip @ [0, -np.sin(0.7), np.cos(0.7)])
    pretwisted = beam([0.0, 0.5, 1.0], mass=1.0, EI_flap=1.0, EI_edge=9.0, modes=4, twist=[0.0, 0.6, 0.9])
    assert np.abs(pretwisted.frequencies() / straight.frequencies() - 1).max() > 1e-3


def test_static_deflection_with_constraint_modes_is_exact():
    """A tip force on a uniform cantilever, L^3/(3 EI): constraint modes hold it, a few fixed-interface modes do not."""
    held = beam(1.0, mass=1.0, EI_flap=2.0, EI_edge=5.0, modes=0, attach=["tip"])
    tip = held.node_shape[held.node("tip"), 2]
    assert tip @ np.linalg.solve(held.K, tip) == pytest.approx(1 / 6, rel=1e-8)
    few = beam(1.0, mass=1.0, EI_flap=2.0, EI_edge=5.0, modes=2)
    tip = few.node_shape[few.node("tip"), 2]
    assert tip @ np.linalg.solve(few.K, tip) < 0.99 / 6


def test_damping_nodes_and_files(tmp_path):
    b = beam(1.0, mass=1.0, EI_flap=2.0, EI_edge=5.0, modes=3, damping=[0.01, 0.02, 0.03], nodes={"middle": 0.4})
    assert np.diag(b.C) == pytest.approx(2 * np.array([0.01, 0.02, 0.03]) * 2 * np.pi * b.frequencies())
    assert b.nodes == ("root", "tip", "middle") and b.node_position[2] == pytest.approx([0.4, 0, 0])
    assert not np.any(b.node_shape[0]), "the frame's own node does not move"
    again = ModalBody.load(b.save(tmp_path / "rod"))
    assert again.nodes == b.nodes and again.note == b.note
    for name in ("mass", "com", "inertia", "S", "P1", "P2", "K", "C", "KG", "node_shape", "line_shape"):
        assert np.array_equal(getattr(again, name), getattr(b, name)), name
    assert "clamped at the root" in str(b) and "middle" in str(b)
    assert len(b.plot().axes) == 3


BAD_BEAMS = {
    "length must be positive": dict(length=-1.0),
    "stations must increase from 0": dict(length=[0.0, 2.0, 1.0]),
    "give EI_edge= or E= and I_edge=": dict(EI_edge=None),
    "mass must be positive along": dict(mass=-1.0),
    "EI_flap must be a number or 2 values": dict(EI_flap=[1.0, 2.0, 3.0]),
    "contains NaN": dict(mass=float("nan")),
    "needs rotary inertia": dict(GJ=1.0),
    "modes must be an integer": dict(modes=2.5),
    "modes must be at most": dict(modes=900),
    "there is no theory": dict(theory="rayleigh"),
    "give GA_flap= or G= and area=": dict(theory="timoshenko"),
    "is not on the beam": dict(nodes={"far": 3.0}),
    "'tip' is at 1": dict(nodes={"tip": 0.5}),
    "nodes must map names": dict(nodes=["tip"]),
    "which is not a node": dict(attach=["middle"]),
    "held by the frame": dict(attach=["root"]),
    'fixed must be "root" or None': dict(fixed="tip"),
    "damping must be one ratio or 6": dict(damping=[0.1, 0.2]),
    "nothing can deform": dict(modes=0),
    "stiffening must be True or False": dict(stiffening="yes"),
}


@pytest.mark.parametrize("words", BAD_BEAMS)
def test_bad_beams(words):
    given = dict(length=1.0, mass=1.0, EI_flap=1.0, EI_edge=2.0)
    given.update(BAD_BEAMS[words])
    with pytest.raises(mb.ModelError, match=words.replace("(", r"\(")):
        beam(given.pop("length"), **given)


def small_body(**changes):
    P1, P2 = np.zeros((1, 3, 3)), np.zeros((1, 1, 3, 3))
    P1[0, 0, 2], P2[0, 0, 2, 2] = 0.25, 0.2
    given = dict(mass=1.0, com=(0.5, 0, 0), inertia=np.diag([1e-4, 0.0834, 0.0834]), S=np.array([[0], [0], [1 / 3]]))
    return ModalBody(**{**given, **dict(P1=P1, P2=P2, K=np.array([[80.0]])), **changes})


BAD_BODIES = {
    "mass must be positive": dict(mass=0.0),
    "com must have the shape": dict(com=(0.0, 0.0)),
    "contains NaN": dict(S=np.array([[0], [0], [np.nan]])),
    "K must be a square matrix": dict(K=np.zeros((0, 0))),
    "negative eigenvalue": dict(K=np.array([[-1.0]])),
    "inertia must be symmetric": dict(inertia=np.array([[1.0, 0.1, 0], [0, 1, 0], [0, 0, 1]])),
    "move the body as a whole": dict(P1=np.zeros((1, 3, 3)), S=np.array([[0], [0], [0.6]])),
    "need node_position=": dict(nodes=("a",)),
    "names of their own": dict(nodes=("a", "a"), node_position=np.zeros((2, 3)), node_shape=np.zeros((2, 6, 1))),
    "give both of line_position": dict(line_position=np.zeros((2, 3))),
    "KG must have the shape": dict(KG=np.zeros((3, 1, 1))),
    "node_quadratic must have the shape": dict(node_quadratic=np.zeros((1, 3, 1, 1))),
}


@pytest.mark.parametrize("words", BAD_BODIES)
def test_bad_modal_bodies(words):
    assert small_body().n_modes == 1
    with pytest.raises(mb.ModelError, match=words):
        small_body(**BAD_BODIES[words])


def test_second_order_is_symmetric_kept_and_cut(tmp_path):
    body = beam(0.9, mass=1.3, EI_flap=2.1, EI_edge=3.7, GJ=0.8, inertia_flap=0.01, inertia_edge=0.02, modes=5)
    skew = body.node_quadratic.copy()
    skew[1, 0, 0, 1] += 1.0
    with pytest.raises(mb.ModelError, match="node_quadratic must be symmetric"):
        replace(body, node_quadratic=skew)
    again = ModalBody.load(body.save(tmp_path / "beam.npz"))
    assert np.array_equal(again.node_quadratic, body.node_quadratic)
    assert np.array_equal(again.line_quadratic, body.line_quadratic)
    q, few = np.random.default_rng(4).normal(size=5), [0, 3, 4]
    cut = mb.Model("cut").flexible_body("beam", body, modes=few).modal
    q[[1, 2]] = 0.0
    assert cut.places(q[few]) == pytest.approx(body.places(q), abs=1e-14)
    bent = body.node_position[1] + body.node_shape[1, :3] @ q + 0.5 * np.einsum("ikl,k,l", body.node_quadratic[1], q, q)
    assert body.places(q)[1] == pytest.approx(bent, abs=1e-14)
    assert body.places(q, [-1])[0] == pytest.approx(bent, abs=1e-14), "the end of the line is the tip"


def test_bad_files(tmp_path):
    bad = tmp_path / "no.npz"
    bad.write_text("nothing")
    with pytest.raises(mb.ModelError, match="not a file of a modal body"):
        ModalBody.load(bad)
    np.savez(tmp_path / "part.npz", mass=1.0)
    with pytest.raises(mb.ModelError, match="it lacks"):
        ModalBody.load(tmp_path / "part.npz")


def test_inertial_stiffness_of_a_free_beam_balances():
    """About its centre a free beam that spins is in tension everywhere, N(L) = N(0) = 0."""
    grid, *_ = fem(full_section)
    shape = np.zeros((grid.n_dof, 1))
    shape[6 * np.arange(25) + 1, 0] = grid.x  # a rotation about z
    shape[6 * np.arange(25) + 5, 0] = 1.0
    KG = inertial_stiffness(grid, shape, clamped=False)
    assert KG[3, 0, 0] < 0, "centrifugal: W_xx < 0 times KG < 0 stiffens"
    # sections that turn by r about z move inwards along y by r^2 y/2
    own = -sum(p.weight * p.section.mass_moments()[1, 1] for p in grid.points)
    assert KG[7, 0, 0] == pytest.approx(own, rel=1e-12) and own < 0
    assert np.abs(KG[[0, 1, 2, 4, 6, 9, 10, 11]]).max() < 1e-15 * np.abs(KG).max()


def tip_mass_roots(ratio, n):
    """1 + cos x cosh x + ratio x (cos x sinh x - sin x cosh x) = 0: a cantilever with ratio times its mass at the tip."""
    f = lambda x: 1 / np.cosh(x) + np.cos(x) + ratio * x * (np.cos(x) * np.tanh(x) - np.sin(x))  # noqa: E731
    x = np.linspace(0.1, 14, 2000)
    ends = np.flatnonzero(np.diff(np.sign(f(x))))[:n]
    return np.array([optimize.brentq(f, x[i], x[i + 1], xtol=1e-14) for i in ends])


@pytest.mark.parametrize("made", ["beam", "craig_bampton"])
def test_a_mass_at_the_tip(made):
    """The tip's static shapes carry a mass there: a model of the core against the closed form."""
    L, mass, EI, heavy = 1.2, 2.0, 30.0, 3.0
    if made == "beam":
        body = beam(L, mass=mass, EI_flap=EI, EI_edge=EI, modes=14, attach=["tip"])
    else:
        grid = mesh(np.linspace(0, L, 41), lambda x: Section(mass, EI, EI, 0, 0, 0, 0, 0, 0, 0), False, straight=True)
        at = np.zeros((41, 3))
        at[:, 0] = grid.x
        body = craig_bampton(*grid.assembled(), {"root": 0, "tip": 40}, positions=at, modes=14, fixed="root")
    m = mb.Model("cantilever")
    f = m.flexible_body("rod", body)
    m.fixed("clamp", m.ground, f.node("root"), at=(0, 0, 0))
    m.fixed("screw", f.node("tip"), m.body("mass", mass=heavy, inertia=(1e-9,) * 3, at=(L, 0, 0)))
    found = mb.modes(m).frequency[:6] * 2 * np.pi
    exact = (tip_mass_roots(heavy / (mass * L), 3) / L) ** 2 * np.sqrt(EI / mass)
    assert found == pytest.approx(np.repeat(exact, 2), rel=2e-5)
    plain = beam(L, mass=mass, EI_flap=EI, EI_edge=EI, modes=14)
    assert plain.n_modes < body.n_modes


@pytest.mark.parametrize(
    "name",
    [
        "flexible.beams",
        "flexible.component_modes",
        "flexible.modal_body",
        "plot.modal_body",
        "linear.multiblade",
    ]
    + ["examples._wind_rotor", "examples._windpact", "examples._slider_crank"],
)
def test_examples_in_docstrings(name):
    import doctest
    import importlib
    import sys

    importlib.import_module(f"mbrs.{name}")
    found = doctest.testmod(sys.modules[f"mbrs.{name}"])
    assert found.attempted > 0 and found.failed == 0


@pytest.mark.parametrize("elements", [7, 40, pytest.param(160, marks=pytest.mark.slow)])
@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_a_fine_mesh_loses_no_digits_of_its_stiffness(elements, theory):
    """A clamped beam with a load at its end: L^3/(3 EI), with shear + L/GA. From K itself 160 elements lost half of all digits."""
    length, EI, GA = 1.7, 830.0, 3.1e4
    shear = {"GA_flap": GA, "GA_edge": GA} if theory == "timoshenko" else {}
    b = mb.flexible.beam(
        length, mass=2.1, EI_flap=EI, EI_edge=9 * EI, modes=3, attach=["tip"], elements=elements, theory=theory, **shear
    )
    m = mb.Model("beam")
    f = m.flexible_body("beam", b, at=(0, 0, 0))
    m.fixed("root", m.ground, f.node("root"))
    h = mb.frf(m, f.node("tip").force("z"), f.node("tip").motion("z"), frequency=np.array([0.0])).value.ravel()[0].real
    known = length**3 / (3 * EI) + (length / GA if shear else 0.0)
    print(f"{elements} elements, {theory}: off by {abs(h / known - 1):.1e}")
    assert abs(h / known - 1) < 1e-12 + 10 * jitter.level()


@pytest.mark.some(1)
@pytest.mark.exact  # off the axis by the noise there is inertia
@pytest.mark.parametrize("joint", ["revolute", "spherical", "cylindrical"])
def test_a_beam_that_may_spin_about_its_axis_without_inertia_is_refused(joint):
    """No rotary inertia, so that nothing resists a turn about the axis: object and remedy, whatever the axes."""
    x = np.array([0.6, -0.64, 0.48])
    y = np.cross([0.3, 0.9, 0.2], x)
    y /= np.linalg.norm(y)
    m = mb.Model("spin")
    f = m.flexible_body(
        "beam",
        beam(1.3, mass=0.7, EI_flap=120.0, EI_edge=75.0, modes=4, attach=["tip"]),
        at=(0.2, 0.1, -0.4),
        orientation=np.column_stack([x, y, np.cross(x, y)]),
    )
    axis = {} if joint == "spherical" else {"axis": tuple(x)}
    getattr(m, joint)("pin", m.ground, f.node("root"), at=(0.2, 0.1, -0.4), **axis)
    with pytest.raises(mb.SingularError, match=r"coordinate 'pin[.a-z]*' carries no inertia.*give it mass or inertia"):
        mb.modes(m)
