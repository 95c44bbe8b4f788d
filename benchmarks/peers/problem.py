"""Data and posterior of the comparison, written to a file for all programs.

python -m benchmarks.peers.problem out/peers/task-10000.npz --rows 10000
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks import handwritten
from benchmarks.handwritten import Recording
from benchmarks.peers.task import NAMES, Task
from benchmarks.speed import CASES, RUNS, as_runs, recorded
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.posterior.density import Posterior

__all__ = ["main", "recording_of", "runs_of", "task_of"]

Array = NDArray[np.float64]

_WRONG = np.array([1.3, 0.8, 0.8, 1.2, 1.5, 0.7, 1.3])
"""Factors on the true values of a guess with errors of 20 to 50 %."""


def recording_of(rows: int) -> tuple[Recording, Array, Array]:
    """Runs of the servo motor, their starts (n_run, 2) and their noise deviations (2,).

    Args:
        rows: Samples of all runs together.
    """
    return recorded(CASES[0], seed=1, rows=rows // RUNS)


def runs_of(rows: int) -> list[Run]:
    """The same runs as objects of the package."""
    return as_runs(recording_of(rows)[0])


def task_of(fit: Fit, recording: Recording, noise: Array) -> Task:
    """Posterior of a fit of the nominal model.

    Args:
        fit: Optimum.
        recording: Its data.
        noise: (2,) true noise deviations.
    """
    posterior = Posterior(fit, 1.0)
    coordinates, values = fit.coordinates, np.array(CASES[0].values)
    return Task(
        interval=np.array([recording.interval]),
        voltage=recording.voltage,
        temperature=_within_intervals(recording.temperature),
        current=recording.current,
        speed=recording.speed,
        truth=np.concatenate([values, noise]),
        guess=values * _WRONG,
        is_log=np.array([float(p.search == "log") for p in coordinates.parameters]),
        scale=np.array([p.scale for p in coordinates.parameters]),
        prior_mean=coordinates.prior_mean,
        prior_sd=coordinates.prior_sd,
        lower=coordinates.lower,
        upper=coordinates.upper,
        counts=np.asarray(fit.weighting.counts, dtype=np.float64),
        centre=posterior.centre,
        root=np.asarray(np.linalg.cholesky(posterior.covariance()), dtype=np.float64),
        states=np.stack(fit.states),
        response=np.stack([fit.equations.state_response(k) for k in range(len(fit.states))]),
        logged_temperature=recording.temperature,
        substeps=np.array([handwritten.substeps_needed(values, recording, fit.states[0], noise)]),
    )


def _within_intervals(temperature: Array) -> Array:
    """Mean temperature of each interval; the package interpolates the logged one."""
    following = np.concatenate([temperature[:, 1:], temperature[:, -1:]], axis=1)
    return np.asarray(0.5 * (temperature + following))


def main() -> None:
    """Fit the runs and write the task."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", type=Path)
    parser.add_argument("--rows", type=int, required=True)
    chosen = parser.parse_args()
    recording, _, noise = recording_of(chosen.rows)
    fit = fit_declared(records_of(as_runs(recording)), "zoh")
    if fit.coordinates.names != NAMES[:7]:
        raise ValueError(f"the fit has {fit.coordinates.names}; expected {NAMES[:7]}")
    chosen.task.parent.mkdir(parents=True, exist_ok=True)
    task_of(fit, recording, noise).save(chosen.task)
    print("{}")


if __name__ == "__main__":
    main()
