"""All that the equations of motion need to know of an elastic body: the integrals of its shapes over its mass."""

from __future__ import annotations

import io
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .._lib.checks import names, shown, sized_array
from .._lib.checks import path as path_of
from .._lib.files import write_atomic
from .._lib.rotations import skew
from .._lib.text import number, table
from ..errors import InertiaError, ModelError
from ._archive import read_arrays

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

__all__ = ["ModalBody"]

_TOLERANCE = 1e-9
# Inertia over the largest, free of units, that no motion of a body has: of a straight beam about itself, where its six motions are
# inverted and where they move. Larger: slender bodies lose their own axis; smaller: rounding turns.
_NO_RANK, _NO_INERTIA = 1e-13, 1e-12
# Eigenvalue of the mass matrix of unit diagonal that is not negative, or positive once the frame follows. Larger: two shapes that are
# nearly one are refused; smaller: rounding of the integrals refuses bodies, and shapes that move the body as a whole pass.
_SEMIDEFINITE = 1e-10
# What ModalBody holds beside the numbers of the equations.
_TEXTS = ("nodes", "note")


class Recipe(Protocol):
    """All that a modal body is made from."""

    def finer(self) -> ModalBody:
        """The body of a finer mesh and more shapes."""


@dataclass(frozen=True, eq=False)
class ModalBody:
    """An elastic body in a floating frame: position of a particle R (r + phi_k q_k) + p, q the modal coordinates.

    Everything is about the frame's origin (the body's ``at``) and in body axes; m is the number of modes. With rho the
    density, r the undeformed position of a particle and phi_k its displacement for q_k = 1:

        S_k = int rho phi_k,   P1_k = int rho r phi_k^T,   P2_kl = int rho phi_k phi_l^T,   M_kl = trace P2_kl.

    Made by `mbrs.flexible.beam` and `mbrs.flexible.craig_bampton`, or by hand from another program's shapes.

    Parameters
    ----------
    mass, com, inertia
        kg; (3,) m from the origin; (3, 3) kg m2 about the centre of mass: of the undeformed body.
    S, P1, P2
        (3, m) kg m; (m, 3, 3) kg m2; (m, m, 3, 3) kg m2, P2[k, l] = P2[l, k]^T. Units for q in metres.
    K, C
        (m, m) symmetric stiffness and damping of the modal coordinates; C may be left out.
    KG
        (12, m, m): geometric stiffness for unit inertial fields. For the acceleration b(r) = a0 + W r of the frame's
        particles less gravity (body axes) the generalised force is -(sum_i c_i KG_i) q with c = (a0, W row by row).
        Left out: zero (no stiffening by inertial loads).
    nodes, node_position, node_shape
        n names; (n, 3) m; (n, 6, m): displacement and small rotation of the node for unit modal coordinates. The
        frame's own node of a clamped body is among them, with zero shapes.
    node_quadratic
        (n, 3, m, m) symmetric second-order displacements psi of the nodes: u = phi_k q_k + psi_kl q_k q_l / 2, above all
        foreshortening. Forces at a node then have their stiffness psi_kl . f, which buckles a column. Left out: zero.
    line_position, line_shape, line_quadratic
        (p, 3), (p, 6, m) and (p, 3, m, m) as for nodes, of points along the body that `Model.section_load`, blades and
        pictures use; the nodes where they are left out.
    note
        How the body was made; printed.
    driven
        By name arrays of numbers and expressions of parameters that stand for mass, com, inertia, S, P1, P2, K, C and KG, and
        for numbers of nodes, in a model;
        `mbrs.flexible.beam` makes them. Empty: the numbers alone.
    recipe
        What `finer` makes the body anew from; `mbrs.flexible.beam` gives it, files do not hold it.

    Raises
    ------
    ModelError
        Wrong shapes, numbers that are not finite, matrices that are not symmetric, a stiffness that is not positive
        semidefinite, shapes that can move the body as a whole (the mass matrix of frame and shapes is then singular).
    InertiaError
        A mass or an inertia that no body can have.

    Notes
    -----
    The integrals hold every inertia force that is linear or quadratic in q: none is neglected but that of the shapes'
    own second order (foreshortening), whose largest part KG holds. After A. A. Shabana, Dynamics of Multibody Systems,
    ch. 5 (floating frame, inertia shape integrals); node_quadratic after D. J. Segalman, C. R. Dohrmann, J. Vib. Acoust.
    118 (1996) 313-317. Cost of making one: O(m^3).

    Examples
    --------
    >>> import numpy as np
    >>> from mbrs.flexible import ModalBody
    >>> P1 = np.zeros((1, 3, 3)); P1[0, 0, 2] = 0.25     # int rho x phi_z for phi_z = x^2, a rod of 1 kg and 1 m
    >>> P2 = np.zeros((1, 1, 3, 3)); P2[0, 0, 2, 2] = 0.2
    >>> rod = ModalBody(mass=1.0, com=(0.5, 0, 0), inertia=np.diag([1e-4, 0.0834, 0.0834]), P1=P1, P2=P2,
    ...                 S=np.array([[0], [0], [1 / 3]]), K=np.array([[80.0]]))
    >>> rod.frequencies()
    array([3.18309886])
    """

    mass: float
    com: np.ndarray
    inertia: np.ndarray
    S: np.ndarray
    P1: np.ndarray
    P2: np.ndarray
    K: np.ndarray
    C: np.ndarray = None  # type: ignore[assignment]
    KG: np.ndarray = None  # type: ignore[assignment]
    nodes: tuple[str, ...] = ()
    node_position: np.ndarray = None  # type: ignore[assignment]
    node_shape: np.ndarray = None  # type: ignore[assignment]
    line_position: np.ndarray = None  # type: ignore[assignment]
    line_shape: np.ndarray = None  # type: ignore[assignment]
    node_quadratic: np.ndarray = None  # type: ignore[assignment]
    line_quadratic: np.ndarray = None  # type: ignore[assignment]
    note: str = ""
    driven: Mapping[str, Any] = field(default_factory=dict)
    recipe: Recipe | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        m = self._modes()
        shapes = _shapes(m)
        object.__setattr__(self, "mass", float(_shaped("mass", self.mass, ())))
        for name in ("com", "inertia", "S", "P1", "P2", "K"):
            object.__setattr__(self, name, _shaped(name, getattr(self, name), shapes[name]))
        for name in ("C", "KG"):
            given = getattr(self, name)
            made = np.zeros(shapes[name]) if given is None else _shaped(name, given, shapes[name])
            object.__setattr__(self, name, made)
        object.__setattr__(self, "nodes", _node_names(self.nodes))
        self._take_points("node", len(self.nodes), m)
        if self.line_position is None and self.line_shape is None:
            object.__setattr__(self, "line_position", self.node_position)
            object.__setattr__(self, "line_shape", self.node_shape)
            if self.line_quadratic is None:
                object.__setattr__(self, "line_quadratic", self.node_quadratic)
        elif self.line_position is None or self.line_shape is None:
            raise ModelError("modal body: give both of line_position= and line_shape=, or neither")
        self._take_points("line", (np.shape(self.line_position) or (0,))[0], m)
        for made in (getattr(self, f.name) for f in fields(self)):
            if isinstance(made, np.ndarray):
                made.setflags(write=False)
        self._check_matrices()

    def _modes(self) -> int:
        K = sized_array("modal body: K", self.K)
        if K.ndim != 2 or K.shape[0] != K.shape[1] or len(K) == 0:
            raise ModelError(
                f"modal body: K must be a square matrix with one row per mode, got shape {K.shape}; a body without "
                "modes is a rigid body, m.body"
            )
        return len(K)

    def _take_points(self, kind: str, n: int, m: int) -> None:
        for part, shape in (("position", (n, 3)), ("shape", (n, 6, m)), ("quadratic", (n, 3, m, m))):
            name = f"{kind}_{part}"
            given = getattr(self, name)
            if given is None and n and part != "quadratic":
                raise ModelError(f"modal body: {n} {kind}s need {name}= of shape {shape}")
            object.__setattr__(self, name, np.zeros(shape) if given is None else _shaped(name, given, shape))

    def _check_matrices(self) -> None:
        if not self.mass > 0:
            raise InertiaError(f"modal body: the mass must be positive, it is {self.mass:g} kg")
        P2 = self.P2
        for name, A, B in (
            ("inertia", self.inertia, self.inertia.T),
            ("K", self.K, self.K.T),
            ("C", self.C, self.C.T),
            ("P2 (P2[k, l] = P2[l, k]^T)", P2, P2.transpose(1, 0, 3, 2)),
            ("KG (each of the twelve)", self.KG, np.swapaxes(self.KG, 1, 2)),
            ("node_quadratic", self.node_quadratic, np.swapaxes(self.node_quadratic, 2, 3)),
            ("line_quadratic", self.line_quadratic, np.swapaxes(self.line_quadratic, 2, 3)),
        ):
            if np.max(np.abs(A - B), initial=0.0) > _TOLERANCE * np.max(np.abs(A), initial=0.0):
                raise ModelError(f"modal body: {name} must be symmetric; it differs from its transpose")
        _not_negative("K", self.K, "an elastic body at rest has no negative stiffness")
        _not_negative("C", self.C, "damping takes energy out")
        if not self._moves_beside_the_frame():
            raise InertiaError(
                "modal body: the mass matrix of its frame and shapes together is impossible: inertia that no body has, a "
                "shape without mass, two shapes that are the same, or shapes that move the body as a whole (remove rigid-body "
                "motion from the shapes; the frame represents it)"
            )

    def _moves_beside_the_frame(self) -> bool:
        """Mass of frame and shapes not negative, and positive for the shapes once the frame follows them."""
        whole = self.mass_matrix()
        scale = np.sqrt(np.abs(np.diag(whole)))
        scale[scale == 0] = 1.0  # a straight beam without thickness may have no inertia about its axis
        whole = whole / np.outer(scale, scale)
        rigid, shapes, both = whole[:6, :6], whole[6:, 6:], whole[:6, 6:]
        left = shapes - both.T @ np.linalg.pinv(rigid, rcond=_NO_RANK, hermitian=True) @ both
        return bool(np.linalg.eigvalsh(whole)[0] > -_SEMIDEFINITE and np.linalg.eigvalsh(left)[0] > _SEMIDEFINITE)

    @property
    def n_modes(self) -> int:
        """Number of modal coordinates."""
        return len(self.K)

    @property
    def M(self) -> np.ndarray:
        """(m, m) modal mass, M_kl = trace P2[k, l]."""
        return np.trace(self.P2, axis1=2, axis2=3)

    def mass_matrix(self) -> np.ndarray:
        """(6 + m, 6 + m) mass matrix of the undeformed body over acceleration of the origin, angular acceleration
        (body axes) and modal accelerations.

        [m 1, -m c~, S; ., J0, int rho r x phi; ., ., M], J0 about the origin. Cost O(m^2).
        """
        n = 6 + self.n_modes
        out = np.zeros((n, n))
        c = skew(self.com)
        out[:3, :3] = self.mass * np.eye(3)
        out[:3, 3:6] = -self.mass * c
        out[3:6, 3:6] = self.inertia - self.mass * c @ c
        out[:3, 6:] = self.S
        out[3:6, 6:] = np.array([_axial(p) for p in self.P1]).T
        out[6:, 6:] = self.M
        return np.triu(out) + np.triu(out, 1).T

    def frequencies(self, fixed: bool = True) -> np.ndarray:
        """Natural frequencies, Hz, ascending: (m,) with the frame held, of the free body with ``fixed=False``: then six of
        them are near zero, or five where a straight beam has no inertia about its axis. Cost O(m^3).
        """
        import scipy.linalg

        M, K = self.M, self.K
        if not fixed:
            whole = self.mass_matrix()
            inertia, axes = np.linalg.eigh(whole[:6, :6])
            moving = axes[:, inertia > _NO_INERTIA * inertia[-1]]
            T = scipy.linalg.block_diag(moving, np.eye(self.n_modes))
            M, K = T.T @ whole @ T, scipy.linalg.block_diag(np.zeros((moving.shape[1],) * 2), K)
        square = scipy.linalg.eigh(K, M, eigvals_only=True)
        return np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)

    def places(self, q: np.ndarray, line: Sequence[int] | None = None) -> np.ndarray:
        """(..., n, 3) m: where the nodes are at modal coordinates q (..., m), body axes; with ``line`` these points of the line.

        r + phi_k q_k + psi_kl q_k q_l / 2. Cost O(n m^2) for each q.
        """
        if line is None:
            at, shape, second = self.node_position, self.node_shape, self.node_quadratic
        else:
            pick = list(line)
            at, shape, second = self.line_position[pick], self.line_shape[pick], self.line_quadratic[pick]
        q = np.asarray(q, dtype=float)
        moved: np.ndarray = at + np.einsum("nik,...k->...ni", shape[:, :3], q)
        if np.any(second):
            moved = moved + 0.5 * np.einsum("nikl,...k,...l->...ni", second, q, q, optimize=True)
        return moved

    def finer(self) -> ModalBody:
        """The same body of elements of half the length and more than twice the shapes: what its results change by is what mesh and
        shapes leave them open to (`ModalResult.discretisation`).

        Raises
        ------
        ModelError
            Its mesh is not known: `mbrs.flexible.beam` did not make it, or a file holds its integrals alone.
        """
        if self.recipe is None:
            raise ModelError(
                "the mesh of this modal body is not known: only bodies that mb.flexible.beam made in this program can be made "
                "finer; compare with one of a finer mesh"
            )
        return self.recipe.finer()

    def node(self, name: str) -> int:
        """Index of a node."""
        if name not in self.nodes:
            raise ModelError(f"the modal body has no node {shown(name)}; it has {', '.join(self.nodes) or 'none'}")
        return self.nodes.index(name)

    def save(self, path: str | Path) -> Path:
        """Save as NumPy archive (``.npz``, added where it is missing); `load` brings it back. Returns the path."""
        if self.driven:
            raise ModelError(
                "this body depends on parameters of a model: save the model, or a body that was built of numbers"
            )
        path = path_of("path", path)
        path = path if path.suffix == ".npz" else path.with_name(path.name + ".npz")
        kept = {name: getattr(self, name) for name in _saved()}
        kept["nodes"] = np.array(self.nodes, dtype=np.str_)
        data = io.BytesIO()
        np.savez(data, allow_pickle=False, **kept)
        return write_atomic(path, data.getvalue())

    @classmethod
    def load(cls, path: str | Path) -> ModalBody:
        """A body that `save` has written. Nothing in the file is executed.

        Raises
        ------
        ModelError
            The file is not one of a modal body, is damaged, or holds a body that cannot be (InertiaError).
        OSError
            There is no such file, or it cannot be read.
        """
        known = _saved()
        held = read_arrays(path, known, "a modal body")
        if missing := [name for name in known if name not in held]:
            raise ModelError(f"{path} is not a file of a modal body: it lacks {', '.join(missing)}")
        if held["nodes"].dtype.kind != "U" or held["nodes"].ndim != 1 or held["note"].dtype.kind != "U":
            raise ModelError(f"{path} is not a file of a modal body: its names and its note are not text")
        texts = {"nodes": tuple(held["nodes"].tolist()), "note": str(held["note"])}
        numbers = {name: held[name] for name in known if name not in _TEXTS}
        try:
            return cls(**numbers, **texts)  # type: ignore[arg-type]
        except ModelError as reason:
            raise type(reason)(f"{path}: {reason}") from None

    def plot(self, modes: Sequence[int] | None = None) -> Figure:
        """The shapes: displacement of the points of the line along the body for each mode, over the distance along the
        line. ``modes``: indices, all (at most 12) by default. Returns a matplotlib figure.
        """
        from ..plot.modal_body import plot

        return plot(self, modes)

    def __str__(self) -> str:
        largest = _largest(self.line_shape)
        rows = [
            [f"q{i + 1}", frequency, self.K[i, i], self.M[i, i], largest[i]]
            for i, frequency in enumerate(self.frequencies())
        ]
        head = (
            f"Modal body: {number(self.mass)} kg, centre of mass {number(self.com)} m, {self.n_modes} mode(s), "
            f"nodes: {', '.join(self.nodes[:6]) or 'none'}{', ...' if len(self.nodes) > 6 else ''}"
        )
        listed = table(["shape", "f [Hz]", "K_ii", "M_ii", "moves most along"], rows)
        return "\n".join(part for part in (head, self.note, listed) if part)


def _saved() -> list[str]:
    return [f.name for f in fields(ModalBody) if f.name not in ("driven", "recipe")]


def _shapes(m: int) -> dict[str, tuple[int, ...]]:
    return {
        "com": (3,),
        "inertia": (3, 3),
        "S": (3, m),
        "P1": (m, 3, 3),
        "P2": (m, m, 3, 3),
        "K": (m, m),
        "C": (m, m),
        "KG": (12, m, m),
    }


def _shaped(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    return sized_array(f"modal body: {name}", value, shape)


def _node_names(value: Any) -> tuple[str, ...]:
    made = names("modal body: nodes", value)
    if len(set(made)) != len(made) or "" in made:
        raise ModelError(f"modal body: nodes must have names of their own, got {shown(made)}")
    return made


def _not_negative(name: str, A: np.ndarray, why: str) -> None:
    low = float(np.linalg.eigvalsh(A)[0])
    if low < -_TOLERANCE * np.max(np.abs(A)):
        raise ModelError(f"modal body: {name} has the negative eigenvalue {low:g}; {why}")


def _largest(shape: np.ndarray) -> list[str]:
    """The direction of the largest displacement of each mode."""
    if len(shape) == 0:
        return ["-"] * shape.shape[-1]
    return ["xyz"[int(np.argmax(np.max(np.abs(shape[:, :3, k]), axis=0)))] for k in range(shape.shape[-1])]


def _axial(P: np.ndarray) -> np.ndarray:
    """int rho r x phi of int rho r phi^T."""
    return np.array([P[1, 2] - P[2, 1], P[2, 0] - P[0, 2], P[0, 1] - P[1, 0]])
