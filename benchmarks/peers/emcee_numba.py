"""emcee on hand-written numba simulations.

    python -m benchmarks.peers.emcee_numba TASK --kernel loop --moves stretch --seed 0

All walkers are evaluated in one compiled call on all cores.  The moves are the stretch move,
emcee's default, or the mixture of differential evolution and snooker updates that emcee's
documentation recommends against long autocorrelation times.  The walkers start from the normal
approximation, so the burn-in is short.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable
from pathlib import Path

import emcee
import numpy as np
from numpy.typing import NDArray

from benchmarks import handwritten
from benchmarks.peers import kernels
from benchmarks.peers.child import TARGET, Stopwatch, ess_min, posterior_line, report
from benchmarks.peers.task import Task

__all__ = ["MOVES", "WALKERS", "density_of", "main"]

Array = NDArray[np.float64]

_CHUNK = 100
_LONGEST_S = 120.0
MOVES: dict[str, list[tuple[emcee.moves.Move, float]]] = {
    "stretch": [(emcee.moves.StretchMove(), 1.0)],
    "de": [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)],
}


WALKERS = {"loop": 32, "lanes": 4 * kernels.LANES}
"""Number of walkers by kernel: that of the package, or full lanes of both halves on two cores."""


def density_of(task: Task, kernel: str) -> Callable[[Array], Array]:
    """Log density of points (n_point, 9) by a numba kernel.

    Args:
        task: Data and posterior.
        kernel: ``loop`` for one scalar simulation per walker, ``lanes`` for the hand-tuned kernel
            with several walkers per processor instruction.
    """
    data = (float(task.interval[0]), task.voltage, task.temperature, task.current, task.speed)
    substeps = int(task.substeps[0])

    def density(points: Array) -> Array:
        values, starts = task.values(points), task.starts(points)
        if kernel == "lanes":
            sums = kernels.nominal_in_lanes(values, *data, starts)
        else:
            sums = handwritten.sums_of_all_walkers(values, *data, starts, substeps)
        return task.log_density(points, np.asarray(sums))

    return density


def _burn_in(chain: Array) -> int:
    """Burn-in by the rule of the package: three autocorrelation times, a tenth to a half."""
    steps = chain.shape[0]
    tau = float(np.max(emcee.autocorr.integrated_time(chain, quiet=True)))
    return int(np.clip(3.0 * tau, steps // 10, steps // 2))


def main() -> None:
    """Sample until the target and print the line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", type=Path)
    parser.add_argument("--kernel", choices=("loop", "lanes"), default="loop")
    parser.add_argument("--moves", choices=tuple(MOVES), default="stretch")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    task, watch = Task.load(chosen.task), Stopwatch()
    density = density_of(task, chosen.kernel)
    logging.disable(logging.WARNING)  # of short chains, which the target excludes
    start = task.started(chosen.seed, WALKERS[chosen.kernel])
    with watch.timed("first call"):
        density(start)
    np.random.seed(chosen.seed)  # noqa: NPY002  emcee reads the global generator
    sampler = emcee.EnsembleSampler(
        *start.shape, density, vectorize=True, moves=MOVES[chosen.moves]
    )
    state: object = start
    while True:
        with watch.timed("sampling"):
            state = sampler.run_mcmc(state, _CHUNK, skip_initial_state_check=True)
        burn = _burn_in(sampler.get_chain())
        chain = task.physical(sampler.get_chain(discard=burn))
        if ess_min(chain) >= TARGET or watch.wall["sampling"] > _LONGEST_S:
            break
    line = posterior_line(watch, chain, chain.shape[0] / sampler.iteration)
    line["acceptance"] = float(np.mean(sampler.acceptance_fraction))
    line["steps"], line["evaluations"] = sampler.iteration, sampler.iteration * start.shape[0]
    report(line, ("emcee", "numba", "numpy"))


if __name__ == "__main__":
    main()
