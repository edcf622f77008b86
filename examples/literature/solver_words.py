"""The multibody solver of J. Algorithms Comput. Technol. (2017) by its words alone, and what each addition buys (its
algorithm 2 on its swing).

Absolute coordinates (x, y, angle of each rod), the Gear-Gupta-Leimkuhler form, the Taylor predictor of order 2, four-
step BDF, and inverse BFGS: a script of its own, in a plane, whose equations of a step go to `mb.root(..., plain=True)`.
Then differences for the first H, scales, and the fallback to Broyden's update are added one by one. Lengths and the
second mass are lost: rods of 2 m and 336.14 kg.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told
from scipy.integrate import solve_ivp

LENGTH, MASS, RATE, GRAVITY = 2.0, 336.14, np.pi / 3, 9.81
HALF, INERTIA = LENGTH / 2, MASS * LENGTH**2 / 12
M = np.array([MASS, MASS, INERTIA] * 2)
WEIGHT = np.array([0, -MASS * GRAVITY, 0] * 2)
BDF4 = np.array([25, -48, 36, -16, 3]) / 12
N = 6, 5  # coordinates, rows: two pins and the drive


def rows(t: float, q: np.ndarray) -> np.ndarray:
    """Phi: A's left end at the origin, A's angle, B's left end at A's right end."""
    (xa, ya, a), (xb, yb, b) = q[:3], q[3:]
    tip = np.array([xa + HALF * np.cos(a), ya + HALF * np.sin(a)])
    return np.r_[
        xa - HALF * np.cos(a),
        ya - HALF * np.sin(a),
        a - RATE * t,
        np.array([xb - HALF * np.cos(b), yb - HALF * np.sin(b)]) - tip,
    ]


def jacobian(q: np.ndarray) -> np.ndarray:
    """Phi_q (5, 6)."""
    ca, sa, cb, sb = HALF * np.cos(q[2]), HALF * np.sin(q[2]), HALF * np.cos(q[5]), HALF * np.sin(q[5])
    return np.array(
        [[1, 0, sa, 0, 0, 0], [0, 1, -ca, 0, 0, 0], [0, 0, 1, 0, 0, 0], [-1, 0, sa, 1, 0, sb], [0, -1, -ca, 0, 1, -cb]]
    )


def truth(times: np.ndarray) -> np.ndarray:
    """q and v (n, 12) from the equation of B's angle, docs/theory.md (23.11)."""

    def slope(t: float, z: np.ndarray) -> list[float]:
        force = MASS * HALF * LENGTH * RATE**2 * np.sin(RATE * t - z[0]) - MASS * GRAVITY * HALF * np.cos(z[0])
        return [z[1], force / (INERTIA + MASS * HALF**2)]

    b, w = solve_ivp(slope, (0, times[-1]), [0.0, 0.0], "DOP853", times, rtol=1e-13, atol=1e-13).y
    a = RATE * times
    ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    q = [HALF * ca, HALF * sa, a, LENGTH * ca + HALF * cb, LENGTH * sa + HALF * sb, b]
    v = [
        -HALF * sa * RATE,
        HALF * ca * RATE,
        RATE + 0 * a,
        -LENGTH * sa * RATE - HALF * sb * w,
        LENGTH * ca * RATE + HALF * cb * w,
        w,
    ]
    return np.array([*q, *v]).T


def run(
    h: float, n: int, *, differences: bool, scales: bool, fallback: bool = False, method: str = "inverse-bfgs"
) -> dict[str, Any]:
    """n steps, or as many as could be made; iterations and evaluations of each."""
    exact = truth(h * np.arange(n + 1))
    past = [exact[k] for k in (3, 2, 1, 0)]
    lam, inverse, counts = np.zeros(N[1]), None, []
    unit = np.r_[np.ones(6), np.ones(6) / h, MASS / h**2 * np.ones(5), np.ones(5) / h] if scales else np.ones(22)
    size = np.r_[np.ones(6) / h, M / h**2, np.ones(5), np.ones(5) / h] if scales else np.ones(22)
    for k in range(4, n + 1):
        t = h * k
        known = sum(c * y for c, y in zip(BDF4[1:], past, strict=True)) / h

        def residual(y: np.ndarray, t: float = t, known: np.ndarray = known) -> np.ndarray:
            q, v, lam, mu = np.split(y, [6, 12, 17])
            J = jacobian(q)
            rate = BDF4[0] / h * y[:12] + known
            drive = np.array([0, 0, -RATE, 0, 0])
            return np.r_[rate[:6] - v + J.T @ mu, M * rate[6:] + J.T @ lam - WEIGHT, rows(t, q), J @ v + drive]

        last = past[0]
        a = (last[6:] - past[1][6:]) / h
        guess = np.r_[last[:6] + h * last[6:] + h * h / 2 * a, last[6:] + h * a, lam, np.zeros(5)]
        # 1e-10 of the weight
        tol = 1e-10 * (1.0 if scales else MASS * GRAVITY)
        options: dict[str, Any] = {
            "maxiter": 200,
            "tol": tol,
            "x_scale": unit,
            "f_scale": size,
            "inverse0": inverse,
            "method": method,
        }
        options |= {"jac0": "fd"} if differences else {"jac0": "identity"}
        options |= {} if fallback else {"plain": True}
        with np.errstate(all="ignore"):
            sol = mb.root(residual, guess, **options)
        counts.append((sol.nit, sol.nfev))
        if not sol.success:
            break
        lam, inverse = sol.x[12:17], sol.inverse
        past = [sol.x[:12], *past[:3]]
    done = len(counts) if sol.success else len(counts) - 1
    error = abs(past[0][5] - exact[3 + done, 5])
    return {"steps": done, "asked": n - 3, "counts": np.array(counts), "error": error, "reason": sol.reason}


def main(where: Path | str) -> None:
    """Print how far each variant comes, draw evaluations over steps."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained", sharey=True)
    variants = {
        "the words alone": {"differences": False, "scales": False},
        "+ first H from differences": {"differences": True, "scales": False},
        "+ scales": {"differences": True, "scales": True},
        "+ scales, Broyden's update": {"differences": True, "scales": True, "method": "broyden"},
        "+ scales, restart, fallback": {"differences": True, "scales": True, "fallback": True},
    }
    table = []
    for ax, h in zip(axes, (1e-2, 1e-3), strict=True):
        for name, options in variants.items():
            made = run(h, 200, **options)
            nit, nfev = made["counts"][:, 0].mean(), made["counts"][:, 1].mean()
            end = (
                "all steps"
                if made["steps"] == made["asked"]
                else f"stops after {made['steps']} steps ({made['reason']})"
            )
            table.append(
                (
                    f"h = {h:g} s, {name}",
                    "the DAE is solved, results fit Adams",
                    f"{end}; {nit:.1f} iterations and {nfev:.1f} evaluations a step, angle off by {made['error']:.1e} rad",
                    "how H starts and when it is kept is not told",
                )
            )
            ax.semilogy(np.arange(1, len(made["counts"]) + 1), made["counts"][:, 1], ".-", label=name)
        ax.set(title=f"step {h:g} s", xlabel="step")
    axes[0].set_ylabel("evaluations of the equations")
    axes[1].legend(fontsize=8)
    told(table)
    save(figure, where, "solver_words.png")


if __name__ == "__main__":
    main(folder())
