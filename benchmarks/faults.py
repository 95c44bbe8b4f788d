"""Detection and false alarm rates of the checks before the fit.

    python -m benchmarks.faults [--motors 10] [--sound 240] [--rows 1500] [--seed 0]

Each fault of `benchmarks.fault_table` is applied to a clean campaign of each motor of 1 W to 10 kW.
The runs are written, read and checked as in `motorid fit`, without a fit.
If a finding proposes a correction, the runs are read again with it; the correction counts if no
finding remains.  Sound campaigns are those of `benchmarks.attribution`, with and without effects:
all runs, single runs, two pairs, and the first 300 samples of each.

"Before" is the outcome of the reader alone, without the checks: an error or a warning.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from app.commands.arguments import mapping_of
from bench import EFFECTS, EffectRequest, Noise, make_campaign
from benchmarks.attribution import plan
from benchmarks.coverage import run_of
from benchmarks.fault_table import FAULTS, Fault, Tables
from identification.checks import check_runs
from identification.errors import InputError
from identification.fit.campaign import first_alike
from identification.ingest import Run, read_run

__all__ = ["Seen", "document", "main", "seen", "sound", "tables_of"]

_REMARKS = (
    "identical_channels",
    "constant_channel",
    "suspicious_value",
    "clipped_channel",
    "gap",
)
_APART = 7_000
_SOUND_SEED = 5
_SHORT = 300


@dataclass(frozen=True)
class Seen:
    """Outcome of one fault in one motor.

    Args:
        before: ``refuse``, ``warn`` or empty, by the reader alone.
        after: ``refuse``, ``suspect``, ``warn`` or empty, with the checks.
        corrected: Whether the correction removed all findings; None if none was proposed.
        words: First message.
    """

    before: str
    after: str
    corrected: bool | None
    words: str


def tables_of(motor: int, rows: int) -> Tables:
    """Tables of the runs of a clean campaign, training first."""
    campaign = make_campaign(motor, (), seed=motor, rows=rows)
    tables = [run.frame.copy() for run in campaign.runs]
    tables[0].attrs["motor"] = motor
    return tables


def seen(fault: Fault, motor: int, rows: int) -> Seen:
    """Apply a fault to a campaign and collect the findings.

    Args:
        fault: The fault.
        motor: Seed of the motor.
        rows: Samples per run.
    """
    tables = fault.make(tables_of(motor, rows), np.random.default_rng(motor))
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for k, table in enumerate(tables):
            paths.append(Path(folder) / f"run_{k}.csv")
            table.to_csv(paths[-1], index=False, float_format="%.9g")
        try:
            runs = [read_run(path) for path in paths]
        except InputError as error:
            return Seen("refuse", "refuse", None, str(error))
        verdict = check_runs(runs)
        before = "warn" if _remarked(runs) else ""
        findings = verdict.refused or verdict.findings
        words = str(findings[0]) if findings else ""
        after = findings[0].severity if findings else before
        corrections = [word for f in verdict.findings for word in f.corrections]
        corrected = _is_corrected(paths, corrections) if corrections else None
    return Seen(before, after, corrected, words)


def _remarked(runs: Sequence[Run]) -> bool:
    repeated = any(found is not None for found in first_alike(runs))
    return repeated or any(w.code in _REMARKS for run in runs for w in run.warnings)


def _is_corrected(paths: Sequence[Path], words: Sequence[str]) -> bool:
    """Return True if the runs, read with the proposed corrections, have no finding."""
    mapping = mapping_of(None, list(words))
    try:
        runs = [read_run(path, mapping=mapping) for path in paths]
    except InputError:
        return False
    return not check_runs(runs).findings


def sound(item: dict[str, Any], rows: int) -> dict[str, list[str]]:
    """Findings in a sound campaign and in parts of it, by part.

    Args:
        item: Item of `benchmarks.attribution.plan`.
        rows: Samples per run.
    """
    requests = []
    for name, law in item["effects"]:
        low, high = EFFECTS[name].typical
        requests.append(EffectRequest(name, low * (high / low) ** item["share"], law))
    settings = {"noise": Noise(kind=item["noise"]), "position": item["position"]}
    campaign = make_campaign(item["motor"], requests, seed=item["seed"], rows=rows, **settings)
    runs = [run_of(run, f"run_{k}.csv") for k, run in enumerate(campaign.runs)]
    parts = {
        "all runs": runs,
        "one run": runs[:1],
        "two runs": runs[:2],
        "two other runs": runs[3:5],
        "300 samples of each": [_head(run) for run in runs],
    }
    return {
        name: [f"{f.severity}: {f}" for f in check_runs(part).findings]
        for name, part in parts.items()
    }


def _head(run: Run) -> Run:
    """The first samples of a run."""
    channels = ("time", "voltage", "current", "speed", "temperature")
    cut = {name: getattr(run, name)[:_SHORT] for name in channels}
    return replace(run, **cut, position=None, segments=(), clipped={})


def _job(task: tuple[str, int, int, int]) -> dict[str, Any]:
    """Measure one campaign: a fault, or a sound one."""
    kind, number, other, rows = task
    began = time.perf_counter()
    if kind == "sound":
        item = list(plan(number + 1, other))[number]
        return {"kind": kind, "number": number, "parts": sound(item, rows), "of": item["group"]}
    found = asdict(seen(FAULTS[number], other, rows))
    seconds = time.perf_counter() - began
    return {"kind": kind, "number": number, "motor": other, "seconds": seconds} | found


_MET = {
    "refuse": ("refuse",),
    "suspect": ("refuse", "suspect"),
    "warn": ("refuse", "suspect", "warn"),
    "none": ("", "warn"),
}
_COUNTED = ("refuse", "suspect", "warn")


def document(done: Sequence[dict[str, Any]], command: str) -> str:
    """The page with both tables, in Markdown.

    Args:
        done: Outcomes of `_job`.
        command: Command that generated the page.
    """
    faulty = [d for d in done if d["kind"] == "fault"]
    lines = [
        "# Faulty runs",
        "",
        f"Made by `{command}`, or `make faults`.",
        "",
        "Each fault is applied to clean campaigns (5 training and 2 validation runs) of motors "
        "drawn between 1 W and 10 kW.",
        "`refuse`: exit status 2; `suspect` and `warn`: a warning in the result.",
        "Before: outcome of the reader without the checks; `warn` is a warning with exit status 0.",
        "Met: campaigns with the expected outcome or a more severe one; where `none` is expected, "
        "the search for effects explains the fault, and no check may refuse or suspect the run.",
        "Corrected: campaigns without findings after the proposed `--map` options were applied, "
        "of those with a proposal.",
        "",
        "| fault | in | expected | before: refused | before: warned | refused | suspected | warned "
        "| met | corrected |",
        "|---|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for number, fault in enumerate(FAULTS):
        mine = [d for d in faulty if d["number"] == number]
        if mine:
            lines.append(_row(fault, mine))
    met = sum(d["after"] in _MET[FAULTS[d["number"]].outcome] for d in faulty)
    before = sum(d["before"] == "refuse" for d in faulty if FAULTS[d["number"]].outcome == "refuse")
    wanted = [d for d in faulty if FAULTS[d["number"]].outcome == "refuse"]
    after = sum(d["after"] == "refuse" for d in wanted)
    lines += [
        "",
        f"Of {len(wanted)} campaigns with the expected outcome `refuse`, the reader alone refused "
        f"{before}, and the checks refuse {after}; {met} of all {len(faulty)} campaigns have the "
        "expected outcome.",
    ]
    return "\n".join(lines + _sound_lines([d for d in done if d["kind"] == "sound"])) + "\n"


def _row(fault: Fault, mine: Sequence[dict[str, Any]]) -> str:
    count = {word: sum(d["after"] == word for d in mine) for word in _COUNTED}
    met = sum(d["after"] in _MET[fault.outcome] for d in mine)
    proposed = [d["corrected"] for d in mine if d["corrected"] is not None]
    cells = [
        fault.name,
        fault.scope,
        fault.outcome,
        sum(d["before"] == "refuse" for d in mine),
        sum(d["before"] == "warn" for d in mine),
        *count.values(),
        f"{met} of {len(mine)}",
        f"{sum(proposed)} of {len(proposed)}" if proposed else "",
    ]
    return f"| {' | '.join(map(str, cells))} |"


def _sound_lines(campaigns: Sequence[dict[str, Any]]) -> list[str]:
    lines = [
        "",
        "## Sound campaigns",
        "",
        "Campaigns of the attribution benchmark without effects, and with one or two effects, "
        "listed and unlisted.",
        "",
        "| part | campaigns | refused | suspected |",
        "|---|---:|---:|---:|",
    ]
    for part in campaigns[0]["parts"] if campaigns else ():
        found = [d["parts"][part] for d in campaigns]
        refused = sum(any(f.startswith("refuse") for f in one) for one in found)
        suspected = sum(bool(one) for one in found) - refused
        lines.append(f"| {part} | {len(found)} | {refused} | {suspected} |")
    return lines


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--motors", type=int, default=10)
    parser.add_argument("--sound", type=int, default=240)
    parser.add_argument("--rows", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=0, help="seed of motors and campaigns")
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/faults.md"))
    chosen = parser.parse_args(arguments)
    first = _APART + 1_000 * chosen.seed
    tasks = [("sound", k, _SOUND_SEED + chosen.seed, chosen.rows) for k in range(chosen.sound)]
    for number in range(len(FAULTS)):
        tasks += [("fault", number, first + k, chosen.rows) for k in range(chosen.motors)]
    context = multiprocessing.get_context("spawn")
    with context.Pool(len(os.sched_getaffinity(0))) as pool:
        done = []
        for outcome in pool.imap_unordered(_job, tasks, chunksize=4):
            done.append(outcome)
            print(json.dumps(outcome), flush=True)  # noqa: T201
    options = f"--motors {chosen.motors} --sound {chosen.sound} --rows {chosen.rows}"
    text = document(done, f"python -m benchmarks.faults {options} --seed {chosen.seed}")
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
