"""Cases of the verification manual: a test calls `case`, which asserts and, where MBRS_MANUAL names a folder, writes a record.

docs/_ext/manual_page.py makes the page of the records. A case has an answer that does not come from mbrs.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

# how an answer is known, in the order of the page
KINDS = ("closed form", "publication", "other program", "high precision", "independent script")
TOPICS = (
    "modes",
    "loops",
    "statics",
    "transfer",
    "sensitivity",
    "nonlinear",
    "motion",
    "gradients",
    "flexible",
    "aero",
    "rotors",
)


def make(node: Any, root: Path) -> Callable[..., None]:
    """The function `case` of a test."""

    def case(
        name: str,
        *,
        topic: str,
        ours: Any,
        known: Any,
        within: float,
        source: str,
        kind: str = "closed form",
        uncertainty: float | None = None,
        estimate: Any = None,
        unit: str = "",
        scale: float | None = None,
    ) -> None:
        """Assert that a number, or an array of numbers, is the known one, and record it.

        Parameters
        ----------
        name
            One line that tells model and quantity; unique.
        ours, known
            Value of mbrs and the known one, of one shape.
        within
            Largest allowed distance over the size of what is known (its largest number, or ``scale``).
        source
            Formula or citation.
        kind
            One of `KINDS`.
        uncertainty
            Relative uncertainty of what is known; rounding of double precision where it is a formula.
        estimate
            ``result.error`` of mbrs, the largest entry; None where the analysis has none.
        """
        assert kind in KINDS and topic in TOPICS, (kind, topic)
        a, b = np.atleast_1d(np.asarray(ours)), np.atleast_1d(np.asarray(known))
        assert a.shape == b.shape and np.all(np.isfinite(b)), (a.shape, b.shape)
        size = float(np.max(np.abs(b))) if scale is None else scale
        uncertain = 4e-16 if uncertainty is None else uncertainty
        distance = float(np.max(np.abs(a - b))) / size
        worst = int(np.argmax(np.abs(a - b)))
        folder = os.environ.get("MBRS_MANUAL")
        error = None if estimate is None else float(np.max(estimate))
        if folder:
            record = {
                "name": name, "topic": topic, "kind": kind, "source": source, "unit": unit, "uncertainty": uncertain,
                "known": _text(b.ravel()[worst]), "ours": _text(a.ravel()[worst]), "count": int(a.size), "distance": distance,
                "within": within, "estimate": error, "test": node.nodeid.split("[")[0],
                "file": str(Path(node.path).relative_to(root)),
            }  # fmt: skip
            place = Path(folder)
            place.mkdir(parents=True, exist_ok=True)
            (place / f"{re.sub('[^a-z0-9]+', '-', name.lower())}.json").write_text(json.dumps(record, indent=1))
        assert within >= uncertain, "the known value is not known that well"
        assert distance <= within, (
            f"{name}: {a.ravel()[worst]} instead of {b.ravel()[worst]}, distance {distance:.1e} > {within:.1e}"
        )

    return case


def in_size_of(traj: Any, known: Any) -> float:
    """``traj.error`` of places, which is over the characteristic length, over the largest of the known places.

    It estimates neither velocities nor reactions: cases of those have no estimate.
    """
    return float(traj.error * traj.snapshot.system.characteristic_length / np.max(np.abs(known)))


def _text(value: Any) -> str:
    value = complex(value)
    return (
        f"{value.real:.12g}" if value.imag == 0 else f"{value.real:.9g} {'+-'[value.imag < 0]} {abs(value.imag):.9g} i"
    )
