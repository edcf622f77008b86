"""The Rust core: typed by hand and checked by stubtest. Not public; its results are wrapped by the modules of mbrs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

class CoreError(Exception): ...
class CoreModelError(CoreError): ...
class CoreAssemblyError(CoreError): ...
class CoreSingularError(CoreError): ...
class CoreConvergenceError(CoreError): ...
class CoreNotDifferentiableError(CoreError): ...

def law_force(
    code: int, values: list[float], u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]: ...

class HbmElements:
    def __new__(
        cls,
        code: list[int],
        count: list[int],
        values: list[float],
        start: list[int],
        index: list[int],
        weight: list[float],
    ) -> HbmElements: ...

class HbmLinear:
    @staticmethod
    def full(
        m: NDArray[np.float64], c: NDArray[np.float64], k: NDArray[np.float64], forces: NDArray[np.complex128]
    ) -> HbmLinear: ...
    @staticmethod
    def sparse(
        n: int, row: Any, column: Any, m: Any, c: Any, k: Any, retained: Any, forces: NDArray[np.complex128]
    ) -> HbmLinear: ...
    @staticmethod
    def modal(
        retained: list[int],
        local: list[int],
        rr: Any,
        lr: Any,
        stiffness: NDArray[np.float64],
        damping: NDArray[np.float64],
        shape: NDArray[np.float64],
        forces: NDArray[np.complex128],
    ) -> HbmLinear: ...
    @property
    def size(self) -> int: ...

class HbmProblem:
    def __new__(
        cls,
        linear: HbmLinear,
        elements: HbmElements,
        indices: list[list[int]],
        subharmonic: int,
        omega: list[float],
        dims: list[int],
        extra: list[list[int]],
        fine: list[int],
    ) -> HbmProblem: ...
    @property
    def size(self) -> int: ...
    def residual(self, y: NDArray[np.float64], omega: list[float]) -> dict[str, Any]: ...
    def solve(
        self,
        y: NDArray[np.float64],
        omega: list[float],
        level: float = 1.0,
        tolerance: float = 1e-10,
        max_iterations: int = 50,
    ) -> dict[str, Any]: ...
    def cycle(
        self, z: NDArray[np.float64], tolerance: float = 1e-10, max_iterations: int = 50
    ) -> dict[str, Any]: ...
    def floquet(
        self, y: NDArray[np.float64], omega: list[float], monodromy: bool = False
    ) -> tuple[NDArray[np.complex128] | None, NDArray[np.float64] | None]: ...
    def peak(
        self, y: NDArray[np.float64], omega: float, level: float, coordinate: int, term: int | None
    ) -> tuple[float, NDArray[np.float64]]: ...
    def expand(self, y: NDArray[np.float64], omega: list[float]) -> NDArray[np.float64]: ...
    def restrict(self, x: NDArray[np.float64]) -> NDArray[np.float64]: ...

class HbmBranch:
    def __new__(
        cls,
        problem: HbmProblem,
        y: NDArray[np.float64],
        omega: list[float],
        level: float,
        parameter: str,
        begin: float,
        start: float,
        stop: float,
        *,
        predictor: str,
        corrector: str,
        first_step: float,
        least_step: float,
        largest_step: float,
        tolerance: float,
        stability: bool,
        events: bool,
        towards: NDArray[np.float64] | None = None,
    ) -> HbmBranch: ...
    def run(self, points: int, seconds: float) -> dict[str, Any]: ...
