"""Fleet page as one self-contained HTML file without scripts.

text = render_fleet("November refit", refits)
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import Any

from markupsafe import Markup

from identification.fleet.causes import CAUSES
from identification.fleet.drift import FALSE_DISCOVERY_RATE, Drift, drifts
from identification.fleet.explanation import REPEATABILITY, Explanation, explanations
from identification.fleet.figure import fleet_figure, marks_of
from identification.fleet.outliers import (
    LEAST_MOTORS,
    NORMAL_MAD,
    POSITIVE,
    THRESHOLD,
    Spread,
    spread_of,
)
from identification.fleet.pooling import LEAST_POOLED, Pool, Quantiles, pools_of
from identification.fleet.refit import Refit
from identification.quantities import DECLARED_PARAMETERS
from identification.reporting.page import asset, page_environment, page_policy
from identification.result.effect_texts import effect_words
from identification.result.numbers import (
    interval_text,
    number_text,
    percent_text,
    signed_percent_text,
    unit_prefix,
    unit_text,
)

__all__ = ["content_security_policy", "explained_view", "render_fleet"]

_PACKAGE = "identification.fleet"
_MOST_LISTED = 60


def render_fleet(title: str, refits: Sequence[Refit], back: str = "") -> str:
    """Render the complete page, with a link `back` unless it is empty."""
    changes = drifts(refits)
    spreads = {name: spread_of(name, refits) for name in DECLARED_PARAMETERS}
    outliers = _outliers(refits, spreads)
    pools = pools_of(refits)
    moved = _moved(refits, changes)
    return page_environment(_PACKAGE).get_template("fleet.html.j2").render(
        title=title,
        back=back,
        policy=content_security_policy(),
        styles=_styles(),
        counts=Counter(refit.status for refit in refits),
        compared=sum(bool(found) for found in changes),
        outliers=outliers[:_MOST_LISTED],
        more_outliers=len(outliers) - len(outliers[:_MOST_LISTED]),
        moved=moved[:_MOST_LISTED],
        more_moved=len(moved) - len(moved[:_MOST_LISTED]),
        explained=_explained(refits, explanations(refits)),
        causes=CAUSES,
        most_listed=_MOST_LISTED,
        repeatability=percent_text(REPEATABILITY, 1),
        parameters=[
            _parameter(name, refits, spread, changes, pools) for name, spread in spreads.items()
        ],
        pools=[_pool(pool, refits) for pool in pools],
        least_pooled=LEAST_POOLED,
        names=list(DECLARED_PARAMETERS),
        motors=[_motor(refit) for refit in refits],
        threshold=THRESHOLD,
        least=LEAST_MOTORS,
        rate=percent_text(FALSE_DISCOVERY_RATE, 1),
    )  # fmt: skip


@cache
def content_security_policy() -> str:
    """Content security policy of the page: its own style sheets, and images only as data URLs."""
    return page_policy(_styles())


def _styles() -> tuple[Markup, ...]:
    """Style sheets of the report and of the fleet page."""
    return asset("identification.reporting", "report.css"), asset(_PACKAGE, "fleet.css")


def _remarkable(
    refit: Refit, name: str, reference: float | None, share: float | None, size: float | None
) -> dict[str, Any]:
    """Row of a motor and parameter that is an outlier or has changed significantly."""
    return {
        "refit": refit,
        "name": name,
        "value": _with_unit(refit.estimates[name].median, name),
        "reference": _with_unit(reference, name),
        "change": signed_percent_text(share),
        "size": size or 0.0,
    }


def _outliers(refits: Sequence[Refit], spreads: dict[str, Spread]) -> list[dict[str, Any]]:
    """Outlying motors, largest score first."""
    found = []
    for name, spread in spreads.items():
        for index, refit in enumerate(refits):
            if spread.is_outlier(index):
                value, median = refit.estimates[name].median, spread.median
                share = value / median - 1.0 if value is not None and median else None
                found.append(_remarkable(refit, name, median, share, spread.scores[index]))
    return sorted(found, key=lambda one: -abs(one["size"]))


def _moved(refits: Sequence[Refit], changes: Sequence[dict[str, Drift]]) -> list[dict[str, Any]]:
    """Significant changes since the last refit, largest first."""
    found = [
        _remarkable(refit, name, refit.previous.estimates[name].median, drift.relative, drift.sds)
        for refit, motor_changes in zip(refits, changes, strict=True)
        for name, drift in motor_changes.items()
        if drift.is_significant and refit.previous is not None
    ]
    return sorted(found, key=lambda one: -abs(one["size"]))


def _explained(
    refits: Sequence[Refit], found: Sequence[Explanation | None]
) -> list[dict[str, Any]]:
    """Motors with a significant change and its probable causes, the surest first."""
    rows = [
        {"refit": refit, **explained_view(one), "probability": max(one.causes.values())}
        for refit, one in zip(refits, found, strict=True)
        if one is not None and one.is_significant
    ]
    return sorted(rows, key=lambda row: -row["probability"])


def explained_view(explanation: Explanation) -> dict[str, Any]:
    """Words on a significant change: causes with probabilities, changes, and what to check."""
    listed = {cause.name: cause for cause in CAUSES}
    meanings = {"unlisted": "several causes, or one that is not listed", "none": "no change"}
    top = next(iter(explanation.likely), "")
    return {
        "causes": [
            {
                "name": name.replace("_", " "),
                "meaning": listed[name].meaning if name in listed else meanings[name],
                "probability": "> 99 %" if probability > 0.99 else percent_text(probability, 2),
            }
            for name, probability in explanation.likely.items()
        ],
        "changes": [
            f"{name} {signed_percent_text(change)}" for name, change in explanation.changes.items()
        ],
        "check": listed[top].check if top in listed else "",
        "differing": ", ".join(explanation.differing).replace("_", " "),
    }


def _with_unit(value: float | None, name: str) -> str:
    factor, unit = unit_prefix(DECLARED_PARAMETERS[name].unit, [value])
    return f"{number_text(None if value is None else factor * value)} {unit_text(unit)}"


def _parameter(
    name: str,
    refits: Sequence[Refit],
    spread: Spread,
    changes: Sequence[dict[str, Drift]],
    pools: Sequence[Pool],
) -> dict[str, Any]:
    # Over all types, by index of the fleet.
    pooled = {n: found for pool in pools if pool.name == name for n, found in pool.motors.items()}
    marks = marks_of(name, refits, spread, changes, pooled)
    return {
        "name": name,
        "meaning": DECLARED_PARAMETERS[name].meaning,
        "median": _with_unit(spread.median, name),
        "spread": _spread_text(name, spread.relative_scale),
        "count": spread.count,
        "undetermined": sum(name in refit.estimates for refit in refits) - spread.count,
        "outliers": sum(mark.is_outlier for mark in marks),
        "compared": sum(mark.drift is not None for mark in marks),
        "moved": sum(mark.is_significant for mark in marks),
        "pooled": any(mark.pooled for mark in marks),
        "figure": Markup(fleet_figure(name, marks, spread)) if marks else None,
    }


def _spread_text(name: str, scale: float | None) -> str:
    """Robust standard deviation, or in words if it is more than the median itself."""
    if scale is None:
        return ""
    if scale <= 1.0 or name not in POSITIVE:
        return f"robust standard deviation {percent_text(scale)}"
    # The median deviation of the logarithms, of which the scale is a multiple.
    factor = number_text((1.0 + scale) ** (1.0 / NORMAL_MAD), 2)
    return (
        f"half of the motors are more than a factor of {factor} away from it, too far for motors "
        "of one type"
    )


def _pool(pool: Pool, refits: Sequence[Refit]) -> dict[str, Any]:
    """Row of a pooled quantity; widths are those of the 90 % intervals of the pooled motors."""
    ratios = []
    for number, (low, _, high) in pool.motors.items():
        own = pool.own[number]
        if own.usable and own.q05 is not None and own.q95 is not None and own.q95 > own.q05:
            ratios.append((high - low) / (own.q95 - own.q05))
    spread = _range_text(pool.spread, pool.unit)
    if pool.is_relative:
        least, usual, most = map(percent_text, pool.spread)
        spread = f"{usual} ({least} … {most})"
    return {
        "type": pool.type,
        "name": pool.name,
        "count": pool.count,
        "given": sum(not pool.own[number].usable for number in pool.motors),
        "left_out": [refits[number].motor for number in pool.left_out],
        "mean": _range_text(pool.mean, pool.unit),
        "spread": spread,
        "narrower": f"{statistics.median(ratios):.2f}" if ratios else "–",
    }


def _range_text(quantiles: Quantiles, unit: str) -> str:
    low, median, high = quantiles
    shown = interval_text(median, low, high)
    symbol = "" if unit in ("-", "1", "") else f" {unit_text(unit)}"
    return f"{shown.median} ({shown.low} … {shown.high}){shown.power}{symbol}"


def _motor(refit: Refit) -> dict[str, Any]:
    known = [refit.estimates.get(name) for name in DECLARED_PARAMETERS]
    role = "validation" if refit.noise_ratios.get(("validation", "current")) else "training"
    return {
        "refit": refit,
        "values": [
            interval_text(one.median, one.q05, one.q95) if one and one.usable else None
            for one in known
        ],
        "role": role,
        "ratios": [refit.noise_ratios.get((role, channel)) for channel in ("current", "speed")],
        "notes": _notes(refit),
    }


def _notes(refit: Refit) -> list[str]:
    """Effects, error and first warning of a motor, each as a sentence of its own."""
    effects = ", ".join(effect_words(effect) for effect in refit.effects)
    count = len(refit.warnings)
    notes = [
        f"Effects: {effects}" if effects else "",
        refit.error,
        f"{count} warning{'s'[: count > 1]}: {refit.warnings[0]}" if count else "",
    ]
    return list(filter(None, notes))
