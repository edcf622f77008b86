"""Multiblade coordinates: what the blades of a rotor do together, seen from the frame that does not turn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import complex_array, count, flag, names, real_array, real_number, shown
from ..errors import ModelError
from ..results import Result, quantity, result

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from .modal_result import ModalResult

__all__ = ["RotorModes", "multiblade", "rotor_modes"]
# Turn (rad) by which blades may be away from even spacing. Larger: the transformation is of another rotor. Smaller: azimuths with seven
# digits are refused.
_EVEN = 1e-6


def multiblade(values: ArrayLike, azimuth: ArrayLike, inverse: bool = False) -> np.ndarray:
    """Coleman's transformation: from one coordinate of every blade to collective, cosine and sine ones, or back.

        a_0 = sum_i q_i / N,   a_n = 2/N sum_i q_i cos(n psi_i),   b_n = 2/N sum_i q_i sin(n psi_i),
        a_d = sum_i q_i (-1)^i / N  (N even);   n = 1, ..., (N - 1) // 2

    Parameters
    ----------
    values
        (..., N): the coordinate of each blade (real or complex), at least two; with ``inverse`` the multiblade ones.
    azimuth
        (N,) or (..., N) rad: psi_i of each blade, evenly spaced. A turning rotor has psi_i(t) = psi_i(0) + speed t.
    inverse
        From multiblade coordinates to the blades': q_i = a_0 + sum_n a_n cos(n psi_i) + b_n sin(n psi_i) (+ (-1)^i a_d).

    Returns
    -------
    ndarray
        (..., N): a_0, a_1, b_1, a_2, b_2, ..., with a_d last for an even N; or q_i.

    Raises
    ------
    ModelError
        Shapes that do not fit, blades that are not evenly spaced.

    Notes
    -----
    Equations: docs/theory.md (8.4).
    R. P. Coleman and A. M. Feingold, NACA Report 1351 (1958). Cost O(N^2) per set.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> psi = 2 * np.pi / 3 * np.arange(3) + 0.4
    >>> np.round(mb.multiblade(1.0 + 0.5 * np.sin(psi), psi), 12)
    array([1. , 0. , 0.5])
    """
    q, psi = complex_array("multiblade: values", values), real_array("multiblade: azimuth", azimuth)
    q = q if np.iscomplexobj(np.asarray(values)) else q.real
    if q.ndim == 0 or q.shape[-1] < 2:
        raise ModelError(f"multiblade: values must end in the number of blades, at least 2; got shape {q.shape}")
    n = q.shape[-1]
    if psi.ndim == 0 or psi.shape[-1] != n:
        raise ModelError(f"multiblade: azimuth must end in the number of blades, {n}; got shape {psi.shape}")
    spacing = np.diff(psi, axis=-1) - 2 * np.pi / n
    if np.max(np.abs(np.exp(1j * spacing) - 1), initial=0.0) > _EVEN:
        raise ModelError(f"multiblade: the blades must be evenly spaced, 2 pi / {n} apart in the order given")
    columns = [np.ones(psi.shape)]
    for harmonic in range(1, (n - 1) // 2 + 1):
        columns += [np.cos(harmonic * psi), np.sin(harmonic * psi)]
    if n % 2 == 0:
        columns.append(np.broadcast_to((-1.0) ** np.arange(n), psi.shape))
    back = np.stack(columns, axis=-1)  # q = back a
    if flag("multiblade: inverse", inverse):
        return np.asarray(np.einsum("...ij,...j->...i", back, q))
    weight = np.full(n, 2.0 / n)
    weight[0] = 1.0 / n
    if n % 2 == 0:
        weight[-1] = 1.0 / n
    return np.asarray(np.einsum("...ij,...i->...j", back, q) * weight)


@result
class RotorModes(Result):
    """Modes of a rotor sorted by what its blades do together.

    ``frequency`` (n,) Hz in the turning frame, ``fixed`` (n,) Hz as a fixed observer sees them; ``family``: "collective",
    "forward", "backward" whirl, "reactionless" (patterns that four or more blades have), or "hub" where no blade moves;
    ``share`` (n, N) squares of the patterns' amplitudes, collective first, their sum one; ``coordinate`` the
    blade coordinate that moves most.
    """

    frequency: np.ndarray = quantity(dims=("mode",), unit="Hz")
    fixed: np.ndarray = quantity(dims=("mode",), unit="Hz", label="frequency seen by a fixed observer")
    family: tuple[str, ...] = quantity(dims=("mode",))
    share: np.ndarray = quantity(dims=("mode", "pattern"), unit="1")
    coordinate: tuple[int, ...] = quantity(dims=("mode",))

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {"mode": "numbers"}

    @property
    def numbers(self) -> np.ndarray:
        """(n,) modes counted from 1."""
        return np.arange(1, len(self.frequency) + 1)

    def heading(self) -> str:
        return f"{len(self.frequency)} modes of a rotor of {self.share.shape[1]} blades"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table."""
        each = zip(self.frequency, self.fixed, self.family, self.share, self.coordinate, strict=True)
        rows = [
            [i + 1, float(f), float(g), kind, float(share.max()), f"q{k + 1}"]
            for i, (f, g, kind, share, k) in enumerate(each)
        ]
        return ["mode", "f turning [Hz]", "f fixed [Hz]", "family", "share", "blade moves"], rows

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Frequencies as a fixed observer sees them, coloured by family; returns the figure."""
        from ..plot.matrices import rotor_modes as draw

        return draw(self, ax=ax)


def rotor_modes(modes: ModalResult, blades: Sequence[str], speed: float) -> RotorModes:
    """Symmetric and antisymmetric modes of a rotor of equal blades, from modes in the frame that turns with it.

        c_p = sum_i phi_i exp(-2 pi i p i / N) / N;   p = 0 collective, c_-1 forward, c_1 backward

    Parameters
    ----------
    modes
        A `ModalResult` about a steady motion (or standstill), its coordinates the modal coordinates of the blades among
        others.
    blades
        Names of the flexible bodies, in the order in which they stand around the axis in the sense of the rotation.
    speed
        rad/s: of the rotor. A pattern p of frequency f turns in the fixed frame at f + speed/2pi (forward) or
        f - speed/2pi (backward, its magnitude given).

    Returns
    -------
    RotorModes
        In the order of ``modes``, rigid modes included.

    Raises
    ------
    ModelError
        Blades that are not in the modes, or not alike; fewer than two.

    Notes
    -----
    Equations: docs/theory.md (8.2), (8.4).
    phi exp(i omega t) with phi_i growing in phase from blade to blade by -2 pi/N is a wave that runs with the rotation: blade
    i + 1, 2 pi/N further round, moves later. At standstill forward and backward patterns of one frequency mix freely. Cost
    O(n N m).

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.rotor_modes(mb.modes(mb.examples.rotor()), ["a"], 1.0)
    Traceback (most recent call last):
    mbrs.errors.ModelError: rotor_modes: a rotor has at least two blades, got ('a',)
    """
    chosen = names("rotor_modes: blades", blades)
    if len(chosen) < 2:
        raise ModelError(f"rotor_modes: a rotor has at least two blades, got {shown(chosen)}")
    rate = real_number("rotor_modes: speed", speed)
    coordinates = list(modes.coordinates)
    sizes = {name: sum(c.startswith(f"{name}.q") for c in coordinates) for name in chosen}
    if min(sizes.values()) == 0 or len(set(sizes.values())) != 1:
        raise ModelError(
            f"rotor_modes: the blades must be flexible bodies with equally many modes, got {shown(sizes)}; the coordinates are "
            f"{', '.join(coordinates[:12])}"
        )
    m = count("modes of a blade", sizes[chosen[0]], 10000)
    places = [[coordinates.index(f"{name}.q{k + 1}") for k in range(m)] for name in chosen]
    return _sorted(np.asarray(modes.shape), np.asarray(modes.eigenvalue), places, float(rate) / (2 * np.pi))


_STILL = 1e-9


def _sorted(shape: np.ndarray, s: np.ndarray, places: list[list[int]], turns: float) -> RotorModes:
    phi = shape[np.array(places)]  # (N, m, n)
    n_blades = len(places)
    patterns = np.fft.fft(phi, axis=0) / n_blades  # p: exp(-2 pi i p i / N)
    power = np.sum(np.abs(patterns) ** 2, axis=1)  # (N, n)
    total = power.sum(axis=0)
    moving = total > _STILL**2 * np.sum(np.abs(shape) ** 2, axis=0)
    share = np.where(moving, power / np.where(moving, total, 1.0), 0.0).T
    frequency = np.abs(s.imag) / (2 * np.pi)
    family, fixed = [], frequency.copy()
    for i, moves in enumerate(moving):
        p = int(np.argmax(share[i]))
        if not moves:
            family.append("hub")
        elif p == 0:
            family.append("collective")
        elif p in (1, n_blades - 1) and n_blades > 2:
            # exp(-2 pi i / N) from blade to blade runs forward: pattern N - 1
            forward = p == n_blades - 1
            family.append("forward" if forward else "backward")
            fixed[i] = abs(frequency[i] + (turns if forward else -turns))
        else:
            family.append("reactionless")
    most = np.argmax(np.sum(np.abs(phi) ** 2, axis=0), axis=0)
    return RotorModes(frequency, fixed, tuple(family), share, tuple(int(k) for k in most))
