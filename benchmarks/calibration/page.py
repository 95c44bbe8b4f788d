"""Markdown page and figures of the benchmark, from its log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final

import numpy as np

from benchmarks.calibration.figures import rank_histograms
from benchmarks.calibration.plan import KINDS, NOISES
from benchmarks.calibration.statistics import Line, band, coverage, ranks, uniformity
from identification.quantities import DECLARED_PARAMETERS
from identification.speed_loop import METRIC_UNITS

__all__ = ["figures", "page"]

_SHORT: Final = 1200
_FAR: Final = 5.0
"""Deviation of a parameter that is listed [sd]."""
_EDGES: Final = (0.0, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0)
_PICTURES: Final = "../pictures/calibration"
_DEGREES: Final = ("25", "125")


def _has_noise(name: str) -> Callable[[Line], bool]:
    return lambda line: line["noise"] == name


_GROUPS: Final[dict[str, Callable[[Line], bool]]] = {
    "all": lambda line: True,
    "clean": lambda line: line["kind"] == "clean",
    "with an effect": lambda line: line["kind"] == "effect",
    "with an omitted effect": lambda line: line["kind"] == "omitted",
    "  effect withheld from the search": lambda line: bool(line["withheld"]),
    "  effect not in the catalogue": lambda line: (
        line["kind"] == "omitted" and not line["withheld"]
    ),
    **{f"{name} noise": _has_noise(name) for name in NOISES},
    f"short records (below {_SHORT} rows)": lambda line: line["rows"] < _SHORT,
    f"long records (from {_SHORT} rows)": lambda line: line["rows"] >= _SHORT,
    "intervals sampled": lambda line: line["is_sampled"],
    "intervals from the covariance of the fit": lambda line: not line["is_sampled"],
}


def page(lines: Sequence[Line], command: str, machine: str, findings: str = "") -> str:
    """Markdown page.

    Args:
        lines: Lines of the log.
        command: Command that generated the page.
        machine: Name of the processor.
        findings: Hand-written last part of the page, with its heading.
    """
    counted = [line for line in lines if "refused" not in line]
    refused = len(lines) - len(counted)
    seconds = [line["seconds"] for line in counted]
    return "\n".join(
        [
            "# Calibration of intervals and probabilities",
            "",
            f"Made by `{command}` on {machine} (one process, OMP_NUM_THREADS=1).",
            f"{len(lines)} campaigns; {refused} refused.  Seconds per campaign: median "
            f"{np.median(seconds):.1f}, 90 % quantile {np.quantile(seconds, 0.9):.1f}.",
            "",
            "Motors are drawn at random from 1 W to 10 kW, with five training and two validation "
            "runs of 600 to 2,500 rows each, or of 6,000 rows in every eighth block of 15 "
            "campaigns.",
            "A third of the campaigns is clean; a third has one effect of the catalogue with any "
            "of its laws; a third has an effect that the search may not use, because it was "
            "withheld or is not in the catalogue.",
            "The size of an effect is log-uniform over its usual range, so some are too small to "
            "be found.",
            "",
            "The rank is the fraction of the posterior draws below the true value "
            "([Talts et al. 2018](https://arxiv.org/abs/1804.06788)).",
            "The true motors come from a population instead of the prior; the priors are wide, so "
            "ranks are still uniform if the posterior is calibrated.",
            "Coverage is the fraction of ranks from 0.05 to 0.95, expected 90 %, of identified "
            "parameters and of feedback metrics with the controller `P:1`.",
            "A metric that is the same for all draws, such as an overshoot of zero, or infinite "
            "for some, has no rank.",
            "",
            "## Coverage by group",
            "",
            "The standard error counts campaigns, because the intervals of one campaign share "
            "their runs.",
            "The interval of `L` includes a lag of the current sensor that the runs do not exclude "
            "([decision 0023](../adr/0023-confounded-lags.md)), so it is wider than 90 % by "
            "design; a column omits it.",
            "",
            *_by_group(counted),
            "",
            "## Coverage of each parameter",
            "",
            *_by_name(counted, "parameters", DECLARED_PARAMETERS),
            "",
            f"![Rank histograms of the parameters]({_PICTURES}/parameters.svg)",
            "",
            "## Coverage of each feedback metric",
            "",
            *_by_name(counted, "feedback", _metrics()),
            "",
            f"![Rank histograms of the feedback metrics]({_PICTURES}/feedback.svg)",
            "",
            "## Reliability of the probabilities",
            "",
            "Each effect and each of its alternatives states a probability.",
            "A listed effect is right if the motor has it; `unlisted` is right if the search could "
            "not use the effect of the motor.",
            "",
            *_reliability(counted),
            "",
            f"## Parameters beyond {_FAR:g} standard deviations",
            "",
            *_far(counted),
            "",
            *([findings] if findings else []),
        ]
    )


def figures(lines: Sequence[Line]) -> dict[str, str]:
    """SVG text of each figure, by file name."""
    drawn: dict[str, dict[str, list[float]]] = {
        "parameters": {
            f"{name}, {kind}": _ranks([x for x in lines if x["kind"] == kind], "parameters", name)
            for name in DECLARED_PARAMETERS
            for kind in KINDS
        },
        "feedback": {name: _ranks(lines, "feedback", name) for name in _metrics()},
    }
    drawn = {what: {k: v for k, v in panels.items() if v} for what, panels in drawn.items()}
    return {
        "parameters.svg": rank_histograms("Ranks of the parameters", drawn["parameters"], 3),
        "feedback.svg": rank_histograms("Ranks of the feedback metrics", drawn["feedback"], 4),
    }


def _metrics() -> list[str]:
    return [f"{name}@{degrees}" for name in METRIC_UNITS for degrees in _DEGREES]


def _ranks(lines: Iterable[Line], what: str, name: str) -> list[float]:
    return [value for line in lines for value in ranks(line, what, name)]


def _by_group(lines: Sequence[Line]) -> Iterator[str]:
    yield "| campaigns | number | parameters | parameters but `L` | feedback metrics |"
    yield "|---|---|---|---|---|"
    for name, belongs in _GROUPS.items():
        some = [line for line in lines if belongs(line)]
        found = [
            coverage(some, "parameters"),
            coverage([_without(line, "L") for line in some], "parameters"),
            coverage(some, "feedback"),
        ]
        if some:
            label = f"of these: {name.strip()}" if name.startswith(" ") else name
            yield f"| {label} | {len(some)} | {' | '.join(str(one or '') for one in found)} |"


def _without(line: Line, name: str) -> Line:
    kept = {key: entry for key, entry in line["parameters"].items() if key != name}
    return line | {"parameters": kept}


def _by_name(lines: Sequence[Line], what: str, names: Iterable[str]) -> Iterator[str]:
    kinds = ("clean", "with an effect", "with an omitted effect")
    yield f"| quantity | {' | '.join(kinds)} | all | 99 % band | uniformity p |"
    yield "|---|---|---|---|---|---|---|"
    for name in names:
        cells = []
        for group in (*kinds, "all"):
            found = coverage(filter(_GROUPS[group], lines), what, name)
            cells.append(f"{100 * found.fraction:.0f} % of {found.intervals}" if found else "")
        values = _ranks(lines, what, name)
        if values:
            low, high = (100 * end / len(values) for end in band(len(values), 0.9))
            cells += [f"{low:.0f}-{high:.0f} %", f"{uniformity(values):.2g}"]
            label = name.replace("@", "` at ") + " °C" if "@" in name else f"{name}`"
            yield f"| `{label} | {' | '.join(cells)} |"


def _reliability(lines: Sequence[Line]) -> Iterator[str]:
    yield "| campaigns | stated probability | claims | mean stated | right |"
    yield "|---|---|---|---|---|"
    for group in ("clean", "with an effect", "with an omitted effect"):
        claims = [claim for line in filter(_GROUPS[group], lines) for claim in line["claims"]]
        if not claims:
            yield f"| {group} | | 0 | | |"
        for low, high in zip(_EDGES[:-1], _EDGES[1:], strict=True):
            some = [c for c in claims if low <= c[1] < high or c[1] == high == 1.0]
            if some:
                mean = np.mean([c[1] for c in some])
                right = sum(c[2] for c in some)
                yield (
                    f"| {group} | {100 * low:.0f}-{100 * high:.0f} % | {len(some)} "
                    f"| {100 * mean:.1f} % | {right} ({100 * right / len(some):.0f} %) |"
                )


def _far(lines: Sequence[Line]) -> Iterator[str]:
    yield "| number | noise | rows | hidden | named | deviation [sd] |"
    yield "|---|---|---|---|---|---|"
    for line in lines:
        far = {
            name: entry[1]
            for name, entry in line["parameters"].items()
            if entry[3] and abs(entry[1]) > _FAR
        }
        if far:
            words = ", ".join(f"`{name}` {value:+.1f}" for name, value in far.items())
            hidden = ", ".join(line["hidden"]) or "nothing"
            named = ", ".join(line["named"]) or "nothing"
            yield (
                f"| {line['number']} | {line['noise']} | {line['rows']} | {hidden} | {named} "
                f"| {words} |"
            )
