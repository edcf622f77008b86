"""Eigenvalues of long chains of lateral hinges to forty digits: the yardstick for the sparse modes.

n rigid links of length h hang on each other by hinges with rotational springs, the first one on ground. With the lateral
displacements w of the hinges, link i moves by (w_{i-1} + w_i)/2 and turns by (w_i - w_{i-1})/h, so that M has three
diagonals and K five; inverse iteration from a double precision value then converges within two steps.
"""

from __future__ import annotations

from decimal import Decimal, localcontext

DIGITS = 40
TINY = Decimal("1e-35")
Band = list[list[Decimal]]


def refined(n: int, omega: float, mass: float, inertia: float, length: float, stiffness: float) -> float:
    """The eigenfrequency (rad/s) next to ``omega``. O(n) operations of forty digits."""
    with localcontext() as context:
        context.prec = DIGITS
        m, k = _matrices(n, *map(Decimal, (mass, inertia, length, stiffness)))
        square = Decimal(omega) ** 2
        x = [Decimal(1 + i % 7) for i in range(n)]
        for _ in range(3):
            shifted = [[a - square * b for a, b in zip(*rows, strict=True)] for rows in zip(k, m, strict=True)]
            x = _solve(shifted, _times(m, x))
            size = _dot(x, x).sqrt()
            x = [v / size for v in x]
            square = _dot(x, _times(k, x)) / _dot(x, _times(m, x))
        return float(square.sqrt())


def _matrices(n: int, mass: Decimal, inertia: Decimal, length: Decimal, stiffness: Decimal) -> tuple[Band, Band]:
    """Lower bands of M and K: entry d of row i stands in column i - d."""
    zero = Decimal(0)
    m, k = ([[zero] * 3 for _ in range(n)] for _ in range(2))
    near, far = mass / 4 + inertia / length**2, mass / 4 - inertia / length**2
    bend = stiffness / length**2
    for i in range(n):
        m[i][0] = 2 * near if i < n - 1 else near
        m[i][1] = far if i else zero
        # One hinge after the other: its angle is (w_{i-2} - 2 w_{i-1} + w_i)/h.
        for a, weight_a in ((0, 1), (1, -2), (2, 1)):
            for b, weight_b in ((0, 1), (1, -2), (2, 1)):
                if b >= a and i - b >= 0:
                    k[i - a][b - a] += bend * weight_a * weight_b
    return m, k


def _times(a: Band, x: list[Decimal]) -> list[Decimal]:
    out = [row[0] * v for row, v in zip(a, x, strict=True)]
    for i, row in enumerate(a):
        for d in range(1, min(3, i + 1)):
            out[i] += row[d] * x[i - d]
            out[i - d] += row[d] * x[i]
    return out


def _dot(x: list[Decimal], y: list[Decimal]) -> Decimal:
    return sum((a * b for a, b in zip(x, y, strict=True)), Decimal(0))


def _solve(a: Band, b: list[Decimal]) -> list[Decimal]:
    """L D L^T without pivoting: forty digits forgive the small pivots of a shift next to an eigenvalue."""
    n, x = len(a), list(b)
    diagonal, one, two = [Decimal(0)] * n, [Decimal(0)] * n, [Decimal(0)] * n
    for i, row in enumerate(a):
        second = row[2] if i > 1 else Decimal(0)
        first = row[1] - second * one[i - 1] if i > 0 else Decimal(0)
        diagonal[i] = row[0]
        if i > 1:
            two[i] = second / diagonal[i - 2]
            diagonal[i] -= second * two[i]
            x[i] -= two[i] * x[i - 2]
        if i > 0:
            one[i] = first / diagonal[i - 1]
            diagonal[i] -= first * one[i]
            x[i] -= one[i] * x[i - 1]
    # A shift that hits an eigenvalue to all digits leaves a zero pivot: any tiny one gives the eigenvector.
    x = [v / (d or TINY) for v, d in zip(x, diagonal, strict=True)]
    for i in range(n - 1, -1, -1):
        if i + 1 < n:
            x[i] -= one[i + 1] * x[i + 1]
        if i + 2 < n:
            x[i] -= two[i + 2] * x[i + 2]
    return x
