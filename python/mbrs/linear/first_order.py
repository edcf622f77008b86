"""First-order form of a linear system, with named inputs and outputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib.checks import choice, real_array, shown
from .._lib.text import Block, without_rounding
from ..errors import ModelError, SingularError
from ..results import Result, quantity, result
from .linear_system import LinearSystem

if TYPE_CHECKING:
    import control
    import scipy.signal
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ORDER = {"displacement": 0, "velocity": 1, "acceleration": 2}


@result
class StateSpace(Result):
    """x' = A x + B u, outputs C x + D u, with x = (y, y') where all inputs are forces.

    Unpacks as ``A, B, C, D = ss``. ``states``, ``inputs`` and ``outputs`` are names. An input that is a motion of the
    base enters with its second derivative; the state is then shifted by multiples of the input so that no derivative of
    it is needed, and names in ``states`` then end with a star.
    """

    A: np.ndarray = quantity(dims=("state", "state_"), unit="")
    B: np.ndarray = quantity(dims=("state", "input"))
    C: np.ndarray = quantity(dims=("output", "state"))
    D: np.ndarray = quantity(dims=("output", "input"))
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    row: ClassVar[str] = "state"
    axes: ClassVar[Mapping[str, str]] = {"state": "states", "state_": "states", "input": "inputs", "output": "outputs"}

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter((self.A, self.B, self.C, self.D))

    def __len__(self) -> int:
        return 4

    def __getitem__(self, i: int) -> np.ndarray:
        return (self.A, self.B, self.C, self.D)[i]

    def heading(self) -> str:
        return f"{len(self.states)} states; inputs {', '.join(self.inputs)}; outputs {', '.join(self.outputs)}"

    def blocks(self) -> list[Block]:
        """[A B] over [C D], up to 12 states."""
        most = 12
        if len(self.states) > most:
            return [
                Block(
                    title=f"StateSpace: {self.heading()}", footer=f"(matrices of more than {most} states are not shown)"
                )
            ]
        whole = np.block([[self.A, self.B], [self.C, self.D]])
        rows = [
            [n, *line] for n, line in zip((*self.states, *self.outputs), without_rounding(whole).tolist(), strict=True)
        ]
        return [Block(["", *self.states, *self.inputs], rows, f"StateSpace: {self.heading()}")]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Eigenvalues of A in the complex plane; returns the figure."""
        from ..plot.matrices import eigenvalues

        return eigenvalues(self, ax=ax)

    def to_control(self) -> control.StateSpace:
        """`control.StateSpace` with the names (needs ``pip install mbrs-dynamics[control]``)."""
        import control

        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            states=[_plain(s) for s in self.states],
            inputs=[_plain(s) for s in self.inputs],
            outputs=[_plain(s) for s in self.outputs],
        )

    def to_scipy(self) -> scipy.signal.StateSpace:
        """`scipy.signal.StateSpace`."""
        from scipy.signal import StateSpace as SciPyStateSpace

        return SciPyStateSpace(self.A, self.B, self.C, self.D)

    @staticmethod
    def from_control(system: control.StateSpace | control.TransferFunction) -> StateSpace:
        """A `control.StateSpace`, or a `control.TransferFunction`, with its names.

        Raises
        ------
        ModelError
            A discrete-time system, or one that python-control cannot make a state space of.
        """
        import control

        if not isinstance(system, control.StateSpace | control.TransferFunction):
            raise ModelError(f"from_control takes a linear system of python-control, got {shown(system)}")
        try:
            made = control.ss(system)
        except (TypeError, ValueError, NotImplementedError, ImportError) as reason:
            raise ModelError(f"python-control makes no state space of this system: {reason}") from None
        if made.isdtime(strict=True):
            raise ModelError(f"from_control takes systems in continuous time; this one has the step {made.dt} s")
        return _checked_space(
            made.A,
            made.B,
            made.C,
            made.D,
            tuple(made.state_labels),
            tuple(made.input_labels),
            tuple(made.output_labels),
        )

    @staticmethod
    def from_scipy(system: scipy.signal.lti) -> StateSpace:
        """A `scipy.signal.StateSpace`, or another of its linear systems; states x0, ..., inputs u0, ..., outputs y0, ...

        Raises
        ------
        ModelError
            A discrete-time system, or something else.
        """
        if getattr(system, "dt", None) is not None:
            raise ModelError(f"from_scipy takes systems in continuous time; this one has the step {system.dt} s")
        try:
            made = system.to_ss()
        except (AttributeError, ValueError) as reason:
            raise ModelError(
                f"from_scipy takes a linear system of scipy.signal, got {shown(system)}: {reason}"
            ) from None
        n, m, p = made.A.shape[0], made.B.shape[1], made.C.shape[0]
        names = (tuple(f"{letter}{i}" for i in range(k)) for letter, k in (("x", n), ("u", m), ("y", p)))
        return _checked_space(made.A, made.B, made.C, made.D, *names)


def _checked_space(A: Any, B: Any, C: Any, D: Any, states: Any, inputs: Any, outputs: Any) -> StateSpace:
    """Real, finite matrices."""
    A, B, C, D = (real_array(f"{name} of a state space", a) for name, a in zip("ABCD", (A, B, C, D), strict=True))
    return StateSpace(A, B, C, D, states, inputs, outputs, error=None, status="given")


def _plain(name: str) -> str:
    """control uses dots for its own composite names."""
    return name.replace(".", "_")


def first_order(linear: LinearSystem, kind: str = "displacement") -> StateSpace:
    """A = [[0, 1], [-M^-1 S, -M^-1 D]], B = [0; M^-1 F], C = [L, 0] (velocity C A, acceleration C A^2 and C A B)."""
    choice("kind", kind, tuple(_ORDER))
    n, n_in = linear.n, linear.F.shape[1]
    A, B = _state_matrices(linear)
    C = np.hstack([linear.L, np.zeros((linear.L.shape[0], n))])
    powers = [B]
    for _ in range(int(linear.order_in.max(initial=0)) + _ORDER[kind]):
        powers.append(A @ powers[-1])
    D = _direct(linear, C, powers, _ORDER[kind])
    driven = np.column_stack([powers[p][:, j] for j, p in enumerate(linear.order_in)]) if n_in else B
    for _ in range(_ORDER[kind]):
        C = C @ A
    star = "*" if np.any(linear.order_in) else ""
    states = tuple(f"{c}{star}" for c in linear.coordinates) + tuple(f"d/dt {c}{star}" for c in linear.coordinates)
    driven, D = linear.joined(driven, 1), linear.joined(D, 1)
    return StateSpace(A, driven, C, D, states, linear.inputs, linear.outputs)


def _state_matrices(linear: LinearSystem) -> tuple[np.ndarray, np.ndarray]:
    n = linear.n
    M, C, G, K, N = (np.zeros((n, n)) if a is None else a for a in (getattr(linear.core, name) for name in "MCGKN"))
    if np.linalg.matrix_rank(M) < n:
        weakest = linear.coordinates[int(np.argmin(np.abs(np.diag(M))))]
        raise SingularError(
            f"the mass matrix is singular (near coordinate {weakest!r}): a state space needs a mass there"
        )
    solved = np.linalg.solve(M, np.hstack([K + N, C + G, linear.F]))
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:] = -solved[:, : 2 * n]
    B = np.zeros((2 * n, linear.F.shape[1]))
    B[n:] = solved[:, 2 * n :]
    return A, B


def _direct(linear: LinearSystem, C: np.ndarray, powers: list[np.ndarray], q: int) -> np.ndarray:
    """Matrix that multiplies u itself; refuses outputs that see u' or u"."""
    n_out, n_in = C.shape[0], linear.F.shape[1]
    D = np.zeros((n_out, n_in))
    for j in range(n_in):
        m = int(linear.order_in[j]) + q
        for r in range(max(m, q + 1)):
            through = C @ powers[m - 1 - r][:, j] if m > r else np.zeros(n_out)
            feed = linear.D0[:, j] if linear.D0 is not None and r == q else np.zeros(n_out)
            total = through + feed
            total[np.abs(total) <= _core.NO_FEEDTHROUGH * np.maximum(np.abs(through), np.abs(feed))] = 0.0
            if r == 0:
                D[:, j] = total
            elif np.any(total):
                worst = linear.outputs[int(np.argmax(np.abs(total)))]
                name = [*linear.inputs, *(linear.inputs[i] for i in linear.shared)][j]
                raise ModelError(
                    f"output {worst!r} depends on derivative {r} of input {name!r}: there is no state "
                    "space; take a lower derivative of the output, or drive the base by its acceleration"
                )
    return D
