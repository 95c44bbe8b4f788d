"""Markdown page of the benchmark, from its log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from benchmarks.benches.cases import CELLS, COVERED

__all__ = ["page"]

Line = dict[str, Any]

_NEAR: Final = 1.05
"""Ratio of validation error to noise up to which a model counts as complete."""


def page(lines: Sequence[Line], command: str, rows: int, intervals: str) -> str:
    """Markdown page: one row per cell, then the campaigns with wrong or missing effects.

    Args:
        lines: Lines of the log.
        command: Command that generated the page.
        rows: Samples per run.
        intervals: Method of the 90 % intervals.
    """
    return "\n".join(
        [
            "# Realistic test bench recordings",
            "",
            f"Made by `{command}`.",
            "Motors of 12, 24 and 48 V and 5 to 500 W are drawn by documented scaling and "
            "simulated by a fixed-step Runge-Kutta method that shares no code with the library.",
            f"Each campaign has three training runs and one validation run of {rows} samples, "
            "written to files and read by the reader.",
            f"Intervals are 90 % intervals, {intervals}.",
            "The docstring of `benchmarks/benches/cases.py` lists the required and the permitted "
            "effects of each case.",
            "",
            'The column "at noise level" gives the fraction of campaigns with a validation error '
            f"of at most {_NEAR} times the noise in both current and speed; with missing rows no "
            "model reaches this level, because the voltage of these rows is lost.",
            '"Wrong with p > 0.95" counts campaigns in which an absent effect type has a '
            "probability above 95 %.",
            '"Search truncated" counts campaigns in which the search used up its operations.',
            "Seconds are from a shared machine; Gop is the number of operations that the library "
            "counts, which does not depend on the machine.",
            "",
            *_cases(lines),
            "",
            *_missed(lines),
            "",
        ]
    )


def _cases(lines: Sequence[Line]) -> list[str]:
    head = ["case", "campaigns", "refused", "failed", "all effects named", "no wrong effect named"]
    head += [
        "wrong with p > 0.95",
        "search truncated",
        "at noise level",
        *(f"coverage of `{name}`" for name in COVERED),
    ]
    head += ["median s", "median Gop", "peak MB"]
    rows = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    for name in [cell.name for cell in CELLS]:
        some = [line for line in lines if line["cell"] == name]
        if some:
            rows.append(f"| {name.replace(':', ', ')} | {' | '.join(_cells(some))} |")
    for word, chosen in (("all without effects", True), ("all with effects", False)):
        some = [line for line in lines if line["cell"].endswith(":clean") is chosen]
        if some:
            rows.append(f"| **{word}** | {' | '.join(_cells(some))} |")
    return rows


def _cells(some: Sequence[Line]) -> list[str]:
    done = [line for line in some if "named" in line]
    return [
        str(len(some)),
        str(sum("refused" in line for line in some)),
        str(sum("failed" in line for line in some)),
        _share(done, lambda line: line["right"]),
        _share(done, lambda line: not line["wrong"]),
        str(sum(bool(line["sure"]) for line in done)),
        str(sum(not line["complete"] for line in done)),
        _share(done, lambda line: max(line["ratios"]) <= _NEAR),
        *(_coverage(done, name) for name in COVERED),
        *(_median(done, name) for name in ("seconds", "gop")),
        f"{max((line['memory_MB'] for line in done), default=0):.0f}",
    ]


def _share(done: Sequence[Line], holds: Callable[[Line], bool]) -> str:
    return f"{100 * np.mean([holds(line) for line in done]):.0f} %" if done else "-"


def _median(done: Sequence[Line], name: str) -> str:
    known = [line[name] for line in done if line[name] is not None]
    return f"{np.median(known):.0f}" if known else "-"


def _coverage(done: Sequence[Line], name: str) -> str:
    """Number of intervals that contain the truth, of how many, and the largest deviation."""
    held = [line["inside"][name] for line in done if name in line["inside"]]
    if not held:
        return "-"
    worst = max(abs(line["deviations"][name]) for line in done if name in line["inside"])
    return f"{sum(held)} of {len(held)}, {worst:.1f} sd"


def _missed(lines: Sequence[Line]) -> list[str]:
    """Table of campaigns that were refused or failed, or have missing or wrong effects."""
    rows = ["## Campaigns with errors", "", "| number | case | hidden | result |"]
    rows += ["|---|---|---|---|"]
    for line in sorted(lines, key=lambda one: one["number"]):
        ending = line.get("refused") or line.get("failed")
        if not ending and line["right"] and not line["wrong"]:
            continue
        if not ending:
            pairs = zip(line["named"], line["probabilities"], strict=True)
            ending = ", ".join(f"{name} ({p:.2f})" for name, p in pairs) or "nothing named"
        hidden = ", ".join(line.get("hidden", ())) or "nothing"
        rows.append(f"| {line['number']} | {line['cell']} | {hidden} | {ending} |")
    return rows
