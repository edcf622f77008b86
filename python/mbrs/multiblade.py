"""Multiblade coordinates: what the blades of a rotor do together, seen from the frame that does not turn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ._border import core_errors
from ._checks import complex_array, count, flag, names, real_array, shown
from .errors import ModelError
from .results import Result, quantity, result

if TYPE_CHECKING:
    from .turning_frames import Tangent, Turn

__all__ = ["RotorModes", "multiblade", "rotor_modes"]


def multiblade(values: Any, azimuth: Any, inverse: bool = False) -> np.ndarray:
    """Coleman's transformation: from one coordinate of every blade to collective, cosine and sine ones, or back.

        a_0 = sum_i q_i / N,   a_n = 2/N sum_i q_i cos(n psi_i),   b_n = 2/N sum_i q_i sin(n psi_i),
        a_d = sum_i q_i (-1)^i / N  (N even);   n = 1, ..., (N - 1) // 2

    Parameters
    ----------
    values
        (..., N): the coordinate of each blade (real or complex), at least two; with ``inverse`` the multiblade ones.
    azimuth
        (N,) or (..., N) rad: psi_i of each blade, evenly spaced. Of a rotor that turns psi_i(t) = psi_i(0) + speed t.
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
    if np.max(np.abs(np.exp(1j * spacing) - 1), initial=0.0) > 1e-6:
        raise ModelError(f"multiblade: the blades must be evenly spaced, 2 pi / {n} apart in the order given")
    columns = [np.ones(psi.shape)]
    for harmonic in range(1, (n - 1) // 2 + 1):
        columns += [np.cos(harmonic * psi), np.sin(harmonic * psi)]
    if n % 2 == 0:
        columns.append(np.broadcast_to((-1.0) ** np.arange(n), psi.shape))
    back = np.stack(columns, axis=-1)  # q = back a
    if flag("multiblade: inverse", inverse):
        return np.einsum("...ij,...j->...i", back, q)
    weight = np.full(n, 2.0 / n)
    weight[0] = 1.0 / n
    if n % 2 == 0:
        weight[-1] = 1.0 / n
    return np.einsum("...ij,...i->...j", back, q) * weight


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

    def plot(self, *, ax: Any = None) -> Any:
        """Frequencies as a fixed observer sees them, coloured by family; returns the figure."""
        from .plot.matrices import rotor_modes as draw

        return draw(self, ax=ax)


def rotor_modes(modes: Any, blades: Any, speed: float) -> RotorModes:
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
    rate = real_array("rotor_modes: speed", speed)
    if rate.ndim:
        raise ModelError(f"rotor_modes: speed must be one number, got {shown(speed)}")
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


# Azimuths and shapes of blades that agree to this part of a radian or of their size are those of equal, evenly spaced blades. Larger:
# unequal blades are tried in vain; smaller: drawn digits refuse equal ones. Pinned by tests/truth/test_steady_rotation.py.
_EQUAL = 1e-7


def blade_transformations(turn: Turn) -> list[np.ndarray] | None:
    """T at every angle of a turn with three or more equal blades: the hub in axes that stand, the blades in multiblade coordinates.

    Blades are the equal subtrees that one body carries, or equal bodies that it carries around elastically; None without them.
    """
    w = turn.axis
    first = turn.tangents[0]
    if w is None or any(len(t.M) != len(first.M) for t in turn.tangents):
        return None
    for blades in _blade_groups(turn):
        ordered = _evenly_spaced(turn, blades, w)
        if ordered is not None:
            made = [_blade_transformation(turn, tangent, ordered, w) for tangent in turn.tangents]
            if all(T is not None for T in made):
                back = np.linalg.inv(made[0])  # type: ignore[arg-type]
                return [T @ back for T in made]  # type: ignore[operator]
    return None


@dataclass(frozen=True)
class _Blade:
    """Its bodies and modal coordinates as rows of a `Tangent`, and its own coordinates."""

    bodies: tuple[int, ...]
    rows: np.ndarray
    places: np.ndarray


def _blade_groups(turn: Turn) -> Iterator[list[_Blade]]:
    """Sets of subtrees of equal structure around one body."""
    topology = turn.snapshot.system.topology()
    names = list(turn.snapshot.tables["body_name"])
    kinds = {body: kind for body, _, _, kind in topology["tree"]}
    inner = {body: parent for body, parent, _, _ in topology["tree"]}
    for name, _, carrier in turn.spin.carried:
        inner[name] = names[carrier]
    children: dict[str | None, list[str]] = {}
    for body, parent in inner.items():
        children.setdefault(parent, []).append(body)

    def subtree(body: str) -> list[str]:
        return [body] + [b for child in children.get(body, ()) for b in subtree(child)]

    for parent, around in children.items():
        if parent is None:
            continue
        shapes: dict[tuple[str, ...], list[_Blade]] = {}
        for child in around:
            members = subtree(child)
            key = tuple(kinds[b] for b in members)
            shapes.setdefault(key, []).append(_blade(turn, topology, members))
        for blades in shapes.values():
            if len(blades) > 2 and len({len(b.places) for b in blades}) == 1 and len(blades[0].places):
                yield blades


def _blade(turn: Turn, topology: Any, members: list[str]) -> _Blade:
    from .tables import modal_places

    names = list(turn.snapshot.tables["body_name"])
    stems = {joint or body for body, _, joint, _ in topology["tree"] if body in members}
    bodies = tuple(names.index(b) for b in members)
    rows = [6 * b + k for b in bodies for k in range(6)]
    for body, own in modal_places(turn.snapshot.tables):
        if body in bodies:
            rows += [6 * len(names) + k for k in range(own.start, own.stop)]
            stems.add(names[body])
    places = [i for i, c in enumerate(turn.names) if c in stems or c.rpartition(".")[0] in stems]
    return _Blade(bodies, np.array(rows, dtype=int), np.array(places, dtype=int))


def _evenly_spaced(turn: Turn, blades: list[_Blade], w: np.ndarray) -> list[_Blade] | None:
    """In the sense of the rotation, or None."""
    a = w / np.linalg.norm(w)
    with core_errors():
        moved = turn.snapshot.system.bodies(turn.state.q, turn.state.rate)
    centre = []
    for blade in blades:
        # the velocity of each body tells its arm from the axis, w x arm
        velocity = moved["velocity"][list(blade.bodies)] + np.cross(
            moved["angular_velocity"][list(blade.bodies)], np.einsum("bij,bj->bi", moved["rotation"][list(blade.bodies)],
                                                                     turn.spin.com[list(blade.bodies)])
        )  # fmt: skip
        centre.append(np.cross(velocity.sum(axis=0), a) / np.linalg.norm(w))
    size = float(np.linalg.norm(centre[0]))
    if size == 0.0:
        return None
    e1 = centre[0] / size
    e2 = np.cross(a, e1)
    angle = np.array([np.arctan2(c @ e2, c @ e1) for c in centre]) % (2 * np.pi)
    angle[angle > 2 * np.pi - _EQUAL] = 0.0
    order = np.argsort(angle)
    n = len(blades)
    if np.max(np.abs(angle[order] - 2 * np.pi * np.arange(n) / n)) > _EQUAL:
        return None
    return [blades[i] for i in order]


def _blade_transformation(turn: Turn, tangent: Tangent, blades: list[_Blade], w: np.ndarray) -> np.ndarray | None:
    """y = T z: hub coordinates as they are in fixed axes, blades from a_0, a_1, b_1, ..."""
    from .turning_frames import fitted, rotation_about

    first, n, s = turn.tangents[0], len(blades), turn.scale
    size = float(np.linalg.norm(w))
    T = np.zeros_like(tangent.M)
    inside = np.concatenate([b.places for b in blades])
    outside = np.setdiff1d(np.arange(len(T)), inside)
    rows = np.setdiff1d(np.arange(len(tangent.rows)), np.concatenate([b.rows for b in blades]))
    inner = turn.target("fixed", tangent, outside_of=[b.bodies for b in blades])
    if inner is None:
        return None
    B = inner[np.ix_(rows, rows)]
    hub = fitted(tangent.rows[np.ix_(rows, outside)] * s[outside], B @ first.rows[np.ix_(rows, outside)] * s[outside])
    if hub is None:
        return None
    T[np.ix_(outside, outside)] = hub * s[outside][:, None] / s[outside][None, :]
    psi = 2 * np.pi * np.arange(n) / n + size * tangent.t
    patterns = multiblade(np.eye(n), np.broadcast_to(psi, (n, n)), inverse=True).T  # q = patterns a
    pilot = blades[0]
    for i, blade in enumerate(blades):
        # the first blade's shapes, turned to this blade's place
        R = rotation_about(w, tangent.t + 2 * np.pi * i / n / size)
        turned = np.eye(len(pilot.rows))
        for k in range(2 * len(pilot.bodies)):
            turned[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = R
        own = fitted(
            tangent.rows[np.ix_(blade.rows, blade.places)] * s[blade.places],
            turned @ first.rows[np.ix_(pilot.rows, pilot.places)] * s[pilot.places],
        )
        if own is None:
            return None
        own = own * s[blade.places][:, None] / s[pilot.places][None, :]
        for j in range(n):
            T[np.ix_(blade.places, blades[j].places)] = own * patterns[i, j]
    return T
