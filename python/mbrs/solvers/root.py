"""``mb.root``: F(x) = 0 without derivatives, by inverse quasi-Newton updates and approximate norm descent."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import each, real_array, shown
from ..errors import ModelError
from .root_options import PATIENCE, Estimate, Limits, LineSearch, without_additions

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

    from .._lib.aliases import Sparse

_F1 = NDArray[np.float64]

_MESSAGES = {
    "converged": "the norm of the scaled residual is at most tol",
    "max-iterations": "the iteration limit was reached; raise maxiter or start nearer",
    "max-evaluations": "the limit of evaluations was reached; raise maxfev or start nearer",
    "line-search": "no step along the direction passed the line search; start elsewhere, or give scales",
    "stalled": "the norm no longer fell, which is also what a problem without a solution does; start elsewhere, "
    "or give scales",
    "stopped": "the callback stopped the iteration",
    "not-finite": "the estimate of the inverse Jacobian overflowed; give scales or another jac0",
}
_CODES = {name: i for i, name in enumerate(_MESSAGES)}


class _Function:
    """fun in scaled unknowns z = x / x_scale and scaled residuals f / f_scale, with its values checked."""

    def __init__(self, fun: Callable[..., Any], args: tuple[Any, ...], x_scale: _F1, f_scale: _F1) -> None:
        self.fun, self.args, self.x_scale, self.f_scale = fun, args, x_scale, f_scale
        # The start is evaluated before anything else, and not a second time.
        self.first: _F1 | None = None
        self.calls = 0

    def __call__(self, z: _F1) -> _F1:
        if self.first is None:
            return self.plain(z * self.x_scale) / self.f_scale
        value, self.first = self.first, None
        return value / self.f_scale

    def plain(self, x: _F1) -> _F1:
        value = np.asarray(self.fun(x, *self.args))
        self.calls += 1
        n = len(self.x_scale)
        if np.iscomplexobj(value):
            raise ModelError("fun returned complex numbers; split real and imaginary parts into separate equations")
        if value.size != n or value.ndim > 1:
            raise ModelError(
                f"fun returned an array of shape {value.shape} for {n} unknowns; return one residual for each unknown"
            )
        if value.dtype.kind not in "fiub":
            raise ModelError(f"fun returned {value.dtype} values; return an array of {n} real numbers")
        return np.ascontiguousarray(value, dtype=np.float64).reshape(n)


def root(
    fun: Callable[..., Any],
    x0: ArrayLike,
    args: tuple[Any, ...] = (),
    method: str = "inverse-bfgs",
    *,
    tol: float = 1e-10,
    plain: bool = False,
    jac0: str | ArrayLike | None = None,
    inverse0: ArrayLike | None = None,
    x_scale: ArrayLike = 1.0,
    f_scale: ArrayLike | str = 1.0,
    maxiter: int = 500,
    maxfev: int | None = None,
    memory: int | str | None = "auto",
    sparsity: ArrayLike | Sparse | None = None,
    fd_step: float = 1e-7,
    fallback: bool = True,
    restarts: int = 1,
    patience: int = PATIENCE,
    rho: float = 0.9,
    sigma1: float = 1e-3,
    sigma2: float = 1e-3,
    beta: float = 0.5,
    max_backtracks: int = 60,
    invariant: bool = True,
    curvature: float = 1e-12,
    determinant: tuple[float, float] = (1e-10, 1e10),
    callback: Callable[[_F1, _F1], Any] | None = None,
) -> OptimizeResult:
    """Solve F(x) = 0, n equations in n unknowns, from values of F alone.

    With the estimate H of the inverse Jacobian, every iteration takes d = -H F(x), searches a step s = lambda d and
    updates H with y = F(x + s) - F(x) so that H y = s::

        inverse-bfgs   H+ = (I - s y^T/(y^T s)) H (I - y s^T/(y^T s)) + s s^T/(y^T s)
        broyden        H+ = H + (s - H y) s^T H/(s^T H y)

    The step is the full one if |F(x + d)| <= rho |F| - sigma2 |d|^2, else the largest lambda = beta^i with
    |F(x + lambda d)| <= (1 + eta_k) |F| - sigma1 |lambda d|^2 and eta_k = 1/(k + 1)^2. BFGS keeps H symmetric if it
    starts so: it belongs to problems with a (nearly) symmetric Jacobian. On others it needs the start from
    differences and, often, the fallback; `docs/root.md` measures where.

    Parameters
    ----------
    fun
        ``fun(x, *args)`` returns n residuals for x (n,). NaN or infinite values away from x0 shorten the step; what
        it raises comes through unchanged.
    x0
        (n,) start, finite.
    method
        ``"inverse-bfgs"``, or ``"broyden"``: the same iteration with Broyden's first update.
    tol
        Success is the 2-norm of F(x)/f_scale at most tol.
    plain
        The algorithm of the source and nothing else: the search, the update and the test of its determinant, from
        the identity unless jac0 says otherwise. No fallback, restart, patience or scaled line search, no test of the
        curvature, all of H; arguments that ask for one of these are refused.
    jac0
        The first H: ``"fd"`` (default unless ``plain``), the inverse of a forward-difference Jacobian (n evaluations,
        fewer with ``sparsity``); ``"identity"``; or an array (n, n), an estimate of the Jacobian dF/dx, which is
        inverted. With limited memory and no ``sparsity`` the start is the identity.
    inverse0
        ``sol.inverse`` of an earlier solve with the same scales, or an array (n, n), the first H itself. jac0 is
        then used at restarts only.
    x_scale, f_scale
        Positive sizes of unknowns and residuals, numbers or (n,): the iteration sees x/x_scale and F/f_scale.
        ``f_scale="jac"`` (dense only) takes the largest entry of each row of the difference Jacobian at x0.
    maxiter, maxfev
        Limits of iterations and of evaluations of fun.
    memory
        Number of pairs (s, y) kept instead of H: O(memory n) per iteration. None keeps H, O(n^2); ``"auto"`` keeps H
        up to n = 2000 and 30 pairs above. ``"broyden"`` starts anew when the memory is full.
    sparsity
        (n, n) array or scipy.sparse matrix whose nonzero entries are those of the Jacobian: difference columns that
        share no row are then evaluated together, and with limited memory the start is kept as sparse factors.
    fd_step
        Increment of differences relative to max(1, abs(x/x_scale)).
    fallback, restarts, patience
        If the norm does not halve within ``patience`` iterations, H is formed anew from differences at the best point,
        ``restarts`` times; then, with ``fallback``, the update becomes Broyden's, from the best point and once more
        from x0. The message tells.
    rho, sigma1, sigma2, beta, max_backtracks
        Constants of the line search.
    invariant
        Multiply sigma1 and sigma2 by min(1, |F|/|d|^2) of the first direction after H was formed. Without it (the source)
        residuals that are small beside the square of the step are never reduced by a full step.
    curvature, determinant
        An update is left out if abs(y^T s) <= curvature abs(y) abs(s), or if abs(det H+/det H) leaves the
        interval; the ratio is -lambda s^T F/(y^T s) and costs nothing.
    callback
        ``callback(x, f)`` after every accepted step; returning True stops.

    Returns
    -------
    scipy.optimize.OptimizeResult
        ``x``, ``fun`` (residuals there), ``success``, ``status`` (0 for success), ``message``, ``reason`` (its
        name), ``nit``, ``nfev``, and ``n_backtracks``, ``norm`` (scaled), ``norms`` (of every iterate), ``inverse``
        (the last H: an array, or an object with ``apply`` for limited memory), ``n_skipped`` updates,
        ``n_restarts``, ``fallback`` (None or the iteration at which Broyden's update took over), ``method`` used.
        After a failure x is the best point that was met.

    Raises
    ------
    mbrs.ModelError
        Arguments or values of fun that cannot be used; the message says which and what to do.

    Notes
    -----
    Equations: docs/theory.md (19.1) to (19.4).
    J. Algorithms & Comput. Technol. (2017), doi 10.1177/1748301817729990; line search of D.-H. Li and M. Fukushima,
    Optim. Methods Softw. 13 (2000) 181-201. Deviations are listed in `docs/root.md`.
    Cost: n evaluations at the start, then 1 + backtracking steps per iteration, and O(n^2) or O(memory n) arithmetic.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> sol = mb.root(lambda x: [x[0] + x[1] ** 2 - 3, x[0] - np.exp(x[1]) + 1], [1.0, 1.0])
    >>> sol.success, bool(sol.norm < 1e-10)
    (True, True)
    """
    search = LineSearch(rho, sigma1, sigma2, beta, max_backtracks, invariant)
    limits = Limits(tol, maxiter, maxfev, patience, restarts, fallback)
    jac0 = ("identity" if plain else "fd") if jac0 is None else jac0
    estimate = Estimate(method, jac0, fd_step, memory, sparsity, curvature, determinant)
    if plain:
        search, limits, estimate = without_additions(search, limits, estimate)
    x = _start(x0)
    n = len(x)
    function = _Function(fun, args, _scale("x_scale", x_scale, n), np.ones(n))
    _check_start(function, x)
    if isinstance(f_scale, str):
        function.f_scale = _row_sizes(f_scale, function, x, fd_step)
    else:
        function.f_scale = _scale("f_scale", f_scale, n)
    inverse = _first_inverse(inverse0, estimate, function)
    options = {**search.core, **limits.core, **estimate.core(n)}
    with core_errors():
        found = _core.root_solve(function, _observer(callback, function), x / function.x_scale, options, inverse)
    return _result(found, function, method)


def _start(x0: ArrayLike) -> _F1:
    give = "give a one-dimensional array of at least one unknown, of a complex one its real and imaginary parts"
    x = real_array("x0", x0, None, give)
    return cast(_F1, real_array("x0", np.atleast_1d(x), ("n",), give))


def _check_start(function: _Function, x: _F1) -> None:
    if not callable(function.fun):
        raise ModelError(f"fun is a {type(function.fun).__name__}; give a function of x that returns the residuals")
    if not isinstance(function.args, tuple):
        function.args = (function.args,)
    value = function.plain(x.copy())
    bad = np.flatnonzero(~np.isfinite(value))
    if bad.size:
        raise ModelError(f"fun(x0)[{bad[0]}] is {value[bad[0]]}; start where all residuals are finite")
    function.first = value


def _scale(name: str, value: ArrayLike, n: int) -> _F1:
    scale = each(name, value, n, "unknowns")
    if not (scale > 0).all():
        raise ModelError(f"{name} must be positive, it is {shown(value)}")
    return scale


def _row_sizes(word: str, function: _Function, x: _F1, fd_step: float) -> _F1:
    if word != "jac":
        raise ModelError(f'f_scale is {shown(word)}; give numbers or "jac"')
    z = x / function.x_scale
    f = function(z) * function.f_scale
    function.first = f
    size = np.zeros_like(f)
    for j in range(len(z)):
        moved = z.copy()
        moved[j] += fd_step * max(1.0, abs(z[j]))
        column = np.abs(function.plain(moved * function.x_scale) - f) / (moved[j] - z[j])
        size = np.fmax(size, np.where(np.isfinite(column), column, 0.0))
    return np.where(size > 0, size, 1.0)


def _first_inverse(inverse0: Any, estimate: Estimate, function: _Function) -> _core.RootInverse | None:
    n, jac0 = len(function.x_scale), estimate.jac0
    if inverse0 is not None:
        if isinstance(inverse0, _core.RootInverse):
            if inverse0.n != n:
                raise ModelError(
                    f"inverse0 is of {inverse0.n} unknowns, but x0 has {n}; give the inverse of a solve of this size"
                )
            return inverse0
        return _core.RootInverse(_square("inverse0", inverse0, n))
    if isinstance(jac0, str):
        if jac0 not in ("fd", "identity"):
            raise ModelError(f'jac0 is {shown(jac0)}; give "fd", "identity" or an array ({n}, {n})')
        return None
    if estimate.pairs(n) is not None:
        raise ModelError("an array for jac0 needs the whole matrix; leave out memory, or give sparsity and jac0='fd'")
    jacobian = _square("jac0", jac0, n) * function.x_scale / function.f_scale[:, None]
    try:
        inverse = np.linalg.inv(jacobian)
    except np.linalg.LinAlgError:
        raise ModelError("jac0 is singular; give a regular estimate of the Jacobian, or 'fd'") from None
    return _core.RootInverse(np.ascontiguousarray(inverse))


def _square(name: str, value: Any, n: int) -> NDArray[np.float64]:
    return np.ascontiguousarray(real_array(name, value, (n, n), f"give an array ({n}, {n}), or leave it out"))


def _observer(callback: Callable[[_F1, _F1], Any] | None, function: _Function) -> Callable[[_F1, _F1], bool] | None:
    if callback is None:
        return None
    if not callable(callback):
        raise ModelError(f"callback is {shown(callback)}; give a function of x and the residuals")
    told = callback
    # Only True stops: many callbacks return what they append to or print.
    return lambda z, f: told(z * function.x_scale, f * function.f_scale) is True


def _result(found: dict[str, Any], function: _Function, method: str) -> Any:
    from scipy.optimize import OptimizeResult

    reason = found["status"]
    handle = found["inverse"]
    matrix = None if handle is None else handle.matrix()
    message = _MESSAGES[reason]
    if found["fallback"] is not None:
        message += f"; inverse BFGS stalled at iteration {found['fallback']}, Broyden's update took over"
    if found["singular"]:
        message += f"; {found['singular']} difference Jacobians were singular and replaced by a bounded stand-in"
    return OptimizeResult(
        x=found["x"] * function.x_scale,
        fun=found["fun"] * function.f_scale,
        success=reason == "converged",
        status=_CODES[reason],
        reason=reason,
        message=message,
        nit=found["iterations"],
        nfev=function.calls,
        n_backtracks=found["backtracks"],
        norm=float(np.linalg.norm(found["fun"])),
        norms=found["norms"],
        inverse=handle if matrix is None else matrix,
        n_skipped=found["skipped"],
        n_restarts=found["restarts"],
        fallback=found["fallback"],
        method="broyden" if found["broyden"] else method,
    )
