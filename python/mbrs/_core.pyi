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
    "ENTRY_ROUNDING",
    "HIGH_LOAD",
    "MOST_ANNULUS_STEPS",
    "NO_FEEDTHROUGH",
    "SAME_ROOT",
    "SMALLEST_INFLOW",
    "CoreAssemblyError",
    "CoreConvergenceError",
    "CoreError",
    "CoreModelError",
    "CoreNotDifferentiableError",
    "CoreRouteError",
    "CoreSingularError",
    "DesignPlan",
    "HbmBranch",
    "HbmElements",
    "HbmLinear",
    "HbmProblem",
    "KeptMotion",
    "MotionForward",
    "Program",
    "RootInverse",
    "SecondOrder",
    "System",
    "__version__",
    "available_memory",
    "check_symmetry",
    "directions",
    "eigen_sensitivities",
    "induced_velocity",
    "law_at_rest",
    "law_force",
    "law_relaxations",
    "missed_resonances",
    "mixed_modes",
    "motion_air",
    "motion_breaks",
    "motion_directions",
    "motion_has_kinks",
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

BALANCED: float
ENTRY_ROUNDING: float
HIGH_LOAD: float
MOST_ANNULUS_STEPS: int
NO_FEEDTHROUGH: float
SAME_ROOT: float
SMALLEST_INFLOW: float

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

# L, F, order_in, D0
_Maps = tuple[_F2, _F2, _Ints, _F2 | None]
# t, u, bulge, x0, v0
_Loads = tuple[_F1, _F2, _F2, _F1, _F1]
# number of parameters, dM, dD, dS, dF, dL, dD0
_Changes = tuple[int, *tuple[_F3 | None, ...]]

@final
class SecondOrder:
    """M, C, G, K, N with what is derived from them, each of it once; maps, frequencies and loads come with each call."""

    def __new__(cls, m: _F2, c: _F2 | None, g: _F2 | None, k: _F2, n: _F2 | None) -> SecondOrder: ...
    @property
    def size(self) -> int: ...
    @property
    def M(self) -> _F2: ...
    @property
    def C(self) -> _F2 | None: ...
    @property
    def G(self) -> _F2 | None: ...
    @property
    def K(self) -> _F2: ...
    @property
    def N(self) -> _F2 | None: ...
    def is_light(self) -> bool: ...
    def modes(self, kf: _F2 | None = None, mf: _F2 | None = None) -> dict[str, Any]: ...
    def is_strained(self, factor: _F2, shape: _F2) -> bool: ...
    def poles(self) -> tuple[NDArray[np.complex128] | None, dict[str, int]]: ...
    def evaluate(
        self, maps: _Maps, order_out: int, omega: _F1, modes: int | None = None, checked: bool = True
    ) -> dict[str, Any]: ...
    def sensitivity(self, maps: _Maps, order_out: int, omega: _F1, changes: _Changes) -> dict[str, Any]: ...
    def response(self, maps: _Maps, loads: _Loads) -> dict[str, Any]: ...
    def response_sensitivity(self, maps: _Maps, loads: _Loads, changes: _Changes) -> list[dict[str, Any]]: ...

def eigen_sensitivities(system: SecondOrder, modes: Any, changes: Any) -> dict[str, Any]: ...
def shape_sensitivities(system: SecondOrder, modes: Any, changes: Any, ds: np.ndarray) -> dict[str, Any]: ...

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
        held: Sequence[float] = ...,
    ) -> dict[str, Any]: ...
    def stiffness_factor(self, q: _F1, without: Sequence[str]) -> _F2 | None: ...
    def is_loaded(self, q: _F1, without: Sequence[str]) -> bool: ...
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
        held: Sequence[float] | None = None,
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
class KeptMotion: ...

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
def motion_has_kinks(system: System, without: Sequence[str], with_sliders: bool) -> bool: ...
def motion_is_explicit(
    system: System,
    q: _F1,
    rate: _F1,
    memory: Sequence[float],
    without: Sequence[str],
    span: tuple[float, float],
    step: float | None = None,
) -> bool: ...
def motion_quadrature(
    system: System, scheme: str, times: list[float], orders: list[int], kinks: list[float]
) -> tuple[list[float], list[float]]: ...
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
def law_at_rest(code: int, values: list[float], u: float, memory: list[float]) -> tuple[list[float], float]: ...

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
        parts: Sequence[Any],
    ) -> HbmElements: ...
    def slopes(
        self, element: int, phase: float, u: Sequence[float], v: Sequence[float]
    ) -> tuple[list[float], list[float], list[float]]: ...

@final
class HbmLinear:
    @staticmethod
    def full(system: SecondOrder, forces: NDArray[np.complex128]) -> HbmLinear: ...
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
    def half_bandwidth(self) -> int | None: ...
    def products(self, terms: int) -> float: ...
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
        *,
        tolerance: float,
        max_iterations: int,
        ramp: bool = True,
    ) -> dict[str, Any]: ...
    def estimate(self, y: NDArray[np.float64], at: tuple[list[float], float, float | None]) -> float: ...
    def cycle(
        self, z: NDArray[np.float64], at: tuple[list[float], int], *, tolerance: float, max_iterations: int
    ) -> dict[str, Any]: ...
    def floquet(
        self,
        y: NDArray[np.float64],
        omega: list[float],
        *,
        error: float = 0.0,
        free: bool = False,
        monodromy: bool = False,
        model: Any = None,
    ) -> dict[str, Any]: ...
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
        at: tuple[list[float], float],
        path: dict[str, Any],
        options: dict[str, Any],
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
    options: dict[str, Any],
    inverse: RootInverse | None,
) -> dict[str, Any]: ...
