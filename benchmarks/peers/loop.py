"""Whole identification by motorid: fit, effects, posterior and feedback metrics.

    python -m benchmarks.peers.loop CAMPAIGN [--no-posterior]

The posterior is sampled as the default effort permits; the log says from where the draws are.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.peers.campaigns import PARAMETERS, load
from benchmarks.peers.child import Stopwatch, limit_memory, report
from identification.pipeline import FitOptions, identify

__all__ = ["main"]

Array = NDArray[np.float64]


def _frames(runs: list[dict[str, Array]]) -> list[pd.DataFrame]:
    return [pd.DataFrame(run) for run in runs]


def main() -> None:
    """Identify the campaign and print the line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("campaign", type=Path)
    parser.add_argument("--no-posterior", action="store_true")
    chosen = parser.parse_args()
    limit_memory()
    training, validation, truth = load(chosen.campaign)
    watch = Stopwatch()
    began = time.perf_counter()
    stages: dict[str, float] = {}

    def progress(stage: str, fraction: float) -> None:
        stages.setdefault(stage, time.perf_counter() - began)

    with watch.timed("loop"):
        found = identify(
            _frames(training),
            _frames(validation),
            FitOptions(posterior=not chosen.no_posterior),
            progress,
        )
    outcome, draws = found.findings.analysis.outcome, found.draws()
    values = np.array([[np.mean(draws[n]), np.std(draws[n])] for n in PARAMETERS])
    sample = found.findings.sample
    line = {
        **watch.line(),
        "stages": stages,
        "named": [effect.name for effect in outcome.effects] if outcome else [],
        "source": sample.source if sample else "normal",
        "deviations": ((values[:, 0] - truth) / values[:, 1]).tolist(),
        "metrics": len(found.findings.feedback),
    }
    report(line, ("casadi", "emcee", "numpy"))


if __name__ == "__main__":
    main()
