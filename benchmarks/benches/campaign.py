"""Simulation and identification of one campaign, and comparison with the true values."""

from __future__ import annotations

import os
import resource
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from benchmarks.benches.cases import CELLS, is_right, wrong_kinds
from benchmarks.benches.recording import Recorded, recorded
from identification import FitOptions, identify, read_run
from identification.errors import IdentificationError
from identification.work import operations

__all__ = ["Settings", "identified", "isolated", "wanted"]

_GIGA: Final = 1e9
_KIB: Final = 1024.0


@dataclass(frozen=True)
class Settings:
    """Options of all campaigns.

    Args:
        rows: Samples per run.
        posterior: Whether to sample the posterior; otherwise intervals use the fit's covariance.
        withheld: Effect types excluded from the search.
    """

    rows: int = 24_000
    posterior: bool = False
    withheld: tuple[str, ...] = ()


def wanted(first: int, count: int, cell: str | None) -> Iterator[int]:
    """Numbers of the campaigns, optionally of one cell or case.

    Args:
        first: The first number.
        count: Number of campaigns.
        cell: A case, or a cell as ``encoder:clean``; None for all.
    """
    number = first
    while count > 0:
        name = CELLS[number % len(CELLS)].name
        if cell is None or cell in (name, name.split(":")[0]):
            yield number
            count -= 1
        number += 1


def identified(number: int, settings: Settings) -> dict[str, Any]:
    """Identify one campaign and return its line of the log.

    Args:
        number: Number of the campaign; it determines cell, motor and noise.
        settings: Options of all campaigns.
    """
    cell = CELLS[number % len(CELLS)]
    measured = recorded(cell, number, settings.rows)
    line: dict[str, Any] = {
        "number": number,
        "cell": cell.name,
        "hidden": list(measured.hidden),
        "motor": [round(measured.motor.rated_voltage), round(measured.motor.rated_power, 1)],
    }
    began, spent = time.perf_counter(), 0.0

    def progress(stage: str, fraction: float) -> None:
        nonlocal spent
        spent = max(spent, operations())

    try:
        with tempfile.TemporaryDirectory() as directory:
            runs = [read_run(path) for path in _written(measured, Path(directory))]
        options = FitOptions(seed=number, posterior=settings.posterior)
        found = identify(runs[:-1], runs[-1:], options, progress, withheld=settings.withheld)
    except IdentificationError as error:
        line["refused"] = f"{type(error).__name__}: {error}"
    except Exception as error:  # noqa: BLE001  any exception is a finding
        line["failed"] = _located(error)
    else:
        line |= _compared(number, measured, found.result, settings.withheld)
        outcome = found.findings.analysis.outcome
        line["complete"] = outcome is not None and outcome.complete
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _KIB
    seconds = time.perf_counter() - began
    return line | {
        "seconds": round(seconds, 1),
        "gop": round(spent / _GIGA, 1),
        "memory_MB": round(memory),
    }


def isolated(number: int, settings: Settings) -> dict[str, Any]:
    """Run `identified` in a separate process, to measure its peak memory.

    Args:
        number: Number of the campaign.
        settings: Options of all campaigns.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        try:
            return pool.submit(identified, number, settings).result()
        except BrokenProcessPool:
            cell = CELLS[number % len(CELLS)].name
            return {"number": number, "cell": cell, "failed": "the process was killed"}


def _written(measured: Recorded, directory: Path) -> list[Path]:
    """Write the run files; the validation run is the last."""
    paths = []
    for number, table in enumerate(measured.tables, 1):
        path = directory / f"run_{number}.csv"
        table.to_csv(path, index=False, float_format="%.9g")
        paths.append(path)
    return paths


def _compared(
    number: int, measured: Recorded, result: dict[str, Any], withheld: tuple[str, ...]
) -> dict[str, Any]:
    """Compare names, errors and intervals with the true values."""
    case = CELLS[number % len(CELLS)].case
    named = tuple(effect["name"] for effect in result["effects"])
    others = tuple(a["name"] for effect in result["effects"] for a in effect["alternatives"])
    wrong = wrong_kinds(case, measured.hidden, named)
    errors = result["errors"]["after"]["validation"]
    rmse = (errors["current"]["rmse"], errors["speed"]["rmse"])
    return {
        "named": list(named),
        "alternatives": sorted(set(others)),
        "probabilities": [round(effect["probability"], 4) for effect in result["effects"]],
        "right": is_right(case, measured.hidden, named, others, withheld),
        "wrong": wrong,
        "sure": [e["name"] for e in result["effects"] if e["name"] in wrong and _is_sure(e)],
        "ratios": [round(float(e / n), 4) for e, n in zip(rmse, measured.noise, strict=True)],
        "inside": {
            name: entry["q05"] <= measured.truth[name] <= entry["q95"]
            for name, entry in _counted(case.uncounted, measured, result)
        },
        "deviations": {
            name: round((entry["mean"] - measured.truth[name]) / entry["sd"], 2)
            for name, entry in _counted(case.uncounted, measured, result)
        },
        "relative": {
            name: round(entry["mean"] / measured.truth[name] - 1.0, 5)
            for name, entry in _counted(case.uncounted, measured, result)
        },
    }


def _is_sure(effect: dict[str, Any]) -> bool:
    return bool(effect["probability"] > 0.95)


def _counted(
    uncounted: Sequence[str], measured: Recorded, result: dict[str, Any]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Identified parameters that have a true value."""
    for name in measured.truth:
        entry = result["parameters"][name]
        if entry["identified"] and name not in uncounted:
            yield name, entry


def _located(error: Exception) -> str:
    """Type, message and innermost source location in the project."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "identification" in f.filename.split(os.sep)]
    at = (own or frames)[-1]
    return f"{type(error).__name__} at {os.path.basename(at.filename)}:{at.lineno}: {error}"
