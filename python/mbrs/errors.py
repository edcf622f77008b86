"""Errors and warnings. Every message names the object and the remedy."""

from __future__ import annotations

from typing import Any


class MbrsError(Exception):
    """Base of all errors raised by mbrs."""


class ModelError(MbrsError, ValueError):
    """The model, or an argument of an analysis, is wrong: a name, a shape, a value."""


class NameNotFoundError(ModelError):
    """A name or address that the model does not know; the message proposes the nearest known one."""


class DuplicateNameError(ModelError):
    """A name that is already taken in this model."""


class FileError(MbrsError, OSError):
    """A file cannot be written; ``filename``, ``errno`` and ``strerror`` are those of the operating system."""

    def __str__(self) -> str:
        return f"cannot write {self.filename}: {self.strerror}; give a path in a folder that is there, may be written and has room"


class InertiaError(ModelError):
    """A mass or an inertia that no body can have."""


class RouteError(ModelError):
    """The sparse solver does not support a feature of this model, which is too large for the dense one, or the arrays of an
    analysis do not fit into memory. The message gives sizes and what to do instead."""


class AssemblyError(MbrsError):
    """Loops that cannot close, or joints that contradict each other; the message says by how much."""


class SingularError(MbrsError):
    """A mass matrix, a stiffness or a constraint matrix is singular where it must not be."""


class ConvergenceError(MbrsError):
    """An iteration gave up. ``result`` carries what it had reached, or None."""

    def __init__(self, message: str, result: object = None) -> None:
        super().__init__(message)
        self.result: Any = result


class StoreError(MbrsError):
    """The folder of a sweep cannot be used: another sweep has it, it belongs to another model, the disk is full. ``result`` carries
    what was computed before, or None.
    """

    def __init__(self, message: str, result: object = None) -> None:
        super().__init__(message)
        self.result: Any = result


class DesignError(MbrsError):
    """A design of a sweep with ``on_error="raise"`` failed; ``design`` is its index, ``result`` carries the runs so far."""

    def __init__(self, message: str, design: int = -1, result: object = None) -> None:
        super().__init__(message)
        self.design, self.result = design, result


class NotDifferentiableError(MbrsError):
    """A derivative that does not exist, such as that of a redundant loop which the parameter breaks open."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in a motion, a study or a sweep. ``result`` carries what there is so far, its ``status`` is "interrupted"; None where
    there is nothing yet.

    It is a KeyboardInterrupt, so that loops around an analysis stop and ``except Exception`` does not catch it.

    Examples
    --------
    >>> import mbrs as mb
    >>> try:
    ...     raise mb.Interrupted("a motion was interrupted at t = 3 s", result=[0.0, 1.5, 3.0])
    ... except KeyboardInterrupt as cut:
    ...     cut.result
    [0.0, 1.5, 3.0]
    """

    def __init__(self, message: str = "interrupted", result: object = None) -> None:
        super().__init__(message, result)
        self.result: Any = result

    def __str__(self) -> str:
        return str(self.args[0])


class MbrsWarning(UserWarning):
    """Base of all warnings of mbrs."""


class DoubtfulWarning(MbrsWarning):
    """The mobility of a loop depends on the accuracy of the drawing; the message names its joints and the decision."""


class OmissionWarning(MbrsWarning):
    """A file has what mbrs does not have, or the other way round; ``omissions`` lists (object, feature) of everything left out."""

    def __init__(self, message: str, omissions: tuple[Any, ...] = ()) -> None:
        super().__init__(message, omissions)
        self.omissions = omissions

    def __str__(self) -> str:
        return str(self.args[0])


class KinkWarning(MbrsWarning):
    """A motion that was differentiated passed a place where it is not differentiable; the message says when and where."""
