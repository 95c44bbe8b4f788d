"""Intervals of campaigns with a withheld effect, compared with those of a fit with that effect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from benchmarks.calibration.campaign import measured
from benchmarks.calibration.plan import Item
from benchmarks.calibration.statistics import Line

__all__ = ["both_measured", "comparison"]

_PARAMETERS: Final = ("Ra25", "Kt25", "J", "b")
_COVERED: Final = 0.80
"""Least coverage that a fit without the true effect has to reach [-]."""
_WIDEST: Final = 3.0
"""Largest ratio of the widths of an interval without and with the true effect [-]."""
_LOW, _HIGH = 0.05, 0.95


def both_measured(item: Item) -> Line | None:
    """Identify a campaign without and with its withheld effect; None if none is withheld.

    Args:
        item: The campaign.

    Returns:
        The line of the fit without the effect; that of the other fit is its member ``allowed``.
    """
    if not item.withheld:
        return None
    return measured(item) | {"allowed": measured(replace(item, withheld=()))}


def comparison(lines: Sequence[Line], command: str, machine: str, findings: str = "") -> str:
    """Markdown page: coverage without and with the withheld effects, and ratios of the widths.

    Args:
        lines: Lines of the log.
        command: Command that generated the page.
        machine: Name of the processor.
        findings: Hand-written last part of the page, with its heading.
    """
    counted = [x for x in lines if "refused" not in x and "refused" not in x["allowed"]]
    seconds = [line["seconds"] + line["allowed"]["seconds"] for line in counted]
    return "\n".join(
        [
            "# Intervals without the true effect",
            "",
            f"Made by `{command}` on {machine} (one process, OMP_NUM_THREADS=1).",
            f"{len(counted)} campaigns; {len(lines) - len(counted)} refused.  Seconds per campaign "
            f"for both fits: median {np.median(seconds or [0]):.3g}.",
            "",
            "The motor of each campaign has one effect of the catalogue, with any of its laws.",
            "The runs are identified twice: with that effect withheld from the search, so that the "
            "model is incomplete, and with the whole catalogue.",
            "The campaigns are those of the group 'effect withheld from the search' of "
            "[Calibration](calibration.md).",
            "",
            f"Required: the 90 % intervals without the effect contain the true value in at least "
            f"{100 * _COVERED:.0f} %, and are no wider than {_WIDEST:g} times those of the fit "
            "with the effect.",
            "All intervals count, also those of parameters that are not identified.",
            "An interval has to be wider where the estimate itself is further off: the last column "
            f"counts the intervals whose true value is beyond {_WIDEST:g} half widths of the fit "
            "with the effect.",
            "",
            "| parameter | covers without | covers with | identified without | identified with "
            f"| median ratio of the widths | 90 % quantile | wider than {_WIDEST:g} times "
            "| of these, error requires it |",
            "|---|---|---|---|---|---|---|---|---|",
            *(_row(name, counted, (name,)) for name in _PARAMETERS),
            _row("all", counted, _PARAMETERS),
            "",
            "## Each campaign",
            "",
            "A ratio marked `*` belongs to an interval without the effect that does not contain "
            "the true value.",
            "",
            f"| number | noise | rows | withheld | named instead | named with the catalogue | "
            f"ratio of the widths of {', '.join(_PARAMETERS)} |",
            "|---|---|---|---|---|---|---|",
            *_campaigns(counted),
            "",
            *([findings] if findings else []),
        ]
    )


def _row(label: str, lines: Sequence[Line], names: Sequence[str]) -> str:
    pairs = [(x["parameters"][n], x["allowed"]["parameters"][n]) for x in lines for n in names]
    if not pairs:
        return f"| {label} | | | | | | | | |"
    without, known = zip(*pairs, strict=True)
    ratios = np.array([one[4] / other[4] for one, other in pairs])
    # Deviation [sd] times relative sd is the relative error of the estimate.
    needed = np.array([abs(one[1]) * one[2] / (0.5 * other[4]) for one, other in pairs])
    is_wide = ratios > _WIDEST
    cells = [
        *(f"{100 * np.mean(list(map(_covers, side))):.0f} %" for side in (without, known)),
        *(f"{sum(entry[3] for entry in side)} of {len(side)}" for side in (without, known)),
        f"{np.median(ratios):.2f}",
        f"{np.quantile(ratios, 0.9):.2f}",
        f"{np.sum(is_wide)} of {ratios.size}",
        f"{np.sum(is_wide & (needed > _WIDEST))}",
    ]
    return f"| {label if len(names) > 1 else f'`{label}`'} | {' | '.join(cells)} |"


def _campaigns(lines: Sequence[Line]) -> Iterator[str]:
    for line in sorted(lines, key=lambda line: line["hidden"]):
        other = line["allowed"]
        ratios = [
            f"{line['parameters'][name][4] / other['parameters'][name][4]:.2f}"
            + ("" if _covers(line["parameters"][name]) else "*")
            for name in _PARAMETERS
        ]
        named = [", ".join(one["named"]) or "nothing" for one in (line, other)]
        yield (
            f"| {line['number']} | {line['noise']} | {line['rows']} | {', '.join(line['hidden'])} "
            f"| {' | '.join(named)} | {', '.join(ratios)} |"
        )


def _covers(entry: Sequence[float | None]) -> bool:
    """True if the 90 % interval of a parameter contains the true value."""
    return entry[0] is not None and _LOW <= entry[0] <= _HIGH
