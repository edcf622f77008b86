"""One iteration of the alternating method opened: coefficients -> samples -> force -> coefficients, for one and two
frequencies (Sarrouy and Sinou 2011, sections 2 and 3).

x(t) of given coefficients is sampled (inverse FFT), the force f = k3 x^3 is evaluated sample by sample, and a FFT, in p
dimensions of hyper-time for p frequencies, gives its coefficients. Beside them the exact product of the series, by
convolution.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from matplotlib.colors import CenteredNorm
from said import folder, save, told


def alternated(c: np.ndarray, samples: int) -> np.ndarray:
    """Coefficients of x^3, of the size of those of x: c holds complex coefficients at the harmonics -m .. m along every axis."""
    p, m = c.ndim, (c.shape[0] - 1) // 2
    grid = np.zeros((samples,) * p, dtype=complex)
    grid[np.ix_(*[np.arange(-m, m + 1)] * p)] = c
    x = np.fft.ifftn(grid * samples**p).real
    return np.fft.fftn(x**3)[np.ix_(*[np.arange(-m, m + 1)] * p)] / samples**p


def convolved(c: np.ndarray) -> np.ndarray:
    """The same by the product of the series."""
    from scipy.signal import convolve

    m = (c.shape[0] - 1) // 2
    full = convolve(convolve(c, c, method="direct"), c, method="direct")
    return full[(slice(2 * m, 4 * m + 1),) * c.ndim]


def real_series(rng: np.random.Generator, p: int, m: int) -> np.ndarray:
    """Random coefficients of a real function that fall with the order."""
    order = np.indices((2 * m + 1,) * p) - m
    c = (rng.normal(size=order[0].shape) + 1j * rng.normal(size=order[0].shape)) * 0.4 ** np.abs(order).sum(axis=0)
    return (c + np.conj(np.flip(c))) / 2


def main(where: Path | str) -> None:
    """Print errors over samples and a step of each balance, draw the samples of both."""
    rng, rows = np.random.default_rng(4), []
    errors = {}
    for p, m in ((1, 7), (2, 5)):
        c = real_series(rng, p, m)
        exact = convolved(c)
        errors[p] = {
            n: float(np.abs(alternated(c, n) - exact).max() / np.abs(exact).max())
            for n in (2 * m + 2, 3 * m + 1, 4 * m + 1, 8 * m)
        }
        told_ = ", ".join(f"{n} samples {e:.0e}" for n, e in errors[p].items())
        rows.append(
            (f"p = {p}, m = {m}: FFT of f against the product of the series", "IFFT, f at each instant, FFT", told_, "")
        )
    duffing = mb.examples.duffing()
    one = mb.harmonic_balance(duffing, force=[0.18], omega=1.0, harmonics=7)
    system, forces = mb.examples.two_tone_duffing(2.0)
    two = mb.quasi_periodic(system, forces, harmonics=7)
    rows.append(
        (
            "a whole balance, p = 1",
            "n (2m + 1) unknowns",
            f"{one.X.size} unknowns, {one.stats.counts.get('iterations', '-')} iterations, a1 = {one.amplitude():.8f}",
            "the text has no example",
        )
    )
    rows.append(
        (
            "a whole balance, p = 2",
            "index set of Kim and Choi",
            f"{len(two.indices)} indices, {two.X.size} unknowns",
            "the text has no example",
        )
    )
    told(rows)

    figure, axes = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    c = real_series(rng, 1, 3)
    t = np.linspace(0, 1, 33)[:-1]
    x = (np.exp(2j * np.pi * np.outer(t, np.arange(-3, 4))) @ c).real
    axes[0].plot(t, x, "o-", ms=3, label="x from 7 coefficients")
    axes[0].plot(t, x**3, "s-", ms=3, label="f = x^3, sample by sample")
    axes[0].set(xlabel="t / T", title="one frequency")
    axes[0].legend(fontsize=8)
    c = real_series(rng, 2, 3)
    grid = np.zeros((48, 48), dtype=complex)
    grid[np.ix_(np.arange(-3, 4), np.arange(-3, 4))] = c
    drawn = axes[1].imshow(
        (np.fft.ifftn(grid * 48**2).real) ** 3, origin="lower", extent=(0, 1, 0, 1), cmap="RdBu", norm=CenteredNorm()
    )
    figure.colorbar(drawn, ax=axes[1], label="f = x^3")
    axes[1].set(xlabel="t1 / T1", ylabel="t2 / T2", title="two frequencies: f in hyper-time")
    for p, found in errors.items():
        axes[2].semilogy(list(found), [max(e, 1e-17) for e in found.values()], "o-", label=f"p = {p}")
    axes[2].set(
        xlabel="samples along each time", ylabel="largest relative error of f", title="aliasing ends at 4 m + 1 (cubic)"
    )
    axes[2].legend()
    save(figure, where, "alternating.png")


if __name__ == "__main__":
    main(folder())
