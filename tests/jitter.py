"""Noise of 1e-13 on the numbers of every model, so that no test hangs on the last bit of one machine.

With the environment variable ``MBRS_JITTER=<seed>``, `conftest` puts `jittered` in the place of `mbrs.system.tables.x`, through which
all numbers of a model go to the core and to the reference: each is multiplied by 1 + 1e-13 r, r normal and clipped to
[-3, 3]. Zeros stay zero. Integers (types, flags, counts) lie elsewhere, but for the order of a `VaryingStiffness`, which
stays. Square matrices of stiffness and damping keep their symmetry, which is structure. Quaternions go off unity, and axes
off their direction, by as much as the noise: the reader normalises both. The parts of a model that were drawn alike, such as
the two points of a joint or the two ends of a door, differ by the noise.

The noise of a number depends on the seed, its place in the vector and the length of that vector, not on its value: the same
model has the same noise in a whole run, and so has the model after one of its values was changed, so that differences of two
values of a parameter are as clean as without. What reads `Model` itself, another process and what was compiled before the
fixture have no noise.
"""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np
from mbrs.system import tables

SIZE = 1e-13
CLIP = 3.0
LARGEST = 1e300  # numbers beyond it might overflow

_BUSHING = 1
_VARYING_STIFFNESS = 11

exact_numbers = tables.x


def seed() -> int | None:
    """That of this run, None where there is no jitter."""
    given = os.environ.get("MBRS_JITTER", "")
    return int(given) if given else None


def level() -> float:
    """What an assertion allows more: this times the condition of the answer. 0 where there is no jitter."""
    return 0.0 if seed() is None else CLIP * SIZE


def jittered(model) -> np.ndarray:
    """What `mbrs.system.tables.x` returns, with noise."""
    x = exact_numbers(model)
    structure = tables._structure(model)
    factor = 1.0 + SIZE * _noise(seed(), len(x))
    for start, n in _matrices(structure):
        block = factor[start : start + n * n].reshape(n, n)
        block[...] = np.tril(block) + np.tril(block, -1).T
    for start, m in _second_moments(structure):
        block = factor[start : start + 9 * m * m].reshape(m, m, 3, 3)
        block[...] = 0.5 * (block + block.transpose(1, 0, 3, 2))
    for kind, start in zip(structure["law_type"], structure["law_x"], strict=True):
        if kind == _VARYING_STIFFNESS:
            factor[start + 1] = 1.0
    factor[np.abs(x) > LARGEST] = 1.0
    return x * factor


@lru_cache
def _noise(seed: int, n: int) -> np.ndarray:
    return np.clip(np.random.default_rng([seed, n]).normal(size=n), -CLIP, CLIP)


def _matrices(structure):
    """Start and size of the square matrices among the numbers: of bushings, and of flexible bodies K, C and KG."""
    for kind, start in zip(structure["element_type"], structure["element_x"], strict=True):
        if kind == _BUSHING:
            yield from ((start + 10, 6), (start + 46, 6))
    for m, start in zip(structure.get("flexible_modes", ()), structure.get("flexible_x", ()), strict=True):
        first = start + 12 * m + 9 * m * m
        yield from ((first + i * m * m, m) for i in range(14))


def _second_moments(structure):
    """Start of P2 of flexible bodies and their number of modes: P2_kl is the transpose of P2_lk."""
    for m, start in zip(structure.get("flexible_modes", ()), structure.get("flexible_x", ()), strict=True):
        yield start + 12 * m, m
