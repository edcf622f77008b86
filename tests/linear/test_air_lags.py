"""States of the air in linear analyses: lagging inflow against its transfer function, flutter of a section against Theodorsen."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from air_models import polars
from mbrs._lib.rotations import quaternion_matrix
from scipy.optimize import brentq

# --- a blade on a slide in oblique wind: annuli that answer with two lags -----

TURN = quaternion_matrix(np.array(mb.rotation((0.3, -0.8, 0.5), 1.1)))
AXIS = ",".join(f"{v:.17g}" for v in TURN[:, 2])
PUSH, MOVED = f"blade.force.({AXIS})", f"blade.motion.({AXIS})"
MASS, C, K = 37.0, 11.0, 5300.0


def slide(inflow, wind, sections=2):
    """A blade that moves along the axis of its annuli; ``wind`` (axial, ahead) m/s in its own axes."""
    out, ahead, axis = TURN.T
    m = mb.Model("slide")
    body = m.body(
        "blade",
        mass=MASS,
        inertia=(1.0, 20.0, 20.0),
        at=(0.2, 0.1, -0.4),
        orientation=np.stack([out, ahead, axis], axis=1),
    )
    m.prismatic("slide", m.ground, body, at=(0.2, 0.1, -0.4), axis=axis, k=K, c=C)
    blade = mb.aero.blade([0.4, 6.1], [0.9, 0.7], 0.11, polars()[0], body="blade", sections=sections)
    u = wind[0] * axis - wind[1] * ahead
    m.aerodynamics("air", [blade], wind=mb.aero.wind(float(np.linalg.norm(u)), u), inflow=inflow, axis=axis)
    return m


def flow(inflow, wind):
    m = slide(inflow, wind)
    traj = mb.simulate(m, t=[0.0], rtol=1e-9)
    return traj._flow[0]


def damping(omega, wind):
    """The complex resistance F / v of the blade by the closed form of the lags and differences of the steady sections."""
    h = 1e-4
    base = flow("dynamic-inflow", wind)
    v = base[:, -3:] @ TURN[:, [2, 1]]  # axial, ahead
    m = slide("bem", wind)
    place, width, chord, twist = (np.array(m.airs[0].blades[0][key]) for key in ("place", "width", "chord", "twist"))
    polar = polars()[0]

    def force(u, v):
        """axial force of each strip in the relative wind with the induced velocity held"""
        normal, along = u[0] + v[:, 0], u[1] - v[:, 1]
        c = polar.clip_values(np.arctan2(normal, along) - twist)
        size = 0.5 * 1.225 * chord * width * np.hypot(normal, along)
        return size * (c[:, 0] * along + c[:, 1] * normal)

    up, down = ((wind[0] + s * h, wind[1]) for s in (1.0, -1.0))
    held = (force(up, v) - force(down, v)) / (2 * h)
    w = [flow("bem", u)[:, -3:] @ TURN[:, [2, 1]] for u in (up, down)]
    full = (force(up, w[0]) - force(down, w[1])) / (2 * h)
    a = np.clip(-v[:, 0] / wind[0], 0.0, 0.5)
    t1 = 1.1 / (1.0 - 1.3 * a) * 6.1 / wind[0]
    t2 = (0.39 - 0.26 * (place / 6.1) ** 2) * t1
    s = 1j * omega[:, None]
    lag = (1.0 + 0.6 * t1 * s) / ((1.0 + t1 * s) * (1.0 + t2 * s))
    return np.sum(held + (full - held) * lag, axis=1)


def test_inflow_that_lags_has_its_analytic_transfer_function(case):
    wind, omega = (7.3, 21.0), np.array([0.1, 0.9, 4.0, 11.9, 40.0])
    m = slide("dynamic-inflow", wind)
    found = mb.frf(m, PUSH, MOVED, omega=omega, at=mb.equilibrium(m)).value[0, 0]
    known = 1.0 / (K - omega**2 * MASS + 1j * omega * (C + damping(omega, wind)))
    assert np.max(np.abs(1.0 / known - (K - omega**2 * MASS + 1j * omega * C))) > 100.0
    case("blade on a slide with dynamic inflow, receptance", topic="aero", ours=found, known=known, within=1e-6,
         source="transfer function of the two lags, differences of the sections' forces")  # fmt: skip


def test_modes_with_lagging_inflow_are_poles_of_its_transfer_function():
    wind = (7.3, 21.0)
    m = slide("dynamic-inflow", wind)
    at = mb.equilibrium(m)
    modal = mb.modes(m, at=at)
    assert len(modal.eigenvalue) == 1 + 8
    for s in modal.eigenvalue[np.abs(modal.eigenvalue.imag) > 1.0]:
        z = K + s**2 * MASS + s * (C + damping(np.array([s / 1j]), wind)[0])
        assert abs(z) < 1e-5 * K
    assert np.sum(np.array(modal.kind) == "relaxation") == 8
    steady = slide("bem", wind)
    assert pytest.approx(mb.linearize(m, at=at).C, rel=1e-9) == mb.linearize(steady, at=mb.equilibrium(steady)).C


def test_a_linear_response_is_a_small_motion():
    """A step of force: linear response with the states, and the motion of the model."""
    m = slide("dynamic-inflow", (7.3, 21.0))
    at, t = mb.equilibrium(m), np.linspace(0.0, 1.0, 21)
    linear = mb.response(m, t, {PUSH: lambda s: 1e-3 + 0.0 * s}, MOVED, at=at).displacement[0]
    m.force("push", "blade", value=1e-3 * TURN[:, 2], at=(0.2, 0.1, -0.4))
    motion = mb.simulate(m, t=t, rtol=1e-11, at=at).q[:, 0]
    motion = motion - motion[0]
    assert np.max(np.abs(motion - linear)) < 1e-4 * np.max(np.abs(linear))


# --- the typical section in attached flow -----

A, X, R2, RATIO, FREQUENCY = -0.2, 0.1, 0.24, 20.0, 0.4
B, PITCHING, DENSITY, LENGTH = 0.37, 13.1, 1.19, 1.9
HEAVY = RATIO * np.pi * DENSITY * B**2 * LENGTH


def typical_section(speed, **more):
    """A wing that plunges and pitches about its elastic axis; what air it accelerates is a body at the middle of the chord."""
    out, ahead, up = TURN.T
    axes, at = np.stack([out, ahead, up], axis=1), np.array([0.3, -0.2, 0.7])
    m = mb.Model("typical section")
    slider = 0.13 * HEAVY
    mass, behind = HEAVY - slider, HEAVY * X * B / (HEAVY - slider)
    carriage = m.body("carriage", mass=slider, inertia=(1.0, 1.0, 1.0), at=at, orientation=axes)
    about = HEAVY * R2 * B**2 - mass * behind**2
    wing = m.body("wing", mass=mass, inertia=(about, 5.0, 5.0), com=(0.4, -behind, 0.0), at=at, orientation=axes)
    m.prismatic("plunge", m.ground, carriage, at=at, axis=up, k=HEAVY * (FREQUENCY * PITCHING) ** 2)
    m.revolute("pitch", carriage, wing, at=at, axis=out, k=HEAVY * R2 * B**2 * PITCHING**2)
    added = np.pi * DENSITY * B**2 * LENGTH
    fluid = m.body("fluid", mass=added, inertia=(added * B**2 / 8.0, 1.0, 1.0), at=at + A * B * ahead, orientation=axes)
    m.fixed("carried", wing, fluid, at=at)
    plate = mb.aero.polar([-0.5, 0.5], [-np.pi, np.pi], [0.0, 0.0], name="plate", interpolation="linear")
    made = mb.aero.blade([0.0, LENGTH], 2 * B, 0.0, plate, body="wing", line=0.5 * (1.0 + A), sections=2)
    wind = mb.aero.wind(speed, -ahead)
    m.aerodynamics("air", [made], wind=wind, density=DENSITY, **{"attached": True, **more})
    return m


def by_matrices(speed):
    """The roots of the same section by the matrices of `mb.aero.attached_flow`."""
    air = mb.aero.attached_flow(B, speed, axis=A, density=DENSITY * LENGTH)
    mass = HEAVY * np.array([[1, B * X], [B * X, B**2 * R2]])
    return np.linalg.eigvals(air.state_matrix(mass, HEAVY * PITCHING**2 * np.diag([FREQUENCY**2, B**2 * R2])))


@pytest.mark.parametrize("ratio", [0.4, 1.7, 2.6])
def test_attached_flow_of_a_model_has_the_roots_of_its_matrices(ratio):
    speed = ratio * B * PITCHING
    found, known = mb.modes(typical_section(speed)).eigenvalue, by_matrices(speed)
    known = known[known.imag > 1e-6]
    assert np.sort_complex(found[found.imag > 1e-6]) == pytest.approx(np.sort_complex(known), rel=1e-9)


def test_a_section_of_a_model_flutters_where_theodorsen_says(case):
    def least_stable(ratio):
        s = mb.modes(typical_section(ratio * B * PITCHING)).eigenvalue / PITCHING
        s = s[s.imag > 1e-3]
        return s[np.argmax(s.real)]

    speed = brentq(lambda v: least_stable(v).real, 1.9, 2.5, xtol=1e-10)
    ours = [speed, least_stable(speed).imag]
    case("flutter of the typical section as a model: speed, frequency", topic="aero", ours=ours, known=[2.18391, 0.64898], within=8e-3,
         source="Theodorsen's determinant (NACA 496); Jones' two states")  # fmt: skip


def test_analyses_without_states_of_the_air_refuse_them_by_name():
    m = typical_section(9.0)
    for call in (
        lambda: mb.sensitivity(mb.modes(m), ["pitch.k"]),
        lambda: mb.harmonic_balance(m, inputs="wing.force.z", amplitude=1.0, omega=4.0),
    ):
        with pytest.raises(mb.ModelError, match="the air 'air' has a state that relaxes"):
            call()
