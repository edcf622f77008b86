"""Numbers typed with a unit, such as "100 N/mm", in models with ``units="SI"``: converted when typed, by pint."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from typing import Any, TypeVar

import numpy as np

from ..errors import ModelError
from .names import problem, shown
from .numbers import shape_of
from .schema import BODY, COORDINATE_ROLES, UNITS, Field, Kind

# A number and the unit behind it. Neither long texts nor large powers reach pint, which would compute them.
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LETTERS = "A-Za-z\u00b0\u00b5\u03bc%"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*([{_LETTERS}][{_LETTERS}0-9_ */^().-]{{0,60}})")
_POWER = re.compile(r"(?<=[A-Za-z\u00b5\u03bc])(-?\d)(?!\d)")
_LARGE = re.compile(r"\d\d")
# What a parameter's unit is called, of those with the same dimensions the first. Moments and stiffnesses about an axis before energy.
_LABELS = (
    "m", "rad", "kg", "s", "N", "N m", "N/m", "N s/m", "N m s", "kg m2", "m/s", "rad/s", "m/s2", "N/m2", "N/m3", "kg/m", "kg/m3", "m2",
    "m3", "m4", "N m2", "W", "N/s",
)  # fmt: skip

_C = TypeVar("_C", bound=Callable[..., Any])


def is_quantity(value: Any) -> bool:
    """Is it a text that begins with a number and goes on with a unit?"""
    return isinstance(value, str) and _QUANTITY.fullmatch(value) is not None


def has_quantity(value: Any) -> bool:
    """Is there such a text among the numbers?"""
    if type(value) is float:
        return False
    if isinstance(value, list | tuple):
        return any(type(one) is not float and has_quantity(one) for one in value)
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "UO" and any(is_quantity(v) for v in value.ravel().tolist())
    return is_quantity(value)


@cache
def _registry() -> Any:
    try:
        import pint
    except ImportError:
        raise ModelError(
            "numbers with units need pint, which is not installed: pip install 'mbrs-dynamics[units]'"
        ) from None
    return pint.UnitRegistry()


def quantity(text: str, where: str) -> Any:
    """The quantity of pint that a text means."""
    found = _QUANTITY.fullmatch(text)
    if found is None or _LARGE.search(found[2]):
        raise problem(where, f"must be a number with a unit such as '100 N/mm', got {shown(text)}")
    registry = _registry()
    try:
        return float(found[1]) * registry.Unit(_POWER.sub(r"**\1", found[2].replace("^", "**")))
    except Exception:  # pint raises errors of many kinds
        raise problem(where, f"has a unit that is not known, {shown(found[2])}") from None


def in_si(text: str, unit: str, where: str) -> float:
    """The number of a text in the SI unit ``unit``.

    Raises
    ------
    ModelError
        A unit of another dimension; hertz for an angular velocity, since pint takes a turn and a radian for the same.
    """
    given, wanted = quantity(text, where), _registry().Unit(_POWER.sub(r"**\1", unit) or "dimensionless")
    if "rad/s" in unit and "hertz" in str(given.units):
        raise problem(where, f"is in {unit}, and {shown(text)} in hertz: write revolutions as rpm or as rad/s")
    if not given.is_compatible_with(wanted):
        raise problem(where, f"must be in {unit or 'no unit'} or a multiple of it, got {shown(text)}")
    return float(given.to(wanted).magnitude)


def labelled(text: str, unit: str, where: str) -> tuple[float, str]:
    """The number of a text in SI units, and their label: ``unit`` where it is given."""
    given = quantity(text, where)
    if unit:
        try:
            factor = (1.0 * _registry().Unit(_POWER.sub(r"**\1", unit))).to_base_units().magnitude
        except Exception:
            raise problem(where, f"has a unit that is not known, {shown(unit)}") from None
        if factor != 1.0:
            raise problem(where, f"is in a model of SI units, so unit= must be one of them, got {shown(unit)}")
        return in_si(text, unit, where), unit
    for label in _LABELS:
        if given.is_compatible_with(_registry().Unit(_POWER.sub(r"**\1", label))):
            # an angle has no dimension for pint, nor has a ratio
            if label == "rad" and given.dimensionless and str(given.units) in ("dimensionless", "percent"):
                return float(given.to_base_units().magnitude), ""
            return in_si(text, label, where), label
    base = given.to_base_units()
    return float(base.magnitude), f"{base.units:~C}".replace("**", "").replace("*", " ")


def converted(value: Any, units: Sequence[str], where: str) -> Any:
    """Texts among numbers as numbers in SI: ``units`` one for all, or one for each in C order."""
    if isinstance(value, str):
        return in_si(value, units[0], where)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, list | tuple):
        return value
    share = len(units) // len(value) if len(units) > 1 and len(value) else 0
    parts = [units[i * share : (i + 1) * share] if share else units for i in range(len(value))]
    return [converted(v, part or units, where) for v, part in zip(value, parts, strict=True)]


def refuse(book: Any, where: str, value: Any) -> None:
    """Raise in a model that does not take texts with units."""
    if book.units != "SI":
        raise problem(
            where, f"is text with a unit, which takes a model of mb.Model(..., units='SI'), got {shown(value)}"
        )


def accepting(constructor: _C, kinds: Kind | Mapping[str, Kind]) -> _C:
    """The constructor of an object, which takes numbers with units in models of SI units."""
    kind = kinds if isinstance(kinds, Kind) else kinds[constructor.__name__]
    fields: Mapping[str, Field] = {"at": next(f for f in BODY.block if f.name == "at"), **kind.block.fields}

    @wraps(constructor)
    def made(self: Any, name: Any, *args: Any, **given: Any) -> Any:
        for key, value in given.items():
            if not has_quantity(value):
                continue
            where = f"{name}.{key}"
            refuse(self, where, value)
            if key == "pose" and isinstance(value, list | tuple) and len(value) == 2:
                given[key] = (converted(value[0], (UNITS["point"],), where), value[1])
            elif key in fields and fields[key].role not in ("direction", "orientation"):
                given[key] = converted(value, _units(kind, fields[key], value), where)
        return constructor(self, name, *args, **given)

    return made  # type: ignore[return-value]


def _units(kind: Kind, field: Field, value: Any) -> Sequence[str]:
    return kind.units(field, shape_of(value)) if field.role in COORDINATE_ROLES else (UNITS.get(field.role, ""),)
