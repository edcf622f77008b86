"""The Rust core: typed by hand and checked by stubtest. Not public; its results are wrapped by the modules of mbrs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_F1 = NDArray[np.float64]
_F2 = NDArray[np.float64]
_F3 = NDArray[np.float64]
_Ints = Sequence[int] | NDArray[np.int64]

__version__: str

class CoreError(Exception): ...
class CoreModelError(CoreError): ...
class CoreAssemblyError(CoreError): ...
class CoreSingularError(CoreError): ...
class CoreConvergenceError(CoreError): ...
class CoreNotDifferentiableError(CoreError): ...

class FrfReduction:
    """M, D, S reduced once; maps and frequencies come with each call."""

    def __new__(cls, m: _F2, d: _F2 | None, s: _F2) -> FrfReduction: ...
    @property
    def poles(self) -> NDArray[np.complex128] | None: ...
    @property
    def counts(self) -> dict[str, int]: ...
    def evaluate(
        self, l: _F2, f: _F2, order_in: _Ints, d0: _F2 | None, order_out: int, omega: _F1, modes: int | None = None
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

_Csc = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]

def sparse_modes(m: _Csc, d: _Csc | None, s: _Csc, n: int, sigma: float | None = None) -> dict[str, Any]: ...
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
def mixed_modes(m: _Csc, a: _Csc, n: int, sigma: float | None = None) -> dict[str, Any]: ...
