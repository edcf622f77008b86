"""Rotors that turn steadily against closed forms.

A disc with polar inertia I_p and transverse inertia I_t that can tilt, elastically held, at the speed W: with equal
stiffnesses k its whirl is I_t w^2 - I_p W w - k = 0; with two fixed supports (k_1 - I_t w^2)(k_2 - I_t w^2) = (I_p W w)^2.
"""

import warnings

import mbrs as mb
import numpy as np
import pytest


def quiet(function, *args, **given):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        return function(*args, **given)


def whirl(polar, transverse, k, speed):
    """Both whirl frequencies, Hz, of equal supports."""
    h = polar * speed
    root = np.sqrt(h * h + 4 * transverse * k)
    return np.sort(np.abs([(h - root), (h + root)])) / (2 * transverse) / (2 * np.pi)


def unequal_whirl(polar, transverse, k1, k2, speed):
    squares = np.roots([transverse**2, -(transverse * (k1 + k2) + (polar * speed) ** 2), k1 * k2])
    return np.sort(np.sqrt(squares)) / (2 * np.pi)


def test_the_closed_forms():
    assert whirl(0.1, 0.05, 1e4, 400.0) == pytest.approx([31.831, 159.155], abs=5e-4)
    assert unequal_whirl(0.1, 0.05, 1e4, 2e4, 400.0) == pytest.approx([41.58650, 172.27922], abs=5e-6)


def hub_and_disc(polar, transverse, k, both):
    """A disc on a hub that turns in a bearing; ``both``: the elastic joint is given as one, so that both turn."""
    m = mb.Model("rotor")
    axis = np.array([0.36, -0.48, 0.8])
    frame = mb.rotation(tuple(np.cross((1, 0, 0), axis)), float(np.arccos(axis[0])))
    hub = m.body("hub", mass=1.0, inertia=(0.01, 0.01, 0.01), at=(0, 0, 0), orientation=frame)
    disc = m.body("disc", mass=10.0, inertia=(polar, transverse, transverse), at=(0, 0, 0), orientation=frame)
    m.revolute("spin", m.ground, hub, at=(0, 0, 0), axis=tuple(axis))
    if both:
        m.free("shaft", hub, disc, at=(0, 0, 0), orientation=frame, k=(1e8, 1e6, 1e6, 1e5, k, k))
    else:
        m.bushing("shaft", hub, disc, at=(0, 0, 0), orientation=frame, k=(1e8, 1e6, 1e6, 1e5, k, k))
    return m


SIZES = [(0.1, 0.05, 1e4, 400.0), (0.03, 0.021, 3.3e3, 270.0), (0.2, 0.17, 4.1e4, 610.0)]


def tilting(m, speed, expected):
    """Frequencies nearest to the expected ones."""
    modes = quiet(lambda: mb.modes(m, at=mb.steady_motion(m, speed)))
    return np.array([modes.frequency[np.argmin(np.abs(modes.frequency - f))] for f in expected])


@pytest.mark.parametrize("size", SIZES)
def test_a_disc_on_a_hub_through_a_free_joint(size):
    polar, transverse, k, speed = size
    fixed = whirl(polar, transverse, k, speed)
    turning = fixed + speed / (2 * np.pi) * np.array([1, -1])  # backward and forward whirl seen from the hub
    m = hub_and_disc(polar, transverse, k, both=True)
    frames = [np.abs(tilting(m, {"spin": speed}, f) / f - 1).max() for f in (fixed, turning)]
    assert min(frames) < 1e-7


@pytest.mark.parametrize("size", SIZES)
def test_a_disc_on_a_hub_through_a_bushing(size):
    """The disc turns with the hub that carries it."""
    polar, transverse, k, speed = size
    expected = whirl(polar, transverse, k, speed)
    m = hub_and_disc(polar, transverse, k, both=False)
    assert tilting(m, {"spin": speed}, expected) == pytest.approx(expected, rel=1e-7)


def gimbal(polar, transverse, k1, k2):
    """A disc that spins in a light gimbal on two springs."""
    m = mb.Model("disc in a gimbal")
    inertia = 1e-9 * transverse
    g = m.body("gimbal", mass=1e-6, inertia=(inertia, inertia, inertia), at=(0, 0, 0))
    d = m.body("disc", mass=1.0, inertia=(transverse, transverse, polar), at=(0, 0, 0))
    m.universal("support", m.ground, g, at=(0, 0, 0), axis="x", axis2="y", k=(k1, k2))
    m.revolute("spin", g, d, at=(0, 0, 0), axis="z")
    return m


@pytest.mark.parametrize("size", [(0.1, 0.05, 1e4, 2e4, 400.0), (0.03, 0.021, 3.3e3, 5.9e3, 270.0)])
def test_a_disc_in_a_gimbal_on_unequal_supports(size):
    polar, transverse, k1, k2, speed = size
    expected = unequal_whirl(*size)
    assert tilting(gimbal(polar, transverse, k1, k2), {"spin": speed}, expected) == pytest.approx(expected, rel=1e-7)


def on_a_bushing(polar, transverse, k1, k2):
    """The same disc on a bushing that does not resist its spin."""
    m = mb.Model("disc on a bushing")
    m.body("disc", mass=10.0, inertia=(polar, transverse, transverse), at=(0, 0, 0))
    m.bushing("support", m.ground, "disc", at=(0, 0, 0), k=(1e9, 1e6, 1e6, 0, k1, k2))
    return m


@pytest.mark.parametrize(
    "size", [(0.1, 0.05, 1e4, 2e4, 400.0), (0.1, 0.05, 1e4, 1e4, 400.0), (0.03, 0.021, 3.3e3, 5.9e3, 270.0)]
)
def test_a_disc_on_a_bushing(size):
    """Right, or refused with the name of the bushing or of the disc."""
    polar, transverse, k1, k2, speed = size
    expected = unequal_whirl(*size)
    try:
        found = tilting(on_a_bushing(polar, transverse, k1, k2), {"disc.rx": speed}, expected)
    except mb.MbrsError as reason:
        assert "support" in str(reason) or "disc" in str(reason)
        return
    assert found == pytest.approx(expected, rel=1e-7)


# --- a shaft -----

E, RHO, RADIUS, LENGTH = 2.1e11, 7800.0, 0.1, 1.0
AREA, SECOND = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4


def rayleigh(speed, n=1):
    """(rho A + rho I l^2) w^2 - 2 rho I W l^2 w - E I l^4 = 0, l = n pi/L: whirl of a pinned Rayleigh shaft, Hz."""
    l = n * np.pi / LENGTH  # noqa: E741
    roots = np.roots([RHO * AREA + RHO * SECOND * l**2, -2 * RHO * SECOND * speed * l**2, -E * SECOND * l**4])
    return np.sort(np.abs(roots)) / (2 * np.pi)


def test_the_closed_form_of_the_shaft():
    assert rayleigh(0.0) == pytest.approx([402.5866] * 2, abs=5e-5)
    assert rayleigh(3000.0) == pytest.approx([391.2535, 414.2481], abs=5e-5)


def shaft(stiffness=1e13):
    """One flexible body on two bearings that hold it across its axis."""
    beam = mb.flexible.beam(
        LENGTH, E=E, rho=RHO, area=AREA, I_flap=SECOND, I_edge=SECOND, modes=12, fixed=None, attach=["root", "tip"]
    )
    m = mb.Model("shaft")
    s = m.flexible_body("shaft", beam)
    for node, x in (("root", 0.0), ("tip", LENGTH)):
        m.bushing(f"bearing {node}", m.ground, s.node(node), at=(x, 0, 0), k=(0, stiffness, stiffness, 0, 0, 0))
    return m


@pytest.mark.some(1)
@pytest.mark.parametrize("speed", [1000.0, 3000.0])
def test_a_spinning_shaft_on_fixed_bearings(speed):
    """In the axes of the result: seen from the shaft, backward whirl is faster by its speed, and forward whirl slower."""
    frame = quiet(mb.steady_motion, shaft(), {"shaft.rx": speed}).frame
    assert frame in ("fixed", "rotating")
    turn = speed / (2 * np.pi) if frame == "rotating" else 0.0
    expected = np.abs(rayleigh(speed) + [turn, -turn])
    assert tilting(shaft(), {"shaft.rx": speed}, expected) == pytest.approx(expected, rel=1e-3)
