"""Fits of the nominal model by scipy and by pyPESTO, from a rough guess.

    python -m benchmarks.peers.fit TASK --program scipy
    python -m benchmarks.peers.fit TASK --program pypesto --optimizer ls_trf

Both use the residuals and the exact Jacobian of `sensitivities.py`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.peers.child import Stopwatch, limit_memory, report
from benchmarks.peers.sensitivities import LeastSquares
from benchmarks.peers.task import Task

__all__ = ["by_pypesto", "by_scipy", "main"]

Array = NDArray[np.float64]


class _Remembered:
    """Residuals and Jacobian of the latest point, so that each point is simulated once."""

    def __init__(self, problem: LeastSquares) -> None:
        self.problem = problem
        self.x: Array | None = None
        self.found: tuple[Array, Array] = (np.empty(0), np.empty((0, 0)))

    def __call__(self, x: Array) -> tuple[Array, Array]:
        if self.x is None or not np.array_equal(x, self.x):
            self.x, self.found = x.copy(), self.problem.residuals(x)
        return self.found


def by_scipy(problem: LeastSquares) -> tuple[Array, str]:
    """Optimum of scipy's trust region method, and its message."""
    at = _Remembered(problem)
    found = least_squares(
        lambda x: at(x)[0], problem.start, jac=lambda x: at(x)[1], x_scale="jac", method="trf"
    )
    return found.x, str(found.message)


def by_pypesto(problem: LeastSquares, optimizer: str) -> tuple[Array, str]:
    """Optimum of pyPESTO, and the message of its optimizer.

    Args:
        problem: Residuals and Jacobian.
        optimizer: ``ls_trf``, scipy's method on the residuals, or ``L-BFGS-B``, the default of
            pyPESTO, with the exact gradient.  Its fides has no wheels, so it cannot be locked.
    """
    import pypesto  # noqa: PLC0415  its memory is not that of scipy's fit
    import pypesto.optimize  # noqa: PLC0415

    def cost(x: Array) -> tuple[float, Array]:
        residual, jacobian = problem.residuals(x)
        return 0.5 * float(residual @ residual), jacobian.T @ residual

    if optimizer == "L-BFGS-B":
        objective = pypesto.Objective(fun=cost, grad=True)
        options: dict[str, object] = {"maxiter": 2000, "maxfun": 2000, "ftol": 1e-12}
    else:
        at = _Remembered(problem)
        objective = pypesto.Objective(
            fun=lambda x: 0.5 * float(at(x)[0] @ at(x)[0]),
            res=lambda x: at(x)[0],
            sres=lambda x: at(x)[1],
        )
        options = {"x_scale": "jac"}
    chosen = pypesto.optimize.ScipyOptimizer(optimizer, options=options)
    start = problem.start
    wide = np.where(np.arange(start.size) < 7, 2.0, 3.0)
    stated = pypesto.Problem(
        objective, lb=start - wide, ub=start + wide, x_guesses=[start], copy_objective=False
    )
    answer = pypesto.optimize.minimize(
        stated, chosen, n_starts=1, progress_bar=False, filename=None
    )
    best = answer.optimize_result.list[0]
    return np.asarray(best.x), str(best.message)


def main() -> None:
    """Fit twice, the first time to compile, and print the line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", type=Path)
    parser.add_argument("--program", choices=("scipy", "pypesto"), default="scipy")
    parser.add_argument("--optimizer", choices=("ls_trf", "L-BFGS-B"), default="ls_trf")
    chosen = parser.parse_args()
    limit_memory()
    task, watch = Task.load(chosen.task), Stopwatch()
    solve: Callable[[LeastSquares], tuple[Array, str]] = by_scipy
    if chosen.program == "pypesto":
        solve = lambda problem: by_pypesto(problem, chosen.optimizer)  # noqa: E731
    with watch.timed("first call"):
        solve(LeastSquares(task))
    problem = LeastSquares(task)
    with watch.timed("fit"):
        x, message = solve(problem)
    line = {**watch.line(), "values": problem.values(x).tolist(), "message": message}
    line["simulations"] = problem.calls
    packages = ("scipy", "numba", "numpy")
    report(line, packages if chosen.program == "scipy" else ("pypesto", *packages))


if __name__ == "__main__":
    main()
