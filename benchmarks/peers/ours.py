"""Measurements of motorid: posterior, fit and cost of one evaluation.

    python -m benchmarks.peers.ours posterior TASK --seed 0
    python -m benchmarks.peers.ours fit TASK

The first pass compiles; the second is measured.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.handwritten import Recording
from benchmarks.peers.child import Stopwatch, limit_memory, posterior_line, report
from benchmarks.peers.task import Task
from benchmarks.speed import as_runs
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.model.excitation import Record, records_of
from identification.posterior.density import Posterior
from identification.posterior.sample import sample

__all__ = ["fit_line", "main", "records_of_task", "sampled"]


_CHUNK = 10
"""Steps of the sampler between two reports of its progress."""


def records_of_task(task: Task) -> list[Record]:
    """Records of the package from the data of a task."""
    data = Recording(
        float(task.interval[0]),
        task.voltage,
        task.logged_temperature,
        task.current,
        task.speed,
    )
    return records_of(as_runs(data))


def sampled(task: Task, seed: int) -> dict[str, Any]:
    """Line of the posterior.

    The chain ends by the rule of the package, 50 autocorrelation times.  Preparing the density and
    the burn-in count as warm-up.
    """
    fit = fit_declared(records_of_task(task), "zoh")
    watch = Stopwatch()
    with watch.timed("first call"):
        sample(Posterior(fit, 1.0), seed + 1)
    chunks: list[float] = []
    with watch.timed("warm-up"):
        posterior = Posterior(fit, 1.0)
        posterior(posterior.normal_points(seed, 8))
    with watch.timed("sampling"):
        found = sample(posterior, seed, progress=chunks.append)
    if found.source != "chain":
        raise RuntimeError(f"the chain did not converge; the draws are from {found.source}")
    chain = np.asarray(found.chain)
    steps = _CHUNK * len(chunks)
    line = posterior_line(watch, chain, chain.shape[0] / steps)
    line["acceptance"], line["steps"] = found.convergence.acceptance, steps
    line["evaluations"] = steps * chain.shape[1]
    line["density_difference"] = _difference(task, posterior)
    return line


def _difference(task: Task, posterior: Posterior) -> float:
    """Largest difference of the log densities of the package and of the hand-tuned kernel.

    At 32 draws, relative to the optimum.  The normal approximation falls by about 4.5 there.
    """
    from benchmarks.peers.emcee_numba import density_of  # noqa: PLC0415  compiled after all times

    points = np.vstack([task.centre, task.started(9, 31)])
    pairs = [density_of(task, "lanes")(points), posterior(points)]
    theirs, ours = (density - density[0] for density in pairs)
    return float(np.abs(theirs - ours).max())


def fit_line(task: Task) -> dict[str, Any]:
    """Line of a fit without starting values."""
    watch = Stopwatch()
    with watch.timed("first call"):
        fit_declared(records_of_task(task), "zoh")
    with watch.timed("fit"):
        fit: Fit = fit_declared(records_of_task(task), "zoh")
    return {**watch.line(), "values": fit.values.tolist(), "converged": fit.converged}


def main() -> None:
    """Measure and print the line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("posterior", "fit"))
    parser.add_argument("task", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    limit_memory()
    task = Task.load(chosen.task)
    line = sampled(task, chosen.seed) if chosen.what == "posterior" else fit_line(task)
    report(line, ("emcee", "casadi", "llvmlite", "numpy"))


if __name__ == "__main__":
    main()
