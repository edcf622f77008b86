"""Vibration and motion of spatial multibody systems. ``import mbrs as mb``.

Everything public is listed in `_lib/names.py` and imported when it is first used, so that ``import mbrs`` stays cheap.
"""

from __future__ import annotations

import importlib
from typing import Any

from ._lib.formats import load_with as _load_with
from ._lib.names import PUBLIC as _PUBLIC

_MODULES = {
    **{name: name for name in ("aero", "design", "examples", "reference", "errors", "plot", "view", "flexible")},
    "matrix_calculus": "solvers.matrix_calculus",
    "formats": "_lib.formats",
    "report": "_lib.text",
}
# Folders of which the files are reached by name, as `mb.view.motion`, without an import of their own.
_WHOLE = {
    "view": ("modes", "motion", "page", "still"),
    "plot": (
        "aero",
        "derivatives",
        "gradients",
        "linear",
        "matrices",
        "models",
        "motion",
        "nonlinear",
        "scenes",
        "studies",
        "sweeps",
    ),
}
__all__ = sorted(
    [
        *(name for name in _PUBLIC if name != "__version__"),
        "aero",
        "design",
        "examples",
        "flexible",
        "formats",
        "matrix_calculus",
    ]
)


def _register_formats() -> None:
    """Import the modules of `io`, each of which registers its formats; other programs that they need wait until they are used."""
    import pkgutil

    folder = importlib.import_module(".io", __name__)
    for module in pkgutil.iter_modules(folder.__path__):
        if not module.name.startswith("_"):
            importlib.import_module(f"{folder.__name__}.{module.name}")


_load_with(_register_formats)


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        value = getattr(importlib.import_module(f".{_PUBLIC[name]}", __name__), name)
    elif name in _MODULES:
        value = importlib.import_module(f".{_MODULES[name]}", __name__)
        for part in _WHOLE.get(name, ()):
            importlib.import_module(f".{_MODULES[name]}.{part}", __name__)
    else:
        import difflib

        # hidden names are what programs look for in every module
        near = [] if name.startswith("_") else difflib.get_close_matches(name, __all__, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module 'mbrs' has no attribute {name!r}{hint}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
