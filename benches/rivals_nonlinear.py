"""Duffing's oscillator in programs that install with pip: x" + C x' + x + K3 x^3 = F cos(omega t), omega from W0 to W1.

Each function prepares a run of H harmonics and returns a function that does it and returns the points: omega (n,) and the
complex amplitudes a - i b (n, H+1) of x. ImportError means: not installed.
"""

from __future__ import annotations

import contextlib
import io
import logging
import tempfile
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

C, K3, F, W0, W1 = 0.05, 1.0, 0.3, 0.8, 3.0
Points = tuple[np.ndarray, np.ndarray]


@contextlib.contextmanager
def elsewhere() -> Iterator[None]:
    """A directory that is thrown away: PyHarm leaves files where it runs."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        yield


def pyharm(H: int) -> Callable[[], Points]:
    """PyHarm: continuation by arc length, 32 samples or more."""
    samples = max(32, 1 << int(np.ceil(np.log2(4 * H + 1))))
    return pyharm_sweep(H, samples, {"type": "CubicSpring", "k": K3}, C, F, (W0, W1), 0.05)


def pyharm_sweep(
    H: int,
    samples: int,
    element: dict[str, Any],
    damping: float,
    force: float,
    span: tuple[float, float],
    largest: float,
) -> Callable[[], Points]:
    """PyHarm: x" + damping x' + x + element = force cos(omega t) over a span of omega, with steps of at most ``largest``."""
    logging.disable(logging.CRITICAL)
    with elsewhere():
        from pyHarm.Maestro import Maestro

    one = np.ones((1, 1))
    to_ground = {"connect": {"s": [0], "GROUND": [0]}, "dirs": [0]}
    analysis = {"study": "frf", "puls_inf": span[0], "puls_sup": span[1], "puls_start": span[0], "ds0": largest / 5,
                "ds_max": largest, "ds_min": 1e-8, "sign_ds": 1, "verbose": False, "predictor": "tangent",
                "corrector": "arc_length", "solver": "scipyroot"}  # fmt: skip
    problem = {
        "system": {"type": "Base", "nh": H, "nti": samples, "adim": {"status": False}},
        "substructures": {
            "s": {"type": "substructure", "ndofs": 1, "matrix": {"M": one, "C": damping * one, "K": one}}
        },
        "connectors": {
            "law": {**element, **to_ground},
            "force": {"type": "CosinusForcing", "connect": {"s": [0]}, "dirs": [0], "amp": force},
        },
        "analysis": {"FRF": analysis},
    }

    def run() -> Points:
        with elsewhere(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numba's remarks on the layout of its arrays
            master = Maestro(problem)
            master.operate()
        solutions = [s.x for s in master.nls["FRF"].SolList if s.flag_accepted]
        table = master.system.expl_dofs
        X = np.zeros((len(solutions), H + 1), complex)
        for part, factor in (("c", 1.0), ("s", -1j)):
            rows = table[table["cs"] == part]
            X[:, rows["harm"].to_numpy()] += factor * np.array([x[rows.index.to_numpy()] for x in solutions])
        return np.array([x[-1] for x in solutions]), X

    return run


def harmonicbalance(H: int) -> Callable[[], Points]:
    """harmonicbalance: its predictor-corrector solver. Its d/dt has the sign of time reversed: b is turned back."""
    from harmonicbalance.fourier import Fourier
    from harmonicbalance.predictorcorrector import PredictorCorrectorSolver

    def residual(x: Any) -> Any:
        force = Fourier(omega=x.omega, n=H)
        force[1] = 1
        return x.dt().dt() + C * x.dt() + x + K3 * x**3 - F * force

    def run() -> Points:
        unit = Fourier(omega=W0, n=H)
        unit[1] = 1
        axis = complex(unit.coeffs_cos[0], -unit.coeffs_sin[0])
        solver = PredictorCorrectorSolver(
            residual, unit, alpha_start=W0, alpha_end=W1, alpha_step=0.05, use_jac=True, method="hybr"
        )
        with contextlib.redirect_stdout(io.StringIO()):
            solver.solve()
        omega = np.array([x.omega for x in solver.solutions])
        c = np.array(
            [np.append(x.coeff_dc, np.asarray(x.coeffs_cos) - 1j * np.asarray(x.coeffs_sin)) for x in solver.solutions]
        )
        h = np.arange(H + 1)
        # the phase of its own force, and time reversed
        return omega, np.conj(c * np.exp(-1j * h * np.angle(axis)))

    return run


def mousai(H: int) -> Callable[[], Points]:
    """mousai: no continuation, so a sweep of the upper branch as far as the fold lets it."""
    import mousai as ms
    from scipy.optimize import NoConvergence

    def rate(x: Any, v: Any, given: dict[str, Any]) -> np.ndarray:
        push = F * np.cos(given["omega"] * given["cur_time"])
        return np.array([[-x[0] - K3 * x[0] ** 3 - C * v[0] + push]])

    def run() -> Points:
        x = 0.5 * np.cos(2 * np.pi * np.arange(2 * H + 1) / (2 * H + 1))[None, :]
        omegas, coefficients = [], []
        for omega in np.arange(W0, 2.35, 0.02):
            try:
                with contextlib.redirect_stdout(io.StringIO()):
                    _, x, *_ = ms.hb_freq(
                        rate, x, omega=omega, num_harmonics=H, f_tol=1e-9, num_time_steps=max(51, 4 * H + 1),
                        mask_constant=False,
                    )  # fmt: skip
            except NoConvergence:
                break
            c = np.fft.rfft(x[0]) / x.shape[1]
            row = np.zeros(H + 1, complex)
            row[: min(H + 1, len(c))] = c[: H + 1]
            row[1:] *= 2
            omegas.append(omega)
            coefficients.append(row)
        return np.array(omegas), np.array(coefficients)

    return run


RIVALS: dict[str, Callable[[int], Callable[[], Points]]] = {
    "PyHarm": pyharm,
    "harmonicbalance": harmonicbalance,
    "mousai": mousai,
}


def chain(n: int) -> tuple[Any, Any, Any, int, float]:
    """n masses in a row between walls, the first natural frequency 1, its damping ratio 0.01: sparse M, C, K, the middle,
    and the stiffness that the first mode shows there. Invented; the same for every program."""
    import scipy.sparse as sp

    scale = 1.0 / (4 * np.sin(np.pi / (2 * (n + 1))) ** 2)
    K = scale * sp.diags([2 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1], format="csc")
    M = sp.identity(n, format="csc")
    return M, (0.01 * M + 0.01 * K).tocsc(), K, n // 2, (n + 1) / 2.0


def pyharm_chain(n: int, points: int) -> Callable[[], float]:
    """A chain with one cubic spring in PyHarm, condensed by its own reductor; returns CPU seconds per point."""
    logging.disable(logging.CRITICAL)
    import time

    with elsewhere():
        from pyHarm.Maestro import Maestro

    M, damping, K, middle, stiffness = chain(n)
    step = 0.01 * np.sqrt(n)
    analysis = {"study": "frf", "puls_inf": 0.8, "puls_sup": 1.3, "puls_start": 0.8, "ds0": step, "ds_max": 3 * step,
                "ds_min": 1e-7, "sign_ds": 1, "verbose": False, "predictor": "tangent", "corrector": "arc_length",
                "solver": "NewtonRaphson", "solver_options": {"max_iter": 20}, "reductors": [{"type": "NLdofs"}]}  # fmt: skip
    dense = {name: A.toarray() for name, A in (("M", M), ("C", damping), ("K", K))}
    problem = {
        "system": {"type": "Base", "nh": 7, "nti": 128, "adim": {"status": False}},
        "substructures": {"s": {"type": "substructure", "ndofs": 1, "matrix": dense}},
        "connectors": {
            "spring": {
                "type": "CubicSpring",
                "k": 0.2 * stiffness,
                "connect": {"s": [middle], "GROUND": [0]},
                "dirs": [0],
            },
            "force": {"type": "CosinusForcing", "connect": {"s": [middle]}, "dirs": [0], "amp": 0.02 * stiffness},
        },
        "analysis": {"FRF": analysis},
    }

    def run() -> float:
        with elsewhere():
            master = Maestro(problem)
        study = master.nls["FRF"]
        study.initialise(None)
        begin = time.process_time()
        for i in range(1, points + 1):
            study.makeStep(index_insolve=i)
            study.purge_jacobians()
        return (time.process_time() - begin) / points

    return run
