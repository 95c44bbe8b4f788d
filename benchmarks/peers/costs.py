"""Arithmetic of one likelihood against hand-tuned kernels, and its cost with each further effect.

    python -m benchmarks.peers.costs kernels --rows 100000
    python -m benchmarks.peers.costs effects --rows 10000

The alternatives run in turn in one process with one thread; ratios are medians over the turns, so
that other load affects both.  The hand-tuned kernels hold the friction ideal, which is cheaper than
the smoothed law of the package.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks import handwritten
from benchmarks.handwritten import Recording
from benchmarks.peers import kernels
from benchmarks.peers.child import peak_mb, report
from benchmarks.peers.problem import recording_of
from benchmarks.speed import CASES, as_runs
from identification.effects.catalogue import CATALOGUE
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.model.excitation import records_of
from identification.posterior.density import Posterior
from identification.selection.candidates import scales_of
from identification.selection.refit import refined, refitted_with
from identification.selection.start import Start
from identification.threads import use_threads

__all__ = ["ADDED", "dry_recording", "effects_line", "kernels_line", "main", "with_effect"]

Array = NDArray[np.float64]

WALKERS: Final = 64
_DRY_NM: Final = 0.02
_TURNS: Final = 7
ADDED: Final = (
    "coulomb_friction", "brush_drop", "quadratic_drag", "load_torque", "flux_saturation",
)  # fmt: skip
"""Effects that are added one after another."""


def dry_recording(recording: Recording) -> Recording:
    """The same runs of a motor with Coulomb friction, simulated by the hand-tuned kernel."""
    values = np.append(CASES[0].values, _DRY_NM)
    clean = np.stack(
        [
            kernels.friction_run(values, recording.interval, voltage, temperature)
            for voltage, temperature in zip(recording.voltage, recording.temperature, strict=True)
        ]
    )
    noise = 0.01 * clean.std(axis=(0, 1))
    logged = clean + noise * np.random.default_rng(2).standard_normal(clean.shape)
    current, speed = (np.ascontiguousarray(logged[:, :, c]) for c in range(2))
    return Recording(recording.interval, recording.voltage, recording.temperature, current, speed)


def with_effect(fit: Fit, name: str) -> Fit:
    """Fit with one more effect of the catalogue, from its first start, its substeps refined."""
    candidate = CATALOGUE[name].candidates(scales_of(fit))[0]
    return refined(refitted_with(fit, candidate.term, [Start(candidate.starts[:, 0])]))


def _nanoseconds(jobs: dict[str, Callable[[], object]], samples: int) -> dict[str, list[float]]:
    """Processor time per sample and walker of each job, (turns,) each, measured in turn [ns]."""
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for job in jobs.values():
        job()
    for _ in range(_TURNS):
        for name, job in jobs.items():
            begun, calls = time.process_time(), 0
            while time.process_time() - begun < 0.05 or calls == 0:
                job()
                calls += 1
            spent = (time.process_time() - begun) / calls
            taken[name].append(1e9 * spent / (samples * WALKERS))
    return taken


def _data(recording: Recording) -> tuple[float, Array, Array, Array, Array]:
    return (
        recording.interval,
        recording.voltage,
        recording.temperature,
        recording.current,
        recording.speed,
    )


def kernels_line(rows: int) -> dict[str, Any]:
    """Line of the ratios to the hand-tuned kernels, for the nominal model and for dry friction."""
    recording, starts, noise = recording_of(rows)
    dry = dry_recording(recording)
    nominal_fit = fit_declared(records_of(as_runs(recording)), "zoh")
    dry_fit = with_effect(fit_declared(records_of(as_runs(dry)), "zoh"), "coulomb_friction")
    nominal, friction = Posterior(nominal_fit, 1.0), Posterior(dry_fit, 1.0)
    points = {"nominal": nominal.normal_points(0, WALKERS)}
    points["friction"] = friction.normal_points(0, WALKERS)
    each = np.tile(starts, (WALKERS, 1, 1))
    walkers = np.ascontiguousarray(nominal.physical(points["nominal"])[:, :7])
    dry_walkers = np.ascontiguousarray(friction.physical(points["friction"])[:, :8])
    substeps = handwritten.substeps_needed(walkers[0], recording, starts[0], noise)
    jobs: dict[str, Callable[[], object]] = {
        "motorid, nominal": lambda: nominal(points["nominal"]),
        "hand-tuned, nominal": lambda: kernels.nominal_in_lanes(walkers, *_data(recording), each),
        "hand-written loop, nominal": lambda: handwritten.sums_of_all_walkers(
            walkers, *_data(recording), each, substeps
        ),
        "motorid, friction": lambda: friction(points["friction"]),
        "hand-tuned, friction": lambda: kernels.friction_in_lanes(dry_walkers, *_data(dry), each),
    }
    taken = _nanoseconds(jobs, rows)
    ratios = {
        model: statistics.median(
            ours / theirs
            for ours, theirs in zip(
                taken[f"motorid, {model}"], taken[f"hand-tuned, {model}"], strict=True
            )
        )
        for model in points
    }
    return {
        "ns": {name: statistics.median(each) for name, each in taken.items()},
        "ratios": ratios,
        "operations": {
            "nominal": nominal.work(WALKERS) / (rows * WALKERS),
            "friction": friction.work(WALKERS) / (rows * WALKERS),
        },
        "substeps": sum(x.shape[0] for x in friction.simulator.inputs) / rows,
        "peak_mb": peak_mb(),
    }


def effects_line(rows: int, added: Sequence[str] = ADDED) -> dict[str, Any]:
    """Line of the cost of one likelihood and of one fit with 0, 1, 2, ... effects."""
    fit = fit_declared(records_of(as_runs(dry_recording(recording_of(rows)[0]))), "zoh")
    found: list[dict[str, Any]] = []
    for name in ("", *added):
        fitting = 0.0
        if name:
            begun = time.process_time()
            fit = with_effect(fit, name)
            fitting = time.process_time() - begun
        posterior = Posterior(fit, 1.0)
        points = posterior.normal_points(0, WALKERS)
        taken = _nanoseconds({"ours": lambda p=points, d=posterior: d(p)}, rows)["ours"]  # type: ignore[misc]
        found.append(
            {
                "added": name,
                "parameters": len(fit.coordinates.names),
                "ns": statistics.median(taken),
                "operations": posterior.work(WALKERS) / (rows * WALKERS),
                "substeps": sum(x.shape[0] for x in posterior.simulator.inputs) / rows,
                "fit_cpu_s": fitting,
            }
        )
    return {"models": found, "peak_mb": peak_mb()}


def main() -> None:
    """Measure and print the line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("kernels", "effects"))
    parser.add_argument("--rows", type=int, required=True)
    chosen = parser.parse_args()
    numba.set_num_threads(1)
    use_threads(1)
    line = kernels_line(chosen.rows) if chosen.what == "kernels" else effects_line(chosen.rows)
    report(line, ("casadi", "llvmlite", "numba", "numpy"))


if __name__ == "__main__":
    main()
