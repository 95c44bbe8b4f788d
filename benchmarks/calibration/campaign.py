"""Simulation and identification of one campaign, and the ranks of its true values."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench import make_campaign
from benchmarks.calibration.plan import Item
from identification import FitOptions, Identification, identify
from identification.errors import IdentificationError
from identification.quantities import DECLARED_PARAMETERS
from identification.speed_loop import METRIC_UNITS, parse_controller
from identification.speed_loop.loop import close, motor_draws
from identification.speed_loop.margins import bandwidth, stability_margins
from identification.speed_loop.step_response import StepResponse, step_metrics

__all__ = ["measured", "metric_draws", "rank"]

Array = NDArray[np.float64]

_CONTROLLER: Final = "P:1"
_TEMPERATURES: Final = (25.0, 125.0)
_EVEN: Final = 1e-9
"""Relative spread below which draws count as one value, which has no rank."""


def measured(item: Item) -> dict[str, Any]:
    """Identify one campaign; return its line of the log.

    Args:
        item: The campaign.
    """
    effects = [] if item.effect is None else [item.effect]
    campaign = make_campaign(item.motor, effects, item.number, item.options)
    line: dict[str, Any] = {
        "number": item.number,
        "kind": item.kind,
        "noise": item.noise,
        "rows": item.rows,
        "is_sampled": item.is_sampled,
        "hidden": [] if item.effect is None else [item.effect.name, item.effect.law],
        "size": None if item.effect is None else round(item.effect.size or 0.0, 4),
        "withheld": list(item.withheld),
    }
    began = time.perf_counter()
    try:
        found = identify(
            [run.frame for run in campaign.training],
            [run.frame for run in campaign.validation],
            FitOptions(seed=item.number, posterior=item.is_sampled),
            withheld=item.withheld,
        )
    except IdentificationError as error:
        return line | {"refused": f"{type(error).__name__}: {error}"}
    seconds = round(time.perf_counter() - began, 1)
    truth = {name: float(campaign.truth["parameters"][name]) for name in DECLARED_PARAMETERS}
    outcome = found.findings.analysis.outcome
    claims = [list(claim) for claim in _claims(item, found.result)]
    return line | {
        "seconds": seconds,
        "source": found.findings.sample.source if found.findings.sample else "fit",
        "named": [effect["name"] for effect in found.result["effects"]],
        "claims": claims,
        "complete": outcome is None or outcome.complete,
        "omitted": [term.name for term in found.findings.omitted],
        "ratios": [
            None if entry["noise_ratio"] is None else round(entry["noise_ratio"], 4)
            for entry in found.result["errors"]["after"]["validation"].values()
        ],
        "parameters": dict(_parameters(found, truth)),
        "feedback": dict(_feedback(found, truth)),
    }


def rank(draws: Array, truth: float, seed: int) -> float | None:
    """Fraction of the draws below the true value; ties are split at random.

    Args:
        draws: (n_draw,) from the posterior.
        truth: The true value.
        seed: Seed of the split.

    Returns:
        The fraction, uniformly distributed if the posterior is calibrated; None if a value is not
        finite or all draws are equal.
    """
    if not (np.isfinite(draws).all() and np.isfinite(truth)):
        return None
    if np.ptp(draws) <= _EVEN * np.abs(draws).max(initial=0.0):
        return None
    ties = float(np.mean(draws == truth))
    share = float(np.random.default_rng(seed).uniform())
    return round(float(np.mean(draws < truth)) + share * ties, 5)


def metric_draws(values: Mapping[str, ArrayLike], temperature: float) -> dict[str, Array]:
    """Feedback metrics of each draw, (n_draw,) by name; NaN where undefined.

    Args:
        values: Draws of the nominal parameters.
        temperature: Temperature of winding and magnet [degC].
    """
    with np.errstate(all="ignore"):
        loop = close(
            motor_draws(values, [temperature]), [temperature], parse_controller(_CONTROLLER)
        )
        response = StepResponse(loop)
        margins = stability_margins(loop)
        columns = (
            *vars(step_metrics(response)).values(),
            margins.gain_db,
            margins.phase_deg,
            np.where(response.is_stable, bandwidth(loop), np.nan),
        )
    return dict(zip(METRIC_UNITS, columns, strict=True))


def _parameters(
    found: Identification, truth: Mapping[str, float]
) -> Iterator[tuple[str, list[Any]]]:
    """Of each parameter: rank, deviation [sd], relative sd, identified, relative 90 % width."""
    draws = found.draws()
    for name, value in truth.items():
        entry = found.result["parameters"][name]
        deviation = (entry["mean"] - value) / entry["sd"]
        width = entry["sd"] / abs(value)
        yield name, [
            rank(draws[name], value, 0), round(deviation, 3), float(f"{width:.3g}"),
            entry["identified"], float(f"{(entry['q95'] - entry['q05']) / abs(value):.4g}"),
        ]  # fmt: skip


def _feedback(found: Identification, truth: Mapping[str, float]) -> Iterator[tuple[str, float]]:
    """Rank of each feedback metric that is defined for the true motor and all draws."""
    for temperature in _TEMPERATURES:
        drawn = metric_draws(found.draws(), temperature)
        true = metric_draws(truth, temperature)
        for name, values in drawn.items():
            found_rank = rank(values, float(true[name][0]), 0)
            if found_rank is not None:
                yield f"{name}@{temperature:g}", found_rank


def _claims(item: Item, result: Mapping[str, Any]) -> Iterator[tuple[str, float, bool]]:
    """Name and probability of each effect, alternatives included, and whether it is right.

    An `unlisted` effect is right if the search could not use the hidden one.
    """
    hidden = item.effect.name if item.effect is not None else None
    for effect in result["effects"]:
        for claim in (effect, *effect["alternatives"]):
            is_right = claim["name"] == (hidden if item.kind == "effect" else "unlisted")
            is_right = is_right and item.kind != "clean"
            yield claim["name"], round(claim["probability"], 5), is_right
