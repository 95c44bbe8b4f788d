"""Time and memory of a fit of five long runs.

    python -m benchmarks.long_runs [--rows 24000] [--effects brush_drop=0.03,coulomb_friction=0.02]

Four training runs and one validation run of a servo motor with hidden effects are identified,
including the search and the posterior.  The peak memory is that of this process, including the
simulation of the bench.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Sequence

from bench import make_campaign
from benchmarks.coverage import run_of
from identification.pipeline import FitOptions, identify

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Identify the motor, and print time, memory and the named effects."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=24_000, help="samples per run")
    parser.add_argument("--effects", default="brush_drop=0.03", help="KIND=SIZE, ...")
    parser.add_argument(
        "--no-posterior", action="store_true", help="intervals from the covariance of the fit"
    )
    options = parser.parse_args(arguments)
    pairs = [word.split("=") for word in options.effects.split(",") if word]
    hidden = [(kind, float(size)) for kind, size in pairs]
    rows = options.rows
    measured = make_campaign("servo_150w", hidden, seed=3, rows=rows, training=4, validation=1)
    training = [run_of(run, f"training_{k}.csv") for k, run in enumerate(measured.training, 1)]
    validation = [run_of(run, f"left_{k}.csv") for k, run in enumerate(measured.validation, 1)]
    began = time.perf_counter()
    chosen = FitOptions(posterior=not options.no_posterior)
    outcome = identify(training, validation, chosen).findings.analysis.outcome
    seconds = time.perf_counter() - began
    named = [found.name for found in outcome.effects] if outcome else []
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    spent = time.process_time()
    print(
        f"5 runs of {rows} samples: {seconds:.0f} s, {spent:.0f} s of processors, "
        f"{memory:.2f} GB; hidden: {[kind for kind, _ in hidden]}; named: {named}"
    )


if __name__ == "__main__":
    main()
