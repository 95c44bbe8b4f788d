"""Computing time relative to hand-written numba and scipy code for the same motor.

    python -m benchmarks.speed [--repeats 7] [--out docs/benchmarks/speed.md]

The hand-written code of `handwritten.py` and the package run in turn on one machine, so that other
load affects both; the result is the median.  The page gives ratios, because seconds depend on the
machine.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks import handwritten
from benchmarks.handwritten import Recording
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.posterior.density import Posterior

__all__ = ["Case", "Measured", "main", "measure"]

Array = NDArray[np.float64]

RUNS, ROWS, WALKERS = 5, 24_000, 64
NOISE = 0.01


@dataclass(frozen=True)
class Case:
    """A motor to be timed.

    Args:
        name: Distinguishing property.
        values: Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L in SI units.
        voltage: Largest voltage [V].
        interval: Sample interval [s].
        fits: True if the fits are timed as well.
    """

    name: str
    values: tuple[float, float, float, float, float, float, float]
    voltage: float
    interval: float
    fits: bool = True


CASES = (
    Case("servo, L/R of 3.3 intervals", (0.6, 0.0039, 0.07, -0.0012, 1e-4, 1e-4, 2e-3), 24.0, 1e-3),
    Case("paper, L/R of 85 intervals", (0.59, 0.004, 0.071, -0.002, 0.01, 0.1, 0.5), 24.0, 1e-2),
    Case(
        "stiff, L/R of a tenth of an interval",
        (0.6, 0.0039, 0.07, -0.0012, 1e-4, 1e-4, 6e-5),
        24.0,
        1e-3,
        fits=False,
    ),
)


@dataclass(frozen=True)
class Measured:
    """Median seconds of one case.

    Args:
        case: The motor.
        substeps: Runge-Kutta steps per interval of the hand-written code.
        seconds: Median time by job [s].
        ratios: Median ratio of hand-written to package time, by job.
        notes: Relative errors of the fits.
    """

    case: Case
    substeps: int
    seconds: dict[str, float]
    ratios: dict[str, float]
    notes: tuple[str, ...]


def recorded(case: Case, seed: int, rows: int = ROWS) -> tuple[Recording, Array, Array]:
    """Noisy runs of a motor, its starts (n_run, 2), and the noise (2,) that was added.

    Args:
        case: The motor.
        seed: Seed of voltage and noise.
        rows: Samples per run, a multiple of 50.
    """
    rng = np.random.default_rng(seed)
    values = np.array(case.values)
    levels = rng.uniform(-1.0, 1.0, (RUNS, rows // 50))
    voltage = case.voltage * np.repeat(levels, 50, axis=1)
    temperature = 25.0 + 18.0 * np.arange(RUNS)[:, None] + np.linspace(0.0, 18.0, rows)
    starts = np.zeros((RUNS, 2))
    fine = 8 * max(1, int(np.ceil(case.interval * values[0] / values[6])))
    clean = np.stack(
        [
            handwritten.simulate(values, case.interval, voltage[r], temperature[r], starts[r], fine)
            for r in range(RUNS)
        ]
    )
    noise = NOISE * clean.std(axis=(0, 1))
    logged = clean + noise * rng.standard_normal(clean.shape)
    current, speed = (np.ascontiguousarray(logged[:, :, c]) for c in range(2))
    return Recording(case.interval, voltage, temperature, current, speed), starts, noise


def as_runs(recording: Recording) -> list[Run]:
    """Convert a recording to runs of the package."""
    time_ = recording.interval * np.arange(recording.voltage.shape[1], dtype=np.float64)
    return [
        Run(
            f"run{r}.csv",
            "0" * 64,
            time_,
            recording.voltage[r],
            recording.current[r],
            recording.speed[r],
            recording.temperature[r],
        )
        for r in range(RUNS)
    ]


def by_turns(jobs: dict[str, Callable[[], object]], repeats: int) -> dict[str, list[float]]:
    """Times of every job, (repeats,) each, measured in turn [s]."""
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(repeats):
        for name, job in jobs.items():
            start = time.perf_counter()
            job()
            taken[name].append(time.perf_counter() - start)
    return taken


def _median_ratio(above: Sequence[float], below: Sequence[float]) -> float:
    return statistics.median(a / b for a, b in zip(above, below, strict=True))


def measure(case: Case, repeats: int) -> Measured:
    """Time one case."""
    recording, starts, noise = recorded(case, seed=1)
    values = np.array(case.values)
    substeps = handwritten.substeps_needed(values, recording, starts[0], noise)
    first = time.perf_counter()
    fit = fit_declared(records_of(as_runs(recording)), "zoh")
    seconds = {"our fit, first call": time.perf_counter() - first}
    likelihoods = _likelihoods(fit, recording, starts, values, substeps)
    compilation = by_turns(likelihoods, 1)
    taken = by_turns(likelihoods, repeats)
    for name, each in compilation.items():
        seconds[f"first call: {name}"] = each[0]
    # Time all walkers: a single short call would fit between the time slices of other
    # processes.
    ours = [t / WALKERS for t in taken["ours, 64 walkers"]]
    single = [t / WALKERS for t in taken["hand-written"]]
    many = [t / WALKERS for t in taken["hand-written, 64 walkers on all cores"]]
    solved = _solve_ivp_seconds(recording, starts[0], values)
    seconds |= {
        "ours, a walker of 64": statistics.median(ours),
        "ours, one walker alone": statistics.median(taken["ours, one walker"]),
        "hand-written": statistics.median(single),
        "hand-written, a walker of 64 on all cores": statistics.median(many),
        **solved,
    }
    ratios = {
        "hand-written": _median_ratio(single, ours),
        "hand-written, all cores": _median_ratio(many, ours),
        "one walker alone": _median_ratio(single, taken["ours, one walker"]),
        **{name: spent / statistics.median(ours) for name, spent in solved.items()},
    }
    notes: tuple[str, ...] = ()
    if case.fits:
        more, fit_ratios, notes = _fits(recording, values, substeps, max(1, repeats // 2))
        seconds |= more
        ratios |= fit_ratios
    return Measured(case, substeps, seconds, ratios, notes)


def _likelihoods(
    fit: Fit, recording: Recording, starts: Array, values: Array, substeps: int
) -> dict[str, Callable[[], object]]:
    """Callables that evaluate one likelihood of all samples, by implementation."""
    posterior = Posterior(fit, 1.0)
    rng = np.random.default_rng(2)
    root = np.linalg.cholesky(posterior.covariance())
    points = posterior.centre + rng.standard_normal((WALKERS, root.shape[0])) @ root.T
    arrays = (
        recording.interval,
        recording.voltage,
        recording.temperature,
        recording.current,
        recording.speed,
        starts,
        substeps,
    )
    walkers = np.tile(values, (WALKERS, 1))

    def one_by_one() -> None:
        for walker in walkers:
            handwritten.sums_of_squares(walker, *arrays)

    return {
        "hand-written": one_by_one,
        "ours, 64 walkers": lambda: posterior(points),
        "hand-written, 64 walkers on all cores": lambda: handwritten.sums_of_all_walkers(
            walkers, *arrays[:5], np.tile(starts, (WALKERS, 1, 1)), substeps
        ),
        "ours, one walker": lambda: posterior(points[:1]),
    }


def _solve_ivp_seconds(recording: Recording, start: Array, values: Array) -> dict[str, float]:
    """Time of all samples, extrapolated from the first 400 [s]; each interval costs the same."""
    rows = 400
    found = {}
    for method in ("RK45", "LSODA"):
        begun = time.perf_counter()
        handwritten.by_solve_ivp(values, recording, start, rows, method)
        found[f"solve_ivp {method}"] = (time.perf_counter() - begun) * RUNS * ROWS / rows
    return found


def _fits(
    recording: Recording, values: Array, substeps: int, repeats: int
) -> tuple[dict[str, float], dict[str, float], tuple[str, ...]]:
    """Time the fit of the package and least squares from a guess with 20 to 50 % error."""
    guess = values * np.array([1.3, 0.8, 0.8, 1.2, 1.5, 0.7, 1.3])
    found: dict[str, Array] = {}

    def ours() -> None:
        found["ours"] = fit_declared(records_of(as_runs(recording)), "zoh").values

    def theirs(*, free_starts: bool) -> None:
        name = "least_squares, starts free" if free_starts else "least_squares, starts as logged"
        answer = handwritten.fit_by_finite_differences(
            guess, recording, substeps, free_starts=free_starts
        )
        found[name] = answer.x[:7]

    jobs: dict[str, Callable[[], object]] = {
        "our fit from nothing": ours,
        "least_squares, starts free": lambda: theirs(free_starts=True),
        "least_squares, starts as logged": lambda: theirs(free_starts=False),
    }
    taken = by_turns(jobs, repeats)
    seconds = {name: statistics.median(each) for name, each in taken.items()}
    ratios = {
        name: _median_ratio(taken[name], taken["our fit from nothing"])
        for name in jobs
        if name != "our fit from nothing"
    }
    notes = tuple(
        f"{name}: largest relative error of a parameter {np.abs(x / values - 1).max():.1e}"
        for name, x in found.items()
    )
    return seconds, ratios, notes


def _report(measured: Sequence[Measured], command: str) -> str:
    lines = [
        "# Speed relative to hand-written code",
        "",
        f"Made by `{command}`, or `make bench`.",
        f"One likelihood covers {RUNS} runs of {ROWS:,} samples.",
        "The hand-written code in `benchmarks/handwritten.py` is a numba loop with fast "
        "mathematics that accumulates the sums of squares.",
        "It uses the classical Runge-Kutta method with the smallest number of substeps that "
        "shifts no estimate by more than half its standard deviation; the package solves each "
        "interval to a tolerance of 1e-8.",
        "All numbers are ratios of median times, measured in turn: time of the alternative "
        "divided by time of the package.",
        "",
        "| one likelihood, per walker | " + " | ".join(m.case.name for m in measured) + " |",
        "|---|" + "---:|" * len(measured),
        _row("hand-written, substeps per interval", [str(m.substeps) for m in measured]),
    ]
    labels = {
        "hand-written": "hand-written, one simulation per call",
        "hand-written, all cores": "hand-written, 64 walkers on all cores",
        "one walker alone": "hand-written, relative to the package with one walker",
        "solve_ivp RK45": "`solve_ivp`, RK45 at 1e-6",
        "solve_ivp LSODA": "`solve_ivp`, LSODA at 1e-6",
    }
    for name, label in labels.items():
        lines.append(_row(label, [f"{m.ratios[name]:.3g}" for m in measured]))
    fitted = [m for m in measured if m.case.fits]
    lines += [
        "",
        "The fit of the package needs no initial guess and estimates the initial state of each "
        "run.",
        "`scipy.optimize.least_squares` with finite differences starts from a guess with errors "
        "of 20 to 50 %.",
        "",
        "| complete fit | " + " | ".join(m.case.name for m in fitted) + " |",
        "|---|" + "---:|" * len(fitted),
    ]
    for name in ("least_squares, starts free", "least_squares, starts as logged"):
        label = f"`least_squares`, {name.split(', ')[1]}"
        lines.append(_row(label, [f"{m.ratios[name]:.3g}" for m in fitted]))
    return "\n".join([*lines, ""])


def _row(label: str, cells: Sequence[str]) -> str:
    return f"| {label} | {' | '.join(cells)} |"


def _print(measured: Measured) -> None:
    print(f"\n{measured.case.name}: {measured.substeps} substeps for the hand-written loop")
    for name, seconds in measured.seconds.items():
        print(f"  {name:45s} {1e3 * seconds:14.3f} ms")
    for name, ratio in measured.ratios.items():
        print(f"  ratio to ours: {name:32s} {ratio:12.1f}")
    for note in measured.notes:
        print(f"  {note}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/speed.md"))
    chosen = parser.parse_args(arguments)
    measured = []
    for case in CASES:
        measured.append(measure(case, chosen.repeats))
        _print(measured[-1])
    text = _report(measured, f"python -m benchmarks.speed --repeats {chosen.repeats}")
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(text, encoding="utf-8")
    print(f"\nwritten to {chosen.out}")


if __name__ == "__main__":
    main()
