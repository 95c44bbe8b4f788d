"""Proposed run as a CSV file for a bench, as data for scripts, and in words."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from identification.design.models import Quantity, parameter_quantity
from identification.design.propose import Proposal
from identification.design.response import load_shape
from identification.design.task import UNITS
from identification.result.entries import finite_or_null
from identification.result.numbers import number_text, unit_prefix

__all__ = ["profile_csv", "proposal_entry", "summary"]

_DECIMALS: Final = 6
_LEAST_WRONG: Final = 1e-6
"""Smallest probability that a sentence states; the linearisation does not support less."""


def profile_csv(proposal: Proposal) -> str:
    """Columns ``time_s,voltage_V,temperature_degC``, one row a sample; ends at zero voltage.

    A bench with a load has the column ``load_Nm`` too.
    """
    task, best, interval = proposal.task, proposal.best, proposal.task.interval
    digits = max(_DECIMALS, 3 - math.floor(math.log10(interval)))
    rows = [
        f"{k * interval:.{digits}f},{value:.{_DECIMALS}f},{best.temperature:g}"
        for k, value in enumerate(best.voltage + 0.0)
    ]
    header = "time_s,voltage_V,temperature_degC"
    if task.limits.load:
        header += ",load_Nm"
        loads = best.load * load_shape(task.rows)
        rows = [f"{row},{load:.6g}" for row, load in zip(rows, loads, strict=True)]
    return "\n".join([header, *rows]) + "\n"


def proposal_entry(proposal: Proposal) -> dict[str, Any]:
    """The design without its samples, as plain data for JSON."""
    task, best, split = proposal.task, proposal.best, proposal.separation
    entry = {
        "schema_version": 1,
        "profile": best.profile.label,
        "rows": task.rows,
        "sample_rate_hz": 1.0 / task.interval,
        "duration_s": task.duration,
        "temperature_degC": best.temperature,
        "load_Nm": best.load,
        "score_by_temperature": [
            {"temperature_degC": temperature, "score_bits": score}
            for temperature, score in proposal.by_temperature.items()
        ],
        "limits": task.limits.entry(),
        "predicted_peaks": {"voltage": float(np.abs(best.voltage).max())} | proposal.peaks,
        "units": UNITS,
        "noise": dict(zip(("current_A", "speed_rad_s"), task.noise.tolist(), strict=True)),
        "models": [
            {"name": model.label or None, "probability": model.probability, "information_bits": b}
            for model, b in zip(task.models, proposal.bits, strict=True)
        ],
        "separation": None,
        "parameters": {one.name: _widths(proposal, one) for one in _parameters(proposal)},
        "narrow": None,
        "summary": summary(proposal),
    }
    if split is not None:
        p = np.array([model.probability for model in task.models])
        entry["separation"] = {
            "entropy_bits": float(-np.sum(p * np.log2(p))),
            "gain_bits_least": split.least_bits,
            "gain_bits_most": split.most_bits,
            "wrong_choice_most": split.wrong,
            "expected_log_bayes_factors": split.log_odds.tolist(),
        }
    if task.quantity is not None:
        entry["narrow"] = {"name": task.quantity.name} | _widths(proposal, task.quantity)
    found: dict[str, Any] = finite_or_null(entry)
    return found


def summary(proposal: Proposal) -> list[str]:
    """Sentences: the run, its purpose, and the expected gain."""
    task, best = proposal.task, proposal.best
    peaks = proposal.peaks
    sentences = [
        f"Play {task.duration:.4g} s at {1.0 / task.interval:.4g} Hz at {best.temperature:g} °C: "
        f"{best.profile.label}.",
        f"Voltage up to {np.abs(best.voltage).max():.4g} V; in all draws of the parameters the "
        f"current stays below {peaks['current']:.4g} A and the speed below "
        f"{peaks['speed']:.4g} rad/s.",
    ]
    if best.load:
        sentences.append(
            f"Load the shaft with {best.load:.4g} N m against positive speed between the two "
            "pauses; the fit finds the load by itself."
        )
    if (split := proposal.separation) is not None:
        names = [" + ".join(term.name for term in one.model.terms) for one in task.models]
        sentences.append(
            f"Purpose: tell {' from '.join(names)}. Expected gain: {split.least_bits:.2f} to "
            f"{split.most_bits:.2f} bits; the wrong one remains more probable with a probability "
            f"of at most {max(split.wrong, _LEAST_WRONG):.2g}."
        )
    quantity = task.quantity
    chosen = [quantity] if quantity else _widest(proposal)
    for one in chosen:
        width = _widths(proposal, one)
        now, then = width["width_before"], width["width_after"]
        factor, unit = unit_prefix(one.unit, [now, then])
        unit = "" if unit in ("-", "1") else f" {unit}"
        sentences.append(
            f"Expected 90 % interval of {one.name}, if the model is complete: "
            f"{number_text(factor * then, 3)}{unit} wide instead of "
            f"{number_text(factor * now, 3)}{unit}."
        )
    if not quantity:
        sentences.append(f"Expected information on the parameters: {proposal.bits[0]:.1f} bits.")
    return sentences


def _parameters(proposal: Proposal) -> list[Quantity]:
    """Each parameter of the final model as a quantity."""
    model = proposal.task.models[0]
    return [parameter_quantity(name, model) for name in model.names]


def _widest(proposal: Proposal) -> list[Quantity]:
    """The three parameters that the run narrows most."""

    def ratio(one: Quantity) -> float:
        width = _widths(proposal, one)
        before: float = width["width_before"]
        return float(width["width_after"]) / before if before > 0.0 else 1.0

    return sorted(_parameters(proposal), key=ratio)[:3]


def _widths(proposal: Proposal, one: Quantity) -> dict[str, Any]:
    return {
        "unit": one.unit,
        "value": one.value,
        "width_before": one.width(proposal.task.models[0].covariance),
        "width_after": one.width(proposal.covariance),
    }
