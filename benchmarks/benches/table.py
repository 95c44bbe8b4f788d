"""The Markdown page of the benchmark, from its log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from benchmarks.benches.cases import CELLS, COVERED

__all__ = ["page"]

Line = dict[str, Any]

_NEAR: Final = 1.05
"""Validation error over the noise up to which nothing is missing."""


def page(lines: Sequence[Line], command: str, rows: int, intervals: str) -> str:
    """The page: one row a case and kind of motor, then what was named wrongly or not at all.

    Args:
        lines: Lines of the log.
        command: That made it.
        rows: Samples a run.
        intervals: How the 90 % intervals were made.
    """
    return "\n".join(
        [
            "# Campaigns as benches record them",
            "",
            f"Made by `{command}`.",
            "Motors of 12, 24 and 48 V and 5 to 500 W are drawn by documented scaling and "
            "simulated by a fixed-step Runge-Kutta method that shares no code with the library.",
            f"Each campaign has three training runs and one validation run of {rows} samples, "
            "which go through files and the reader.",
            f"Intervals are of 90 %, {intervals}.",
            "What has to be named, and what may be, in each case stands at the top of "
            "`benchmarks/benches/cases.py`.",
            "",
            'The column "to the noise" counts validation errors of at most '
            f"{_NEAR} times the noise, in current and speed both; "
            "where rows are missing the voltage of these rows is lost, and no model comes there.",
            '"Sure and wrong" counts campaigns in which a kind that is not there has a '
            "probability above 95 %.",
            '"Search cut short" counts those in which the budget of the effort ended it.',
            "Seconds are those of a shared machine; Gop are operations of the library's own "
            "count, which are the same on every machine.",
            "",
            *_cases(lines),
            "",
            *_missed(lines),
            "",
        ]
    )


def _cases(lines: Sequence[Line]) -> list[str]:
    head = ["case", "campaigns", "refused", "failed", "named rightly", "nothing else named"]
    head += [
        "sure and wrong",
        "search cut short",
        "to the noise",
        *(f"`{name}` covered" for name in COVERED),
    ]
    head += ["median s", "median Gop", "peak MB"]
    rows = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    for name in [cell.name for cell in CELLS]:
        some = [line for line in lines if line["cell"] == name]
        if some:
            rows.append(f"| {name.replace(':', ', ')} | {' | '.join(_cells(some))} |")
    for word, chosen in (("all clean", True), ("all others", False)):
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
    return f"{np.median([line[name] for line in done]):.0f}" if done else "-"


def _coverage(done: Sequence[Line], name: str) -> str:
    """Intervals that hold the truth, of how many, and the largest deviation."""
    held = [line["inside"][name] for line in done if name in line["inside"]]
    if not held:
        return "-"
    worst = max(abs(line["deviations"][name]) for line in done if name in line["inside"])
    return f"{sum(held)} of {len(held)}, {worst:.1f} sd"


def _missed(lines: Sequence[Line]) -> list[str]:
    """Campaigns that were refused or failed, or where a name is missing or wrong."""
    rows = ["## Campaigns that went wrong", "", "| number | case | hidden | ended |"]
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
