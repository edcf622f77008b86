"""Motion of the wind rotor of J. Algorithms Comput. Technol. (2017): displacements at 40.1 m of a blade (figure 12) and
generalised coordinates of the rotor (figure 13).

Blades, hub and nacelle are those of the WindPACT 1.5 MW turbine, scaled so that the tip is where the text looks: 40.1 m from
the axis, or 40.1 m from the blade's root, since the text does not say which. Displacements are those in axes that turn with the
shaft. Five ways: blades and hub as bodies of their own, the same by `bdf-bfgs`, the whole rotor as one flexible body with two
antisymmetric modes and a symmetric one of each family, as in the text, and the modal method in the frame of the rotor, with its
Coriolis and centrifugal terms and without them, that is in a frame taken as inertial, as in the text. Air loads and shaft are
invented.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import scipy.signal
from mbrs import reference
from mbrs.model.tables import tables
from mbrs.reference.fixed_frame import Rotor
from said import folder, save, told

BLADES, SPEED, END = ("blade1", "blade2", "blade3"), 17.2 * 2 * np.pi / 60, 6.0
FAMILIES = ("1st flap", "1st edge", "2nd flap")
PLACE, HUB, BLADE = 40.1, 1.75, 33.25  # m: the text's place; radius of the hub and length of the blade before scaling
READINGS = {"40.1 m from the axis": PLACE / (HUB + BLADE), "40.1 m from the blade's root": PLACE / BLADE}
TIMES = np.linspace(0.0, END, 241)


Loads = dict[str, dict[str, np.ndarray]]


def loaded(m: mb.Model, loads: Loads) -> mb.Model:
    """With loads of the air on each blade, as `Model.section_load` takes them."""
    for name, load in loads.items():
        m.section_load(name, **load, name=f"{name}-air")
    return m


def multibody(
    scale: float, whole: bool = False, loads: Loads | None = None, **options: str
) -> tuple[mb.Trajectory, np.ndarray]:
    """The motion, and the displacement (n_t, 3) of the first tip in axes that turn with the shaft: outwards, edgewise, flapwise.

    Loads of the air are those given, or else invented.
    """
    build = mb.examples.whole_rotor if whole else mb.examples.wind_rotor
    m = build(air=2 * END, scale=scale) if loads is None else loaded(build(scale=scale), loads)
    m.marker("tip", m["rotor"].node("tip1") if whole else m["blade1"].node("tip"))
    traj = mb.simulate(m, t=TIMES, rtol=1e-6, **options)
    centre = traj.position("rotor" if whole else "hub")[0]
    place = np.einsum("tji,tj->ti", traj.rotation("shaft"), traj.point("tip") - centre)
    return traj, place - [scale * (HUB + BLADE), 0.0, 0.0]


def turning(scale: float, speed: float, loads: Loads | None = None, **options: object) -> Rotor:
    """The rotor linearised in its own frame at a speed, without its drive."""
    m = loaded(mb.examples.wind_rotor(speed=speed, drive=False, scale=scale, **options), loads or {})
    return Rotor(reference.System(tables(m)), "bearing", BLADES, "shaft end", speed)


def inertial(rotor: Rotor, still: Rotor) -> np.ndarray:
    """M y" + C y' + K y = f(t) of the rotor at rest under weight and air loads of the turning one, exact for loads linear between times."""
    n = len(still.M)
    A = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(still.M, still.S), -np.linalg.solve(still.M, still.D)]]
    )
    B = np.vstack([np.zeros((n, n)), np.linalg.inv(still.M)])
    load = np.array([rotor.load(x) + rotor.inertia for x in TIMES])
    step = TIMES[1]
    system = scipy.signal.cont2discrete((A, B, np.eye(2 * n), np.zeros((2 * n, n))), step, method="foh")[:4]
    return scipy.signal.dlsim((*system, step), load)[1][:, :n]


def tip(rotor: Rotor, y: np.ndarray, scale: float) -> np.ndarray:
    """Displacement (n_t, 3) of the first tip from the coordinates of hub and blade."""
    blade = mb.examples.wind_blade(4, scale)
    hub = y[:, [rotor.names.index(f"shaft end.{axis}") for axis in ("x", "y", "z", "rx", "ry", "rz")]]
    q = y[:, [rotor.names.index(f"blade1.q{k + 1}") for k in range(4)]]
    return (
        hub[:, :3] + np.cross(hub[:, 3:], [scale * (HUB + BLADE), 0, 0]) + q @ blade.node_shape[blade.node("tip"), :3].T
    )


def displacements(scale: float) -> tuple[dict[str, np.ndarray], mb.Trajectory]:
    """Figure 12 by each way, and the motion of the rotor as one body."""
    one, moved = multibody(scale, whole=True)
    rotor, still = turning(scale, SPEED, air=2 * END), turning(scale, 0.0, gravity=None)
    return {
        "multibody, blades": multibody(scale)[1],
        "multibody, blades, bdf-bfgs": multibody(scale, method="bdf-bfgs")[1],
        "multibody, one body, 9 modes": moved,
        "modal method, all terms": tip(rotor, rotor.superposed(TIMES), scale),
        "modal method, inertial frame": tip(rotor, inertial(rotor, still), scale),
    }, one


def draw_coordinates(traj: mb.Trajectory, where: Path | str) -> list[tuple[str, str, str, str]]:
    """Figure 13: two antisymmetric coordinates and the symmetric one of each family over time."""
    q, late = traj.modal("rotor"), TIMES > END / 2
    figure, axes = plt.subplots(3, 1, figsize=(8.5, 8), layout="constrained", sharex=True)
    rows = []
    for ax, family, own in zip(axes, FAMILIES, np.split(np.arange(9), 3), strict=True):
        for label, k in zip(("antisymmetric", "antisymmetric", "symmetric"), own, strict=True):
            ax.plot(TIMES, q[:, k], label=label)
        mean, spread = q[late][:, own].mean(axis=0), q[late][:, own].std(axis=0)
        rows.append(
            (
                f"{family}: generalised coordinates after {END / 2:g} s",
                "symmetric: averaged static part; antisymmetric: vibration about it",
                f"symmetric: mean {mean[2]:.3g}, deviation {spread[2]:.2g}; antisymmetric: means {mean[0]:.2g}, {mean[1]:.2g}, "
                f"deviations {spread[0]:.2g}, {spread[1]:.2g} (kg^1/2 m)",
                "scale of the coordinates is lost",
            )
        )
        ax.set(ylabel=f"{family} [kg^1/2 m]")
    axes[0].legend(fontsize=8, ncols=3)
    axes[-1].set_xlabel("t [s]")
    save(figure, where, "rotor_coordinates.png")
    return [*rows, mean_deflection(traj)]


def mean_deflection(traj: mb.Trajectory) -> tuple[str, str, str, str]:
    """The flapwise displacement of a tip in its symmetric and antisymmetric parts."""
    body = traj.model["rotor"].modal
    part = traj.modal("rotor") * body.node_shape[body.node("tip1"), 2]
    late, symmetric = TIMES > END / 2, np.arange(part.shape[1]) % 3 == 2
    even, odd = (part[late][:, chosen].sum(axis=1) for chosen in (symmetric, ~symmetric))
    return (
        f"flapwise displacement of a tip after {END / 2:g} s",
        "symmetric modes: averaged static deformation; antisymmetric ones: vibration around it",
        f"symmetric modes: mean {even.mean():.3g} m, deviation {even.std():.2g}; antisymmetric ones: mean {odd.mean():.2g}, "
        f"deviation {odd.std():.2g}",
        "data of the blade are lost",
    )


def main(where: Path | str) -> None:
    """Print distances from the full equations, draw displacements and generalised coordinates."""
    figure, axes = plt.subplots(2, 2, figsize=(12, 6), layout="constrained", sharex=True)
    rows = []
    for column, (reading, scale) in zip(axes.T, READINGS.items(), strict=True):
        curves, motion = displacements(scale)
        full = curves["multibody, blades"]
        for ax, axis, name in ((column[0], 2, "flapwise"), (column[1], 1, "edgewise")):
            largest = np.abs(full[:, axis]).max()
            gaps = []
            for (label, moved), style in zip(curves.items(), ("-", "-.", (0, (1, 1)), "--", ":"), strict=True):
                ax.plot(TIMES, moved[:, axis], linestyle=style, label=label)
                gaps.append(f"{label} {np.abs(moved[:, axis] - full[:, axis]).max() / largest:.2g}")
            rows.append(
                (
                    f"{name} displacement of a tip {reading}",
                    "at 40.1 m; coincident generally, with deviations",
                    f"up to {largest:.3g} m; away from the full equations, of that: {', '.join(gaps[1:])}",
                    "data of the blade and which place is meant are lost",
                )
            )
            ax.set(ylabel=f"{name} [m]", title=reading)
    rows += draw_coordinates(motion, where)
    axes[0, 0].legend(fontsize=7)
    for ax in axes[1]:
        ax.set_xlabel("t [s]")
    save(figure, where, "rotor_displacements.png")
    told(rows)


if __name__ == "__main__":
    main(folder())
