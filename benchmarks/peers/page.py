"""Markdown page of the comparison, from its log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from benchmarks.peers.child import TARGET
from benchmarks.peers.goals import METHOD, PROGRAMS, goals
from benchmarks.peers.sections import arithmetic, growth, loops
from benchmarks.peers.statistics import (
    Line,
    agreement,
    median,
    names_of,
    of,
    rates,
    shift,
    sizes_of,
    spread_ratio,
)
from benchmarks.peers.task import NAMES
from benchmarks.speed import CASES, RUNS
from identification.effects.catalogue import CATALOGUE

__all__ = ["page"]

_TRUTH: Final = np.array(CASES[0].values)

_TERMS: Final = {
    "coulomb_friction": ("sgn w (torque)",),
    "brush_drop": ("sgn i (voltage)",),
    "quadratic_drag": ("w |w| (torque)",),
    "load_torque": ("1 (torque)",),
    "flux_saturation": ("i |i| (torque)", "|i| w (voltage)"),
}
"""Terms of the library of PySINDy that state each effect; one of several is enough."""


def page(lines: Sequence[Line], command: str, machine: str) -> str:
    """Markdown page.

    Args:
        lines: Lines of the log.
        command: Command that generated the page.
        machine: Processor, cores and Python.
    """
    return "\n".join(
        [
            "# Comparison with other programs",
            "",
            f"Made by `{command}` on {machine}.",
            f"Versions: {_versions(lines)}.",
            "",
            METHOD.format(runs=RUNS),
            PROGRAMS,
            "## Goals",
            "",
            "| goal | measured | reached |",
            "|---|---|---|",
            *(f"| {what} | {found} | {reached} |" for what, found, reached in goals(lines)),
            "",
            *_posterior(lines),
            *_fits(lines),
            *_terms(lines),
            *loops(lines),
            *arithmetic(lines),
            *growth(lines),
            *_failures(lines),
        ]
    )


def _posterior(lines: Sequence[Line]) -> Iterator[str]:
    yield from ("## Posterior", "")
    for rows in sizes_of(lines, "posterior"):
        ours = of(lines, "posterior", "motorid", rows)
        yield from (f"### {rows:,} rows", "")
        yield (
            "| program | ESS/s, processor | ESS/s, wall | with warm-up, processor | "
            "with warm-up, wall | warm-up [s] | first call [s] | peak memory [MB] | least ESS | "
            "evaluations per effective sample | "
            "R-hat | difference of means [MC sd] | difference of means [sd] | sd ratio | "
            "error [sd] |"
        )
        yield "|---|" + "---:|" * 14
        for name in names_of(lines, "posterior", rows):
            some = of(lines, "posterior", name, rows)
            last = some[-1]
            compared = (
                f"{agreement(last, ours[0]):.1f} | {shift(last, ours[0]):.2f} | "
                f"{spread_ratio(last, ours[0]):.2f}"
                if ours and name != "motorid"
                else "| | "
            )
            cells = [
                *(
                    f"{rates(some, kind):,.3g}"
                    for kind in ("cpu_s", "wall_s", "cpu_s_with_warm_up", "wall_s_with_warm_up")
                ),
                f"{last['wall'].get('warm-up', 0.0):.2g}",
                f"{last['wall']['first call']:.2g}",
                f"{median(some, lambda x: x['peak_mb']):.0f}",
                f"{min(last['ess']):,.0f}",
                f"{last['evaluations'] / min(last['ess']):.3g}",
                f"{last['r_hat']:.3f}",
                compared,
                f"{_error(last):.1f}",
            ]
            ended = "" if min(last["ess"]) >= TARGET else " (stopped by the time limit)"
            yield f"| {name}{ended} | {' | '.join(cells)} |"
        if ours:
            differences = [line["density_difference"] for line in ours]
            yield ""
            yield (
                "The log densities of motorid and of the hand-tuned kernel differ by at most "
                f"{max(differences):.1g} over 31 draws."
            )
        yield ""
    yield (
        "The means agree if their largest difference over nine parameters is below about 3.3 Monte "
        "Carlo standard deviations; the error is that of the worst posterior mean against the "
        "truth.\nThe loop is integrated as coarsely as half a standard deviation permits, so its "
        "means may differ by more."
    )
    yield (
        "An evaluation is a likelihood, of NUTS a likelihood with its gradient.\n"
        "The rate of motorid has two causes: three of four proposals are independent draws around "
        "the optimum, so an effective sample takes one or two evaluations instead of dozens; and "
        "the evaluations of all walkers share vector instructions.\n"
        "At 10,000 rows, most of the remaining time is that of emcee itself."
    )
    yield ""


def _error(line: Line) -> float:
    """Largest deviation of a mean of the seven parameters from the truth [sd]."""
    return float(np.max(np.abs(np.array(line["mean"])[:7] - _TRUTH) / np.array(line["sd"])[:7]))


def _fits(lines: Sequence[Line]) -> Iterator[str]:
    yield from ("## Fit of the nominal model", "")
    yield (
        "| rows | program | processor [s] | wall [s] | first call [s] | peak memory [MB] | "
        "simulations with derivatives | largest relative error | parameter | end |"
    )
    yield "|---:|---|" + "---:|" * 6 + "---|---|"
    for rows in sizes_of(lines, "fit"):
        for name in names_of(lines, "fit", rows):
            some = of(lines, "fit", name, rows)
            last = some[-1]
            errors = np.abs(np.array(last["values"]) / _TRUTH - 1.0)
            cells = [
                f"{median(some, lambda x: x['cpu']['fit']):.3g}",
                f"{median(some, lambda x: x['wall']['fit']):.3g}",
                f"{last['wall']['first call']:.2g}",
                f"{median(some, lambda x: x['peak_mb']):.0f}",
                str(last.get("simulations", "")),
                f"{100 * errors.max():.2g} %",
                f"`{NAMES[int(np.argmax(errors))]}`",
                last.get("message", "converged" if last.get("converged") else "not converged"),
            ]
            yield f"| {rows:,} | {name} | {' | '.join(cells)} |"
    yield ""


def _terms(lines: Sequence[Line]) -> Iterator[str]:
    found = of(lines, "terms")
    if not found:
        return
    yield from ("## Terms of one hidden effect", "")
    yield (
        "Campaigns of the bench simulator, four training runs and one validation run of 2,000 rows."
    )
    yield ""
    yield "| hidden | size | motorid | PySINDy |"
    yield "|---|---:|---|---|"
    counts: dict[str, list[int]] = {"motorid": [0, 0, 0], "PySINDy": [0, 0, 0]}
    seconds: dict[str, list[float]] = {"motorid": [], "PySINDy": []}
    for effect in dict.fromkeys(line["effect"] for line in found):
        kind, _, size = effect.partition("=")
        cells = []
        for name in counts:
            answers = [x for x in of(found, "terms", name) if x["effect"] == effect]
            if not answers:
                cells.append("failed")
                continue
            named = answers[0]["named"]
            right = {kind} if name == "motorid" else set(_TERMS.get(kind, ()))
            exact = bool(named) and set(named) <= right if kind else not named
            counts[name][0] += 1
            counts[name][1] += int(exact)
            counts[name][2] += int(exact or bool(set(named) & right))
            seconds[name].append(sum(answers[0]["cpu"].values()))
            words = ", ".join(named).replace("|", "\\|") or "nothing"
            cells.append(words + ("" if exact else " (not exact)"))
        yield f"| {kind or 'nothing'} | {size} | {' | '.join(cells)} |"
    yield ""
    for name, (number, right_ones, among) in counts.items():
        if number:
            yield (
                f"{name}: {right_ones} of {number} exact, {among} with the right term among "
                f"others; median {np.median(seconds[name]):.2g} s of processor."
            )
    yield ""
    yield (
        f"motorid searches {len(CATALOGUE)} effects with free shapes and confirms them on the "
        "validation run; the library of PySINDy has eleven fixed terms, the true ones among them."
    )
    yield ""


def _failures(lines: Sequence[Line]) -> Iterator[str]:
    failed = [line for line in lines if "failed" in line]
    if failed:
        yield from ("## Failures", "", "| measurement | message |", "|---|---|")
        for line in failed:
            yield f"| `{line['key']}` | {line['failed'].replace('|', '/')} |"
        yield ""


def _versions(lines: Sequence[Line]) -> str:
    found: dict[str, set[str]] = {}
    for line in lines:
        for name, version in line.get("versions", {}).items():
            found.setdefault(name, set()).add(version)
    return ", ".join(f"{name} {' and '.join(sorted(v))}" for name, v in sorted(found.items()))
