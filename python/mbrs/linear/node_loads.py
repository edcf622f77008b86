"""Forces along a beam at its nodes, whose geometric stiffness flexible bodies leave out."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ..errors import MbrsWarning
from ..model.flexible import FlexibleBody
from ..system.snapshot import Snapshot

# Share of the bending stiffness that an axial force at a node would change, from which on it is named. Larger: stiffness that a
# column has lost passes unseen. Smaller: weights of small parts are named. Pinned by tests/flexible/test_node_loads.py.
NAMED = 1e-3
# Stiffness over the largest of a body below which a shape is not held. Larger: soft shapes carry any force; smaller: rounding does.
_HELD = 1e-12


def check_node_loads(snapshot: Snapshot, forces: list[tuple[int, list[float]]]) -> None:
    """Name axial forces at nodes of beams; ``forces``: body of the node, and N in the axes of its flexible body."""
    if not forces:
        return
    frames = {
        f"{body.name}.{node}": body
        for body in snapshot.model.bodies
        if isinstance(body, FlexibleBody)
        for node in body.nodes
    }
    names = snapshot.tables["body_name"]
    worst, at, axial = 0.0, "", 0.0
    for number, force in forces:
        body = frames.get(names[number])
        share = 0.0 if body is None else abs(force[0]) * _softening(body)
        if share > worst:
            worst, at, axial = share, names[number], force[0]
    if worst <= NAMED:
        return
    owner = frames[at].name
    text = (
        f"{owner!r} is loaded by {abs(axial):.3g} N along its axis at {at!r}, which would change its bending stiffness by about "
        f"{100 * worst:.2g} %, and a flexible body leaves the stiffness of forces at nodes out; cut it into several beams that are welded "
        "to each other, whose joints carry it"
    )
    warnings.warn(text, MbrsWarning, stacklevel=5)


def _softening(body: FlexibleBody) -> float:
    """Largest change of the bending stiffness, over the stiffness, by an axial force of 1 N that acts where that of inertia does.

    The shape of the force over the length is that of an acceleration along the axis (of a clamped beam), or of a rotation about the
    centre (of a free one); a force at the end of a uniform cantilever has 3.2 times, on a pinned beam 1.2 times the effect.
    """
    modal: Any = body.modal
    length = float(np.ptp(modal.node_position[:, 0])) if len(modal.nodes) else 0.0
    clamped = bool(np.any(modal.KG[0]))
    KG, largest = (modal.KG[0], modal.mass) if clamped else (modal.KG[3], modal.mass * length / 8)
    if not np.any(KG) or not largest > 0.0:
        return 0.0
    values, vectors = np.linalg.eigh(modal.K)
    held = values > _HELD * values[-1]
    weight = vectors[:, held] / np.sqrt(values[held])
    return float(np.max(np.abs(np.linalg.eigvalsh(weight.T @ KG @ weight))) / largest * (3.2 if clamped else 1.2))
