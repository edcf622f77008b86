"""The sensitivity of a rigid multibody system to a design variable matrix (Zhang, Chen and Liu 1994), equation by
equation.

A pendulum on a spring-loaded slide, A(V, q) q'' = B(V, q, q', t), V of shape (2, 2): masses, length and stiffness.
Equations (12) to (16) of the text by `mb.matrix_calculus.rigid` beside central differences of the motion.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mbrs import matrix_calculus as mc
from said import folder, save, told

V = np.array([[2.3, 0.7], [0.9, 31.0]])  # cart, bob (kg); length (m), stiffness (N/m)
GRAVITY, STEP, COUNT = 9.81, 5e-3, 400


def mass(V: np.ndarray, q: np.ndarray, t: float) -> np.ndarray:
    """A(V, q): slide and angle of a cart with a pendulum."""
    (cart, bob), (length, _) = V
    c = bob * length * np.cos(q[1])
    return np.array([[cart + bob, c], [c, bob * length**2]])


def force(V: np.ndarray, q: np.ndarray, v: np.ndarray, t: float) -> np.ndarray:
    """B(V, q, q', t)."""
    (_, bob), (length, k) = V
    s = np.sin(q[1])
    return np.array([bob * length * s * v[1] ** 2 - k * q[0], -bob * GRAVITY * length * s])


def start(V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The angle at the start depends on the length, which the text does not allow for."""
    return np.array([0.11 + 0 * V[0, 0], 0.4 / V[1, 0]]), np.array([0.2, -0.3]) + 0 * V[0, 0]


def main(where: Path | str) -> None:
    """Print distances, draw Dq/DV."""
    form = mc.rigid(mass, force)
    q, Dq = (np.array(x) for x in form.integrate(V, start, STEP, COUNT))
    by_entry = np.array([mc.entries(d, (2, 2))[:, 0] for d in Dq])  # (times, coordinates, 2, 2)
    differences = np.empty_like(by_entry)
    for i, j in np.ndindex(2, 2):
        h = 1e-6 * V[i, j]
        side = [
            np.array(form.integrate(V + s * h * np.eye(2)[[i]].T @ np.eye(2)[[j]], start, STEP, COUNT)[0])
            for s in (1, -1)
        ]
        differences[:, :, i, j] = (side[0] - side[1]) / (2 * h)
    gap = np.abs(by_entry - differences).max() / np.abs(differences).max()
    rng = np.random.default_rng(2)
    A, B = rng.normal(size=(2, 3)), rng.normal(size=(4, 2))
    U, W = mc.permutation(2, 4), mc.permutation(2, 3)
    swapped = np.abs(mc.kron(A, B) - U @ mc.kron(B, A) @ W).max()
    told([
        ("(2), (3): A kron C = U (C kron A) U", "permutation matrices", f"off by {swapped:.0e}", ""),
        (
            "(12) to (16): Dq/DV of shape (n s, t)", "formulae, no example",
            f"{Dq.shape[1:]} blocks; {gap:.0e} from central differences of the motion", "the text computes no example",
        ),
    ])  # fmt: skip
    t = STEP * np.arange(COUNT + 1)
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    axes[0].plot(t, q, label=["slide [m]", "angle [rad]"])
    axes[0].set_title("motion q(t)")
    names = ("cart", "bob", "length", "stiffness")
    for ax, k, what in zip(axes[1:], range(2), ("slide", "angle"), strict=True):
        for (i, j), name in zip(np.ndindex(2, 2), names, strict=True):
            ax.plot(t, V[i, j] * by_entry[:, k, i, j], label=name)
            ax.plot(t[::25], V[i, j] * differences[::25, k, i, j], "k.", ms=4)
        ax.set_title(f"D({what})/DV, times V; dots: differences")
    for ax in axes:
        ax.legend(fontsize=8)
        ax.set_xlabel("t [s]")
    save(figure, where, "design_matrix.png")


if __name__ == "__main__":
    main(folder())
