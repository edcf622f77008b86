"""The Rust core: typed by hand and checked by stubtest. Not public; its results are wrapped by the modules of mbrs."""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

_F1 = NDArray[np.float64]
_F2 = NDArray[np.float64]
_F3 = NDArray[np.float64]
_Csc = tuple[NDArray[np.int64], NDArray[np.int64], _F1]
_Ints = Sequence[int] | NDArray[np.int64]

__version__: str

def available_memory() -> float: ...
def require_memory(bytes: float, what: str, remedy: str) -> None: ...

__all__ = [
    "BALANCED",
    "SAME_ROOT",
    "CoreAssemblyError",
    "CoreConvergenceError",
    "CoreError",
    "CoreModelError",
    "CoreNotDifferentiableError",
    "CoreRouteError",
    "CoreSingularError",
    "DesignPlan",
    "FrfReduction",
    "HbmBranch",
    "HbmElements",
    "HbmLinear",
    "HbmProblem",
    "MotionForward",
    "Program",
    "RootInverse",
    "System",
    "__version__",
    "available_memory",
    "check_symmetry",
    "dense_modes",
    "directions",
    "eigen_sensitivities",
    "induced_velocity",
    "is_strained",
    "law_force",
    "law_relaxations",
    "missed_resonances",
    "mixed_modes",
    "motion_air",
    "motion_breaks",
    "motion_directions",
    "motion_is_explicit",
    "motion_of_element",
    "motion_of_joint",
    "motion_quadrature",
    "motion_quantities",
    "motion_reactions",
    "operation",
    "require_memory",
    "resonances",
    "root_solve",
    "shape_sensitivities",
    "simulate_motion",
    "sparse_count",
    "sparse_frf",
    "sparse_model_form",
    "sparse_model_modes",
    "sparse_modes",
    "unseen_resonances",
]

class CoreError(Exception): ...
class CoreModelError(CoreError): ...
class CoreRouteError(CoreModelError): ...
class CoreAssemblyError(CoreError): ...
class CoreSingularError(CoreError): ...
class CoreConvergenceError(CoreError): ...
class CoreNotDifferentiableError(CoreError): ...

def dense_modes(
    m: np.ndarray,
    c: np.ndarray | None,
    g: np.ndarray | None,
    k: np.ndarray,
    n: np.ndarray | None,
    kf: np.ndarray | None,
    mf: np.ndarray | None = None,
) -> dict[str, Any]: ...

BALANCED: float
SAME_ROOT: float

# body, its point, direction, rotation?, base?
_DesignPort = tuple[int | None, tuple[str, list[float], int], list[float], bool, bool]

@final
class DesignPlan:
    def __new__(
        cls,
        system: System,
        parameters: Sequence[float],
        columns: Sequence[tuple[int | None, Sequence[int]]],
        nodes: Sequence[tuple[Any, Any]],
        driven: Sequence[tuple[int, int]],
        rules: Sequence[tuple[str, int, int]],
        by: Sequence[tuple[int | None, Sequence[int]]],
        equilibrium: bool,
    ) -> DesignPlan: ...
    def modes(self, n: int | None, elastic: bool | None) -> DesignPlan: ...
    def transfer(
        self, inputs: Sequence[_DesignPort], outputs: Sequence[_DesignPort], omega: Sequence[float], order_out: int
    ) -> DesignPlan: ...
    def rest(self) -> DesignPlan: ...
    def compute(self, rows: _F2, threads: int) -> dict[str, Any]: ...

def resonances(poles: NDArray[np.complex128], low: float, high: float) -> NDArray[np.complex128]: ...
def unseen_resonances(poles: NDArray[np.complex128], omega: Sequence[float] | _F1) -> list[float]: ...
def missed_resonances(
    omega: Sequence[float] | _F1,
    h: NDArray[np.complex128],
    suspects: Sequence[float],
    peaks: NDArray[np.complex128],
) -> list[float]: ...
def is_strained(factor: _F2, shape: _F2, mass: _F2) -> bool: ...
def sparse_model_modes(
    system: System,
    q: _F1,
    rate: _F1,
    acceleration: Sequence[float],
    without: Sequence[str],
    n: int,
    sigma: float | None = None,
) -> dict[str, Any]: ...
def sparse_model_form(
    system: System, q: _F1, rate: _F1, acceleration: Sequence[float], without: Sequence[str]
) -> dict[str, Any]: ...

@final
class FrfReduction:
    """M, D, S reduced once; maps and frequencies come with each call."""

    def __new__(cls, m: _F2, d: _F2 | None, s: _F2) -> FrfReduction: ...
    @property
    def poles(self) -> NDArray[np.complex128] | None: ...
    @property
    def counts(self) -> dict[str, int]: ...
    def evaluate(
        self,
        l: _F2,
        f: _F2,
        order_in: _Ints,
        d0: _F2 | None,
        order_out: int,
        omega: _F1,
        modes: int | None = None,
        checked: bool = True,
    ) -> dict[str, Any]: ...
    def sensitivity(
        self,
        l: _F2,
        f: _F2,
        order_in: _Ints,
        d0: _F2 | None,
        order_out: int,
        omega: _F1,
        n_p: int,
        dm: _F3 | None,
        dd: _F3 | None,
        ds: _F3 | None,
        df: _F3 | None,
        dl: _F3 | None,
        dd0: _F3 | None,
    ) -> dict[str, Any]: ...
    def response(
        self, l: _F2, f: _F2, order_in: _Ints, d0: _F2 | None, t: _F1, u: _F2, bulge: _F2, x0: _F1, v0: _F1
    ) -> dict[str, Any]: ...
    def response_sensitivity(
        self,
        l: _F2,
        f: _F2,
        order_in: _Ints,
        d0: _F2 | None,
        t: _F1,
        u: _F2,
        bulge: _F2,
        x0: _F1,
        v0: _F1,
        n_p: int,
        dm: _F3 | None,
        dd: _F3 | None,
        ds: _F3 | None,
        df: _F3 | None,
        dl: _F3 | None,
        dd0: _F3 | None,
    ) -> list[dict[str, Any]]: ...

def eigen_sensitivities(matrices: Any, modes: Any, changes: Any) -> dict[str, Any]: ...
def shape_sensitivities(matrices: Any, modes: Any, changes: Any, ds: np.ndarray) -> dict[str, Any]: ...

_Direction = tuple[Sequence[int], Sequence[float]]

@final
class System:
    """A compiled model: immutable; states are (q, rate)."""

    def __new__(cls, tables_dict: dict[str, Any]) -> System: ...
    @property
    def n_bodies(self) -> int: ...
    @property
    def n_q(self) -> int: ...
    @property
    def n_tree(self) -> int: ...
    @property
    def characteristic_length(self) -> float: ...
    def remoteness(self, q: _F1) -> float: ...
    def with_values(self, x: _F1) -> System: ...
    def topology(self) -> dict[str, Any]: ...
    def assemble(self, hold: bool = False, without: Sequence[str] = ...) -> dict[str, Any]: ...
    def bodies(self, q: _F1, rate: _F1) -> dict[str, Any]: ...
    def equilibrium(self, q: _F1, without: Sequence[str]) -> dict[str, Any]: ...
    def linearize(
        self,
        q: _F1,
        rate: _F1,
        without: Sequence[str],
        memory: Sequence[float] = ...,
        acceleration: Sequence[float] = ...,
        turn: _F2 | None = ...,
        raw: bool = ...,
    ) -> dict[str, Any]: ...
    def stiffness_factor(self, q: _F1, without: Sequence[str]) -> _F2 | None: ...
    def mobility(self, q: _F1) -> dict[str, Any]: ...
    def doubts(self, without: Sequence[str] = ...) -> list[tuple[list[str], float, bool, float]]: ...
    def advance(self, q: _F1, increments: _F1, without: Sequence[str] = ...) -> _F1: ...
    def air_states(
        self,
        q: _F1,
        rate: _F1,
        without: Sequence[str],
        acceleration: Sequence[float] = ...,
        turn: _F2 | None = None,
    ) -> dict[str, Any] | None: ...
    def law_places(self, q: _F1, rate: _F1) -> list[tuple[int, int, int, _F1, _F1, float, float]]: ...
    def function_places(self, q: _F1, rate: _F1) -> list[tuple[int, int, int, _F1, _F2, list[float], list[float]]]: ...
    def rate_mismatch(self, q: _F1, rate: _F1, without: Sequence[str] = ...) -> float: ...
    def rows(self, q: _F1, rate: _F1, t: float, without: Sequence[str]) -> dict[str, Any]: ...
    def strains(self, q: _F1, without: Sequence[str], twist: _F2, position: _F2) -> dict[str, Any]: ...
    def reactions(self, q: _F1, rate: _F1, without: Sequence[str]) -> _F2: ...

def simulate_motion(
    system: System,
    q: _F1,
    rate: _F1,
    without: Sequence[str],
    options: dict[str, Any],
    report: Callable[[float], None] | None = None,
) -> dict[str, Any]: ...

@final
class MotionForward:
    def __new__(
        cls, system: System, q: _F1, rate: _F1, without: Sequence[str], options: dict[str, Any]
    ) -> MotionForward: ...
    def values(self) -> _F2: ...
    def kinks(self) -> list[tuple[float, str, str]]: ...
    def counts(self) -> dict[str, int]: ...
    def gradient(self, seeds: _F2) -> tuple[_F1, dict[str, int]]: ...

def motion_breaks(system: System, start: float) -> list[float]: ...
def motion_directions(
    system: System, q: _F1, rate: _F1, without: Sequence[str], options: dict[str, Any]
) -> dict[str, Any]: ...
def motion_is_explicit(
    system: System,
    q: _F1,
    rate: _F1,
    memory: Sequence[float],
    without: Sequence[str],
    span: tuple[float, float],
    step: float | None = None,
) -> bool: ...
def motion_quadrature(scheme: str) -> tuple[float, float, list[tuple[float, float]]]: ...
def motion_of_element(
    system: System, element: int, t: _F1, q: _F2, rate: _F2, memory: _F2, without: Sequence[str]
) -> _F3: ...
def motion_of_joint(system: System, joint: int, t: _F1, q: _F2, rate: _F2, memory: _F2) -> _F2: ...
def motion_quantities(
    system: System,
    t: _F1,
    q: _F2,
    rate: _F2,
    memory: _F2,
    acceleration: _F2,
    without: Sequence[str],
) -> dict[str, Any]: ...
def motion_air(system: System, t: _F1, q: _F2, rate: _F2, memory: _F2) -> _F3: ...
def motion_reactions(
    system: System,
    t: _F1,
    q: _F2,
    rate: _F2,
    memory: _F2,
    acceleration: _F2,
    multipliers: _F2,
    without: Sequence[str],
) -> _F3: ...
def operation(name: str, values: Any) -> float: ...
def law_force(
    code: int, values: list[float], u: NDArray[np.float64], v: NDArray[np.float64]
) -> NDArray[np.float64]: ...
def law_relaxations(code: int, values: list[float], u: float) -> list[tuple[float, float]]: ...

@final
class Program:
    def __new__(cls, nodes: Any, roots: Any) -> Program: ...
    def values(self, inputs: Any) -> list[float]: ...
    def gradient(self, node: int, values: Any) -> tuple[list[tuple[int, float]], int | None]: ...
    def uses(self) -> list[bool]: ...

@final
class HbmElements:
    def __new__(
        cls,
        code: list[int],
        count: list[int],
        values: list[float],
        functions: list[Any],
        start: list[int],
        index: list[int],
        weight: list[float],
    ) -> HbmElements: ...

@final
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
        matrices: Any,
    ) -> HbmLinear: ...
    @property
    def retained(self) -> list[int]: ...
    @property
    def size(self) -> int: ...

@final
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
    def with_family(self, family: Any, value: float, step: float) -> None: ...
    def residual(
        self,
        y: NDArray[np.float64],
        omega: list[float],
        level: float = 1.0,
        parameter: str = "omega",
        value: float | None = None,
    ) -> dict[str, Any]: ...
    def solve(
        self,
        y: NDArray[np.float64],
        omega: list[float],
        level: float = 1.0,
        *,
        tolerance: float,
        max_iterations: int,
    ) -> dict[str, Any]: ...
    def cycle(self, z: NDArray[np.float64], *, tolerance: float, max_iterations: int) -> dict[str, Any]: ...
    def floquet(
        self, y: NDArray[np.float64], omega: list[float], monodromy: bool = False, model: Any = None
    ) -> tuple[NDArray[np.complex128] | None, NDArray[np.float64] | None]: ...
    def peak(
        self,
        y: NDArray[np.float64],
        omega: float,
        level: float,
        weights: NDArray[np.float64],
        term: int | None,
        towards: NDArray[np.float64] | None,
    ) -> tuple[float, NDArray[np.float64]]: ...
    def expand(self, y: NDArray[np.float64], omega: list[float], level: float = 1.0) -> NDArray[np.float64]: ...
    def restrict(self, x: NDArray[np.float64]) -> NDArray[np.float64]: ...

@final
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
        across: bool = False,
        model: Any = None,
    ) -> HbmBranch: ...
    def run(self, points: int, seconds: float) -> dict[str, Any]: ...

def directions(
    system: System,
    q: _F1,
    rate: _F1,
    without: Sequence[str],
    directions: Sequence[_Direction],
    follow: str,
    maps: bool,
    driven: Sequence[int] = ...,
    memory: Sequence[float] = ...,
) -> dict[str, Any]: ...
def induced_velocity(
    points: _F2,
    start: _F2,
    end: _F2,
    circulation: _F1,
    core_radius: _F1,
    core: str,
    exponent: float,
    threads: int,
) -> _F2: ...
def check_symmetry(name: str, gap: float, i: int, j: int) -> None: ...
def sparse_count(m: _Csc, k: _Csc, below: float) -> int | None: ...
def sparse_frf(
    m: _Csc,
    d: _Csc | None,
    s: _Csc,
    l: _F2,
    f: _F2,
    order_in: _Ints,
    d0: _F2 | None,
    order_out: int,
    omega: _F1,
) -> dict[str, Any]: ...
def sparse_modes(m: _Csc, d: _Csc | None, s: _Csc, n: int, sigma: float | None = None) -> dict[str, Any]: ...
def mixed_modes(m: _Csc, a: _Csc, n: int, sigma: float | None = None) -> dict[str, Any]: ...

@final
class RootInverse:
    n: int
    def __new__(cls, h: np.ndarray) -> RootInverse: ...
    def matrix(self) -> _F2 | None: ...
    def apply(self, r: np.ndarray) -> _F1: ...

def root_solve(
    function: Callable[[_F1], _F1],
    observer: Callable[[_F1, _F1], bool] | None,
    x0: Sequence[float] | _F1,
    broyden: bool,
    tolerance: float,
    rule: tuple[float, float, float, float, int, bool],
    guard: tuple[float, float, float],
    limits: tuple[int, int, int, int],
    fallback: bool,
    differences: float | None,
    pattern: tuple[Sequence[int], Sequence[int]] | None,
    memory: int | None,
    inverse: RootInverse | None,
) -> dict[str, Any]: ...
