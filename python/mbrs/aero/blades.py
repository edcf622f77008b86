"""Blades as aerodynamics sees them: chord, twist and polars over stations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import count, each, real_array, shown
from ..errors import ModelError
from .polars import Polar

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Blade", "blade"]


@dataclass(frozen=True, eq=False)
class Blade:
    """A blade or wing; `blade` makes and checks it. Between stations chord, twist and aerodynamic centre are linear.

    Attributes
    ----------
    stations
        (n,) m, increasing.
    chord, twist, aerodynamic_center
        (n,) m, rad, and the fraction of the chord behind the leading edge.
    polars
        Those that are mixed, each once.
    thickness
        (n,) over the chord, or None where the polars are given by station.
    body
        Name of the body that carries the blade, or None.
    root, line
        m, and a fraction of the chord: where the body's origin and its line are.
    sections
        Strips into which `Model.aerodynamics` cuts it.
    """

    stations: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    aerodynamic_center: np.ndarray
    polars: tuple[Polar, ...]
    shares: np.ndarray
    thickness: np.ndarray | None = None
    body: str | None = None
    root: float = 0.0
    line: float = 0.25
    sections: int = 16

    def __repr__(self) -> str:
        low, high = self.stations[[0, -1]]
        return f"Blade({len(self.stations)} stations from {low:g} to {high:g} m, {len(self.polars)} polars)"

    def plain(self, polars: list[dict[str, Any]]) -> dict[str, Any]:
        """The blade in strips as plain data, which models and files hold; its polars are added to ``polars`` unless they are there."""
        edges, places = strips(float(self.stations[0]), float(self.stations[-1]), self.sections)
        names = [_take_polar(polars, p) for p in self.polars]
        weights = self.weights(places)
        first = np.argmax(weights > 0.0, axis=1)
        second = weights.shape[1] - 1 - np.argmax(weights[:, ::-1] > 0.0, axis=1)
        return {
            "body": self.body,
            "root": self.root,
            "first": float(self.stations[0]),
            "last": float(self.stations[-1]),
            "line": self.line,
            "place": places.tolist(),
            "width": np.diff(edges).tolist(),
            "chord": self.chords(places).tolist(),
            "twist": self.twists(places).tolist(),
            "aerodynamic_center": np.interp(places, self.stations, self.aerodynamic_center).tolist(),
            "polar": [names[i] for i in first],
            "second_polar": [names[i] for i in second],
            "share": np.where(first == second, 0.0, weights[np.arange(len(places)), second]).tolist(),
        }

    def chords(self, places: ArrayLike) -> np.ndarray:
        """(m,) m: chord at places (m,) m among the stations."""
        return np.interp(np.asarray(places), self.stations, self.chord)

    def twists(self, places: ArrayLike) -> np.ndarray:
        """(m,) rad: twist at places (m,) m among the stations."""
        return np.interp(np.asarray(places), self.stations, self.twist)

    def weights(self, places: ArrayLike) -> np.ndarray:
        """(m, k): share of each polar at places (m,) m; the shares of a place add up to one.

        Linear in the thickness where thicknesses are given, else linear between the polars of the stations.
        """
        x = np.asarray(places, dtype=float)
        if self.thickness is None:
            return np.stack([np.interp(x, self.stations, share) for share in self.shares.T], axis=-1)
        known = np.array([p.thickness for p in self.polars])
        return _hats(np.interp(x, self.stations, self.thickness), known)

    def coefficients(self, places: ArrayLike, angle: ArrayLike) -> np.ndarray:
        """(..., m, 3) lift, drag, moment coefficients at places (m,) m and angles of attack (..., m) rad.

        Raises
        ------
        ModelError
            A polar that takes part does not hold an angle; the message names angle, place and station.
        """
        self.require(places, angle)
        return self.mix(self.weights(places), angle)

    def mix(self, weights: np.ndarray, angle: ArrayLike, slope: bool = False) -> np.ndarray:
        """(..., m, 3) coefficients, or their slopes in 1/rad, with the shares (m, k) of `weights`; beyond a table its end."""
        a = np.asarray(angle, dtype=float)
        total = np.zeros((*a.shape, 3))
        for k, p in enumerate(self.polars):
            takes = np.flatnonzero(weights[:, k])
            if takes.size:
                value = p.clip_slopes(a[..., takes]) if slope else p.clip_values(a[..., takes])
                total[..., takes, :] += weights[takes, k, None] * value
        return total

    def require(self, places: ArrayLike, angle: ArrayLike) -> None:
        """Raise a ModelError where a polar that takes part does not hold an angle (..., m) rad met at places (m,) m."""
        x, a = np.asarray(places, dtype=float), np.asarray(angle, dtype=float)
        weights = self.weights(x)
        for k, p in enumerate(self.polars):
            outside = (weights[:, k] > 0.0) & ~p.covers(a)
            if np.any(outside):
                where = tuple(np.argwhere(outside)[0])
                place = x[where[-1]]
                station = int(np.argmin(np.abs(self.stations - place)))
                low, high = np.degrees(p.angle[[0, -1]])
                raise ModelError(
                    f"polar {p.name!r} covers {low:.4g} to {high:.4g} degrees, but the angle of attack at {place:.4g} m (station "
                    f"{station + 1} of {len(self.stations)}) is {np.degrees(a[where]):.4g} degrees; give a longer table, or ask for "
                    ".extend(aspect_ratio=...)"
                )


def blade(
    stations: ArrayLike,
    chord: ArrayLike,
    twist: ArrayLike,
    polar: Polar | Sequence[Polar],
    *,
    thickness: ArrayLike | None = None,
    aerodynamic_center: ArrayLike = 0.25,
    body: str | None = None,
    root: float = 0.0,
    line: float = 0.25,
    sections: int = 16,
) -> Blade:
    """Describe a blade or a wing.

    Parameters
    ----------
    stations
        (n,) m, increasing, at least two: places along the blade. For a rotor they are distances from its axis, of a wing of both
        halves they go from the left to the right tip.
    chord
        (n,) m, or one number; positive (a tip may be pointed: 0 at an end).
    twist
        (n,) rad, or one number: angle of the chord to the rotor's plane, positive where it turns the leading edge into the wind;
        of a wing the geometric angle of attack.
    polar
        One for all; one per station; or several with a ``thickness`` each, among which ``thickness`` chooses.
    thickness
        (n,) over the chord: polars are interpolated linearly in it, each at the same angle of attack.
    aerodynamic_center
        (n,) or one number: fraction of the chord behind the leading edge, where lift, drag and moment act.
    body
        Name of the body that carries the blade, for `Model.aerodynamics`.
    root
        m: where on the blade the origin of that body is; the stations of a rotor's blade count from the axis.
    line
        Fraction of the chord behind the leading edge at which the body's x axis (the line of a flexible body) goes through the sections.
    sections
        Strips into which `Model.aerodynamics` cuts the blade, narrow at both ends.

    Raises
    ------
    ModelError
        Stations that do not increase, chords that are not positive, lengths that differ, a thickness that no polar reaches, nan.

    Notes
    -----
    What one place costs is O(log n) per polar that takes part, of which there are at most two.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a = np.radians([-20.0, 20.0])
    >>> thin = mb.aero.polar(a, 2 * np.pi * a, [0.01, 0.01], name="thin")
    >>> b = mb.aero.blade([1.0, 4.0, 9.0], chord=[1.2, 1.0, 0.4], twist=np.radians([12.0, 5.0, 0.0]), polar=thin)
    >>> b
    Blade(3 stations from 1 to 9 m, 1 polars)
    >>> b.coefficients([2.0], [0.5])
    Traceback (most recent call last):
    mbrs.errors.ModelError: polar 'thin' covers -20 to 20 degrees, but the angle of attack at 2 m (station 1 of 3) is 28.65 degrees; give a longer table, or ask for .extend(aspect_ratio=...)
    """  # noqa: E501
    what = "blade" if body is None else f"blade of {shown(body)}"
    x = real_array(f"{what}: stations", stations)
    if x.ndim != 1 or len(x) < 2:
        raise ModelError(f"{what}: stations must be a list of at least two places, the shape is {x.shape}")
    if np.any(np.diff(x) <= 0.0):
        i = int(np.argmax(np.diff(x) <= 0.0)) + 1
        raise ModelError(f"{what}: the stations must increase, station {i + 1} ({x[i]:g} m) follows {x[i - 1]:g} m")
    c = each(f"{what}: chord", chord, len(x), "stations")
    bad = c < 0.0
    bad[1:-1] |= c[1:-1] == 0.0
    if np.any(bad) or not np.any(c):
        i = int(np.argmax(bad))
        raise ModelError(f"{what}: the chord must be positive, at station {i + 1} ({x[i]:g} m) it is {c[i]:g} m")
    centre = each(f"{what}: aerodynamic_center", aerodynamic_center, len(x), "stations")
    if np.any((centre < 0.0) | (centre > 1.0)):
        raise ModelError(
            f"{what}: aerodynamic_center is a fraction of the chord from 0 to 1, it is {shown(aerodynamic_center)}"
        )
    polars, shares, thick = _polars(what, polar, thickness, len(x))
    origin, at = (float(real_array(f"{what}: {n}", v)) for n, v in (("root", root), ("line", line)))
    n = count(f"{what}: sections", sections, 400, 2)
    return Blade(
        x, c, each(f"{what}: twist", twist, len(x), "stations"), centre, polars, shares, thick, body, origin, at, n
    )


def strips(first: float, last: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n+1,) and middles (n,) m of strips that are narrow at both ends, spaced as cosines."""
    turn = np.linspace(0.0, np.pi, 2 * n + 1)
    along = 0.5 * (first + last) - 0.5 * (last - first) * np.cos(turn)
    return along[::2], along[1::2]


def _take_polar(known: list[dict[str, Any]], polar: Polar) -> str:
    """The name of a polar among tables; one that is not there is added, under a name of its own."""
    table = polar.plain()
    for other in known:
        if {**other, "name": ""} == {**table, "name": ""} and other["name"].partition("#")[0] == polar.name:
            return str(other["name"])
    same = sum(other["name"].partition("#")[0] == polar.name for other in known)
    known.append({**table, "name": f"{polar.name}#{same + 1}" if same else polar.name})
    return str(known[-1]["name"])


def _polars(what: str, given: Any, thickness: Any, n: int) -> tuple[tuple[Polar, ...], np.ndarray, np.ndarray | None]:
    several = (given,) if isinstance(given, Polar) else tuple(given) if isinstance(given, Sequence) else ()
    if not several or not all(isinstance(p, Polar) for p in several):
        raise ModelError(f"{what}: polar must be what mb.aero.polar gives, or a list of these; it is {shown(given)}")
    if thickness is None:
        if len(several) not in (1, n):
            raise ModelError(
                f"{what}: there are {len(several)} polars for {n} stations; give one, one per station, or thickness= to choose by"
            )
        known = tuple(dict.fromkeys(several))
        shares = np.array([[float(q is p) for q in known] for p in (several * n if len(several) == 1 else several)])
        return known, shares, None
    absent = [p.name for p in several if p.thickness is None]
    if absent:
        raise ModelError(
            f"{what}: the polar {absent[0]!r} has no thickness to be chosen by; give thickness= to mb.aero.polar"
        )
    known = tuple(sorted(several, key=lambda p: p.thickness or 0.0))
    t = np.array([p.thickness for p in known])
    if np.any(np.diff(t) <= 0.0):
        raise ModelError(f"{what}: two polars have the same thickness {t[int(np.argmax(np.diff(t) <= 0.0))]:g}")
    thick = each(f"{what}: thickness", thickness, n, "stations")
    outside = (thick < t[0]) | (thick > t[-1])
    if np.any(outside):
        i = int(np.argmax(outside))
        raise ModelError(
            f"{what}: the thickness {thick[i]:g} of station {i + 1} is not between the polars' {t[0]:g} and {t[-1]:g}"
        )
    return known, _hats(thick, t), thick


def _hats(value: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """(m, k) linear interpolation among knots as shares; one knot has them all."""
    return np.stack([np.interp(value, knots, unit) for unit in np.eye(len(knots))], axis=-1)
