"""Comparison of the results of two versions, for a change that must not change any.

    python -m benchmarks.same_results --out out/results [--campaigns 40] [--seed 12]
    python -m benchmarks.same_results --out out/results --against out/results_of_parent

The campaigns in data/ are identified with the posterior, and simulated campaigns of
`benchmarks.attribution` without it.  The first command writes one file per campaign: `result.json`
without the versions.  The second compares these files with those that the other version wrote,
prints the largest difference of each, and exits with status 1 if one exceeds the tolerance.
Campaigns whose file exists are not computed again.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from bench import EFFECTS, EffectRequest, Noise, make_campaign
from benchmarks.attribution import plan
from benchmarks.coverage import run_of
from identification import FitOptions, Run, identify, read_run
from identification.threads import use_threads

__all__ = ["differences", "main"]

_DATA = Path("data")
_ROWS = 1500


def differences(this: object, other: object, path: str = "") -> Iterator[tuple[float, str]]:
    """Relative difference and path of each value in which two results differ.

    A difference of other things than numbers is infinite.  Members that only this result has are
    ignored, since a new version may add some.

    Args:
        this: Part of a result.
        other: The same part of the other result.
        path: Where both stand.
    """
    if isinstance(this, dict) and isinstance(other, dict):
        for name in sorted(other):
            yield from differences(this.get(name), other[name], f"{path}/{name}")
    elif isinstance(this, list) and isinstance(other, list) and len(this) == len(other):
        for k, pair in enumerate(zip(this, other, strict=True)):
            yield from differences(*pair, f"{path}/{k}")
    elif this != other:
        size = math.inf
        if isinstance(this, float) and isinstance(other, float):
            size = abs(this - other) / max(abs(this), abs(other))
        yield size, f"{path}: {json.dumps(this)[:80]} instead of {json.dumps(other)[:80]}"


def _stored(name: str) -> tuple[list[Run], list[Run]]:
    training, validation = (
        [read_run(file) for file in sorted((_DATA / name).glob(f"{role}_*.csv"))]
        for role in ("training", "validation")
    )
    return training, validation


def _simulated(item: dict[str, Any]) -> tuple[list[Run], list[Run]]:
    requests = []
    for name, law in item["effects"]:
        low, high = EFFECTS[name].typical
        requests.append(EffectRequest(name=name, size=low * (high / low) ** item["share"], law=law))
    measured = make_campaign(
        item["motor"],
        requests,
        seed=item["seed"],
        rows=_ROWS,
        noise=Noise(kind=item["noise"]),
        position=item["position"],
    )
    training, validation = (
        [run_of(run, f"{role}_{k}.csv") for k, run in enumerate(runs, 1)]
        for role, runs in (("training", measured.training), ("validation", measured.validation))
    )
    return training, validation


def _identified(task: tuple[Path, str | dict[str, Any]]) -> Path:
    file, source = task
    if not file.exists():
        is_stored = isinstance(source, str)
        training, validation = _stored(source) if isinstance(source, str) else _simulated(source)
        found = identify(training, validation, FitOptions(posterior=is_stored))
        result = {name: value for name, value in found.result.items() if name != "software"}
        file.write_text(json.dumps(result, indent=1, sort_keys=True, default=float) + "\n")
    return file


def main(arguments: Sequence[str] | None = None) -> int:
    """Identify the campaigns, and compare with the results of another version if they are given."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, required=True, help="directory of the results")
    parser.add_argument("--against", type=Path, help="directory that the other version wrote")
    parser.add_argument("--tolerance", type=float, default=1e-9, help="relative difference")
    parser.add_argument("--campaigns", type=int, default=40)
    parser.add_argument("--seed", type=int, default=12)
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    tasks: list[tuple[Path, str | dict[str, Any]]] = [
        (given.out / f"{file.parent.name}.json", file.parent.name)
        for file in sorted(_DATA.glob("*/truth.json"))
    ]
    tasks += [
        (given.out / f"{item['number']:03d}.json", item)
        for item in plan(given.campaigns, given.seed)
    ]
    changed, largest = 0, 0.0
    with multiprocessing.get_context("spawn").Pool(os.cpu_count(), use_threads, (1,)) as pool:
        for file in pool.imap(_identified, tasks):
            words = "written"
            if given.against:
                old = json.loads((given.against / file.name).read_text())
                size, words = max(
                    differences(json.loads(file.read_text()), old), default=(0.0, "same")
                )
                changed += size > given.tolerance
                largest = max(largest, size)
            print(f"{file.stem}: {words}", flush=True)
    if given.against:
        print(
            f"{len(tasks) - changed} of {len(tasks)} results are the same within "
            f"{given.tolerance:g}; the largest relative difference is {largest:.2g}"
        )
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
