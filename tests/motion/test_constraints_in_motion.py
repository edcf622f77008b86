"""Constraints given as functions in motion: against joints, drives, couplers and an equation derived by hand."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from constraint_models import Bead, ball, driven_arm, frame, pendulum, skate
from scipy.integrate import solve_ivp

SCHEMES = {
    "explicit": ({"method": "explicit", "rtol": 1e-10}, 1e-9),
    "independent": ({"method": "explicit", "rtol": 1e-10, "coordinates": "independent"}, 1e-9),
    "absolute": ({"method": "explicit", "rtol": 1e-10, "coordinates": "absolute"}, 1e-9),
    "radau": ({"method": "radau", "rtol": 1e-9}, 1e-8),
    "bdf": ({"method": "bdf", "rtol": 1e-9}, 1e-6),
    "bdf-bfgs": ({"method": "bdf-bfgs", "step": 2e-3}, 1e-6),
    "symmetric": ({"method": "bdf-bfgs", "form": "symmetric", "step": 2e-3}, 1e-6),
    "generalized-alpha": ({"method": "generalized-alpha", "step": 2e-3}, 2e-4),
    "ali3p": ({"method": "ali3p", "step": 2e-3}, 2e-4),
}
EXACT = ("explicit", "radau", "generalized-alpha", "ali3p")


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_bead_on_a_curve(scheme):
    """m (1 + f'^2) x" + m f' f" x'^2 = m (g_x + f' g_y), integrated by SciPy."""
    case = Bead()
    gx, gy, _ = case.R.T @ case.gravity

    def rate(_, s):
        x, v = s
        f1, f2 = 0.8 * np.cos(2 * x) + 0.3, -1.6 * np.sin(2 * x)
        return [v, (gx + f1 * gy - f1 * f2 * v * v) / (1 + f1 * f1)]

    t = np.linspace(0, 0.8, 5)
    x = solve_ivp(rate, (0, t[-1]), [case.x0, case.v0], t_eval=t, rtol=1e-12, atol=1e-13).y[0]
    options, limit = SCHEMES[scheme]
    traj = mb.simulate(case.model(), t=t, **options)
    error = np.abs(traj.position("bead") - np.array([case.place(one) for one in x])).max()
    print(scheme, error, traj.residual.max())
    assert error < limit and traj.residual.max() < 1e-10


@pytest.mark.parametrize("scheme", EXACT)
@pytest.mark.parametrize(
    "kinds", [(pendulum, "rod", "function"), (pendulum, "rod", "derivatives"), (ball, "joint", "function")]
)
def test_joints_and_functions_move_alike(scheme, kinds):
    make, *pair = kinds
    t = [0.0, 0.02, 0.04] if "derivatives" in pair else [0.0, 0.2, 0.4]
    a, b = (mb.simulate(make(kind), t=t, **SCHEMES[scheme][0]) for kind in pair)
    error = np.abs(a.position("bob") - b.position("bob")).max()
    print(scheme, pair, error)
    assert error < (1e-5 if scheme in ("generalized-alpha", "ali3p") else 1e-8)


@pytest.mark.parametrize("scheme", [s for s in SCHEMES if s not in ("symmetric", "absolute")])
def test_time_in_a_constraint_is_a_drive(scheme):
    t = np.linspace(0, 0.6, 4)
    a, b = (mb.simulate(driven_arm(kind), t=t, **SCHEMES[scheme][0]) for kind in ("drive", "function"))
    assert np.abs(a.position("tip") - b.position("tip")).max() < 1e-9
    force = a.drive_force("motor")
    assert b.constraint_force("motor")[:, 0] == pytest.approx(force, abs=1e-7 * np.abs(force).max())


@pytest.mark.parametrize("scheme", [s for s in SCHEMES if s not in ("symmetric", "absolute")])
def test_a_row_of_velocities_is_a_knife_edge(scheme):
    t = np.linspace(0, 1.0, 4)
    a, b = (mb.simulate(skate(kind), t=t, **SCHEMES[scheme][0]) for kind in ("joint", "function"))
    assert np.ptp(a.rotation("skate")[:, 0, 0]) > 0.05
    assert np.abs(a.position("skate") - b.position("skate")).max() < 1e-7
    # the row of the joint points along the same direction
    force = np.abs(a.reaction("edge")[:, :3]).max()
    assert np.linalg.norm(a.reaction("edge")[:, :3], axis=1) == pytest.approx(
        np.abs(b.constraint_force("edge")[:, 0]), abs=1e-6 * force
    )


def test_rows_with_a_rate_of_their_own():
    """u' (1 + u^2) = 0.3 cos 2t moves a slider by u + u^3/3 = 0.15 sin 2t, whatever its forces."""
    m = mb.Model("pump", gravity=(1.0, -2.0, -9.0))
    b = m.body("piston", mass=0.6, inertia=(0.1, 0.1, 0.1), at=(0.2, -0.1, 0.4), velocity=tuple(0.3 * frame(3)[:, 0]))
    slide = m.prismatic("slide", m.ground, b, at=(0.2, -0.1, 0.4), axis=tuple(frame(3)[:, 0]), k=40.0)
    m.velocity_constraint("pump", lambda t, u: 1.0 + u**2, [slide], d=lambda t, u: -0.3 * np.cos(2 * t))
    t = np.linspace(0, 2, 9)
    for method in ("explicit", "radau", "ali3p"):
        traj = mb.simulate(m, t=t, method=method, **({"step": 1e-3} if method == "ali3p" else {"rtol": 1e-10}))
        u = (traj.position("piston") - np.array([0.2, -0.1, 0.4])) @ frame(3)[:, 0]
        error = np.abs(u + u**3 / 3 - 0.15 * np.sin(2 * t)).max()
        print(method, error)
        assert error < (1e-6 if method == "ali3p" else 1e-8)


def chain(kind, n):
    """A chain of hinged links whose last angle follows the first one; large chains take sparse matrices."""
    m = mb.Model("chain", gravity=(0.4, -0.3, -9.7))
    inner, R = m.ground, frame(9)
    for i in range(n):
        at = R @ np.array([0.1 * (i + 0.5), 0.02 * (i % 2), 0.01 * i])
        link = m.body(f"link{i}", mass=0.1, inertia=(1e-3, 2e-3, 2e-3), at=tuple(at))
        m.revolute(
            f"hinge{i}", inner, link, at=tuple(at - 0.05 * R[:, 0]), axis=tuple(R[:, 2 if i % 2 else 1]), k=2.0, c=0.01
        )
        inner = link
    first, last = "hinge0", f"hinge{n - 1}"
    if kind == "coupler":
        m.coupler("gear", first, last, -0.7)
    else:
        m.constraint("gear", lambda t, u: 3.0 * (u[1] + 0.7 * u[0]), [first, last])
    return m


@pytest.mark.parametrize("n", [3, pytest.param(80, marks=pytest.mark.slow)])
@pytest.mark.parametrize("scheme", ["explicit", "radau"])
def test_a_linear_function_is_a_coupler(scheme, n):
    a, b = (mb.simulate(chain(kind, n), t=[0.05], method=scheme, rtol=1e-8) for kind in ("coupler", "function"))
    assert np.abs(a.position(f"link{n - 1}") - b.position(f"link{n - 1}")).max() < 1e-9
    assert 3 * b.constraint_force("gear")[:, 0] == pytest.approx(a.drive_force("gear"), rel=1e-6)


def test_a_rheonomic_start_has_the_rates_of_its_rows():
    traj = mb.simulate(driven_arm("function"), t=[0.0, 1e-3], rtol=1e-8)
    assert np.linalg.norm(traj.angular_velocity("arm")[0]) == pytest.approx(2.1 * np.cos(0.3), rel=1e-12)
