"""Values with their first and second derivative along one motion (or along many directions), by the product rule.

A jet holds [value, first, second] derivative (not divided by factorials); None means zero. Vectors are rows (k,
3) and frames (3, 3); a first-order jet along m directions has a leading axis m in its derivative, so every operation
must broadcast over it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import comb
from typing import Any

import numpy as np

from .so3 import Array, skew
from .so3 import cross as vector_product


class Jet:
    """A value and its derivatives up to ``order``."""

    __array_ufunc__ = None  # let `array * jet` reach __rmul__

    def __init__(self, *c: Array | None) -> None:
        self.c = list(c)

    @property
    def order(self) -> int:
        return len(self.c) - 1

    @property
    def value(self) -> Array:
        assert self.c[0] is not None
        return self.c[0]

    def derivative(self, k: int = 1) -> Array:
        """The k-th derivative, zeros of the value's shape where there is none."""
        d = self.c[k]
        return np.zeros_like(self.value) if d is None else d

    def derivative_along(self, m: int) -> Array:
        """The first derivative along m directions, (m, ...)."""
        return (
            np.zeros((m, *self.value.shape))
            if self.c[1] is None
            else np.broadcast_to(self.c[1], (m, *self.value.shape))
        )

    def map(self, f: Callable[[Array], Array]) -> Jet:
        """A linear function of the jet."""
        return Jet(*(None if c is None else f(c) for c in self.c))

    def __add__(self, other: Any) -> Jet:
        b = jet(other)
        n = min(self.order, b.order)
        return Jet(*(_total([x, y]) for x, y in zip(self.c[: n + 1], b.c[: n + 1], strict=True)))

    def __radd__(self, other: Any) -> Jet:
        return self + other

    def __neg__(self) -> Jet:
        return self.map(lambda c: -c)

    def __sub__(self, other: Any) -> Jet:
        return self + -jet(other)

    def __rsub__(self, other: Any) -> Jet:
        return jet(other) + -self

    def __mul__(self, other: Any) -> Jet:
        return product(np.multiply, self, other)

    __rmul__ = __mul__

    def __matmul__(self, other: Any) -> Jet:
        return product(np.matmul, self, other)

    def __rmatmul__(self, other: Any) -> Jet:
        return product(np.matmul, other, self)

    @property
    def T(self) -> Jet:
        return self.map(lambda c: np.swapaxes(c, -1, -2))


def jet(a: Any) -> Jet:
    """A constant, if it is not a jet already."""
    return a if isinstance(a, Jet) else Jet(np.asarray(a), None, None)


def _total(terms: Sequence[Array | None]) -> Array | None:
    present = [t for t in terms if t is not None]
    return sum(present[1:], present[0]) if present else None


def product(f: Callable[[Array, Array], Array], a: Any, b: Any) -> Jet:
    """Leibniz' rule for a bilinear f."""
    x, y = jet(a).c, jet(b).c
    out = []
    for k in range(min(len(x), len(y))):
        pairs = [(comb(k, j), x[j], y[k - j]) for j in range(k + 1)]
        out.append(_total([n * f(u, v) if n > 1 else f(u, v) for n, u, v in pairs if u is not None and v is not None]))
    return Jet(*out)


def cross(a: Any, b: Any) -> Jet:
    """Cross product of rows."""
    return product(vector_product, a, b)


def dot(a: Any, b: Any) -> Jet:
    """Scalar product of rows, kept as (..., k, 1)."""
    return product(lambda x, y: np.sum(x * y, axis=-1, keepdims=True), a, b)


def power(a: Jet, p: float) -> Jet:
    """a**p of a scalar jet."""
    x = a.value
    return compose(a, x**p, p * x ** (p - 1), p * (p - 1) * x ** (p - 2))


def compose(a: Jet, f: Array, df: Array, ddf: Array | None = None) -> Jet:
    """f(a) of a scalar jet, from the value and derivatives of f at a; without ``ddf`` at most first order."""
    out: list[Array | None] = [f]
    if a.order >= 1:
        out.append(None if a.c[1] is None else df * a.c[1])
    if a.order >= 2:
        if ddf is None:
            raise ValueError("this function of a jet knows its first derivative only")
        out.append(_total([None if a.c[2] is None else df * a.c[2], None if a.c[1] is None else ddf * a.c[1] * a.c[1]]))
    return Jet(*out)


def entry(a: Jet, i: int, j: int) -> Jet:
    """One entry of a matrix jet as a (..., 1, 1) scalar."""
    return a.map(lambda c: c[..., i : i + 1, j : j + 1])


def column(a: Jet, j: int) -> Jet:
    """Column j of a matrix jet as a row."""
    return a.map(lambda c: np.swapaxes(c[..., :, j : j + 1], -1, -2))


def cross_matrix(a: Jet) -> Jet:
    """[a]x of a row."""
    return a.map(lambda c: skew(c[..., 0, :]))


def stack(rows: Sequence[Jet]) -> Jet:
    """Rows (k_i, n) one above the other."""
    if not rows:
        return jet(np.zeros((0, 6)))
    out: list[Array | None] = []
    for k in range(min(r.order for r in rows) + 1):
        present = [c.shape[:-2] for r in rows if (c := r.c[k]) is not None]
        if not present:
            out.append(None)
            continue
        lead = np.broadcast_shapes(*present)
        parts = [r.value if k == 0 else r.derivative(k) for r in rows]
        out.append(np.concatenate([np.broadcast_to(p, (*lead, *p.shape[-2:])) for p in parts], axis=-2))
    return Jet(*out)
