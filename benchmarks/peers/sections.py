"""Sections of the page on the whole loop, the arithmetic and the growth of the cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from benchmarks.peers.plots import costs_by_rows
from benchmarks.peers.statistics import Line, exponent, median, names_of, of, rates, sizes_of

__all__ = ["arithmetic", "growth", "loops"]

_PICTURES: Final = "../pictures/peers"


def loops(lines: Sequence[Line]) -> Iterator[str]:
    """Whole loop of motorid, and the nearest chain of peers."""
    yield from ("## Whole loop", "")
    yield (
        "Fit, search for effects, posterior and feedback metrics by motorid, of a motor with a "
        "hidden brush drop.\nNo peer has the search and the metrics."
    )
    yield ""
    yield (
        "| rows | wall [s] | processor [s] | peak memory [MB] | fit [s] | effects [s] | "
        "posterior [s] | metrics and result [s] | named | draws | error [sd] |"
    )
    yield "|---:|" + "---:|" * 7 + "---|---|---:|"
    for line in sorted(of(lines, "loop"), key=lambda x: x["rows"]):
        stages = line["stages"]
        ends = {"effects": "posterior", "posterior": "feedback", "feedback": "done"}
        spent = [stages["effects"], *(stages[b] - stages[a] for a, b in ends.items())]
        yield (
            f"| {line['rows']:,} | {line['wall']['loop']:.0f} | {line['cpu']['loop']:.0f} "
            f"| {line['peak_mb']:.0f} | {' | '.join(f'{s:.1f}' for s in spent)} "
            f"| {', '.join(line['named']) or 'nothing'} | {line['source']} "
            f"| {np.max(np.abs(line['deviations'])):.1f} |"
        )
    yield ""
    chained = list(_chained(lines))
    if chained:
        yield (
            "The parts by peers for 10,000 rows, processor time.\n"
            "They fit and sample the nominal model; a found term needs new code for both."
        )
        yield ""
        yield (
            "| programs | fit [s] | terms [s] | 1,000 effective samples [s] | together [s] | "
            "first calls [s] |"
        )
        yield "|---|" + "---:|" * 5
        yield from chained
        yield ""


def _chained(lines: Sequence[Line]) -> Iterator[str]:
    """Sum of the parts by peers, which is the nearest to a whole loop that they have."""
    for rows in sizes_of(lines, "terms"):
        fits, terms = (of(lines, p, n, rows) for p, n in (("fit", "scipy"), ("terms", "PySINDy")))
        for name in names_of(lines, "posterior", rows):
            some = of(lines, "posterior", name, rows)
            if name == "motorid" or not fits or not terms:
                continue
            parts = [median(fits, lambda x: x["cpu"]["fit"])]
            parts.append(median(terms, lambda x: x["cpu"]["terms"]))
            parts.append(1000.0 / rates(some, "cpu_s_with_warm_up"))
            first = fits[0]["cpu"]["first call"] + some[0]["cpu"]["first call"]
            yield (
                f"| scipy, PySINDy, {name} | {' | '.join(f'{part:.3g}' for part in parts)} "
                f"| {sum(parts):.3g} | {first:.3g} |"
            )


def arithmetic(lines: Sequence[Line]) -> Iterator[str]:
    """Time per row and walker beside the hand-tuned kernels."""
    for line in of(lines, "kernels"):
        ns, operations = line["ns"], line["operations"]
        yield from ("## Arithmetic", "")
        yield (
            f"Processor time per row and walker on one core, 64 walkers, {line['rows']:,} rows, "
            "median of seven turns."
        )
        yield from ("", "| model | program | time [ns] |", "|---|---|---:|")
        for key, value in ns.items():
            name, _, model = key.partition(", ")
            yield f"| {model} | {name} | {value:.2f} |"
        yield ""
        yield (
            f"motorid counts {operations['nominal']:.0f} operations for the nominal model and "
            f"{operations['friction']:.0f} with dry friction, on {line['substeps']:.2f} substeps "
            "per row."
        )
        yield (
            "The hand-tuned friction holds the sign of the speed over an interval, so its map is "
            "as linear as that of the nominal model, and only the one interval in a hundred with a "
            "zero of the speed is solved by events."
        )
        yield (
            "motorid linearises the smoothed law in every interval (square roots, divisions and a "
            "matrix function of the Jacobian), because the same code must integrate any effect; "
            "it includes an asymmetry that the hand-tuned kernel omits."
        )
        yield ""


def growth(lines: Sequence[Line]) -> Iterator[str]:
    """Cost against rows and against effects, with exponents."""
    yield from ("## Cost against rows", "", "| cost | rows | exponent |", "|---|---|---:|")
    for name, (sizes, costs) in costs_by_rows(lines).items():
        shown = ", ".join(f"{n:,.0f}: {c:.3g} s" for n, c in zip(sizes, costs, strict=True))
        power = exponent(sizes, costs)
        yield f"| {name} | {shown} | {'' if np.isnan(power) else f'{power:.2f}'} |"
    yield ""
    yield f"![Time of 1,000 effective samples]({_PICTURES}/posterior.svg)"
    yield ""
    yield f"![Time of a fit and of a whole loop]({_PICTURES}/identification.svg)"
    yield ""
    for line in of(lines, "effects"):
        models: list[dict[str, Any]] = line["models"]
        yield from ("## Cost against effects", "")
        yield (
            "Time of one likelihood per row and walker as effects are added, "
            f"{line['rows']:,} rows."
        )
        yield ""
        yield (
            "| added effect | parameters | operations | substeps per row | time [ns] | refit [s] |"
        )
        yield "|---|---:|---:|---:|---:|---:|"
        for model in models:
            yield (
                f"| {model['added'] or 'none'} | {model['parameters']} | {model['operations']:.0f} "
                f"| {model['substeps']:.2f} | {model['ns']:.2f} | {model['fit_cpu_s']:.2f} |"
            )
        with_effects = models[1:]
        power = exponent([m["parameters"] for m in models], [m["ns"] for m in models])
        further = exponent([m["parameters"] for m in with_effects], [m["ns"] for m in with_effects])
        yield ""
        yield (
            f"The exponent of time over the number of parameters is {power:.2f}, and {further:.2f} "
            "from the first effect on."
        )
        yield (
            "The nominal model is linear and needs no Jacobian; the first effect makes the step "
            "nonlinear, and the brush drop adds a logarithm and an exponential to each."
        )
        yield ""
        yield f"![Time of one likelihood with 0 to 5 effects]({_PICTURES}/effects.svg)"
        yield ""
