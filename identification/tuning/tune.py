"""Tuning of a speed loop over the uncertainty of the motor and a range of temperatures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from scipy.stats import beta

from identification.arrays import Array, evenly
from identification.errors import OptionError
from identification.result.entries import finite_or_null
from identification.speed_loop.controller import KINDS, AbstractController, parse_controllers
from identification.speed_loop.metrics import quantity
from identification.speed_loop.spread import checked_temperatures
from identification.tuning.blame import blamed
from identification.tuning.drive import GAINS, most_samples
from identification.tuning.hunting import hunting
from identification.tuning.judge import Judge, Judgement, slack_at
from identification.tuning.motor import UncertainMotor
from identification.tuning.search import controller_of, gains_of, searched
from identification.tuning.specification import METRICS, Specification
from identification.tuning.statement import statement

__all__ = ["tune"]

_DRAWS: Final = 400
_LONGER: Final = 3
_POINTS: Final = 200
_SPEED: Final = 100.0
_OF_REACH: Final = 0.5
_AT_LIMIT: Final = 1e4
"""Proportional gain over the static one at which the drive is at a limit up to the reference."""


@np.errstate(all="ignore")
def tune(
    motor: UncertainMotor,
    specification: Specification,
    *,
    temperatures: Sequence[float] = (25.0, 125.0),
    kinds: Sequence[str] = ("PI",),
    controllers: Sequence[str | AbstractController] = (),
    probability: float = 0.95,
    step: float | None = None,
) -> dict[str, Any]:
    """Controllers that meet a specification with a probability, or the distance from it.

    Args:
        motor: Motor with draws of its parameters.
        specification: Requirements and drive.  Controllers are tuned with the usual stability
            margins where it names none.
        temperatures: Temperatures of winding and magnet [degC].
        kinds: Kinds of controllers to tune, of `KINDS`; not used if controllers are given.
        controllers: Controllers to judge instead.
        probability: Fraction of the draws that shall meet the specification.
        step: Step of the reference [rad/s]; default: half the speed that the drive reaches.

    Returns:
        Content of the file of ``motorid tune``, as docs/tune.md describes it.

    Raises:
        OptionError: An option is not accepted; the message names all of them.
    """
    temperatures = sorted(set(checked_temperatures(temperatures)))
    _check(kinds, probability, step)
    if not controllers:
        specification = specification.with_usual_margins()
    thinned = motor.thinned(_DRAWS)
    reach = _reach(thinned, specification, temperatures)
    if step is None:
        step = _SPEED if reach is None else float(f"{_OF_REACH * reach:.2g}")
    judge = Judge(thinned, specification, temperatures, float(step))
    if controllers:
        given = [(one.text, gains_of(one)) for one in parse_controllers(controllers)]
    else:
        found = [searched(judge, kind, probability) for kind in kinds]
        given = [(controller_of(k, gains), gains) for k, gains in zip(kinds, found, strict=True)]
    fastest = _fastest_rise(judge, probability)
    entries = [_entry(judge, one, probability, (reach, fastest)) for one in given]
    return {
        "schema_version": 1,
        "specification": finite_or_null(asdict(specification)),
        "temperature_degC": temperatures,
        "step_rad_s": judge.step,
        "reachable_rad_s": reach,
        "fastest_rise_s": fastest,
        "probability": probability,
        "draws": thinned.count,
        "effects": [term.name for term in motor.model.terms],
        "omitted_effects": list(motor.omitted),
        "controllers": entries,
        "recommended": _recommended(entries, specification),
    }


def _check(kinds: Sequence[str], probability: float, step: float | None) -> None:
    known = ", ".join(KINDS)
    wrong = [f"kind {kind!r} is not known; expected {known}" for kind in kinds if kind not in KINDS]
    if not kinds:
        wrong.append(f"no kind given; expected some of {known}")
    if not 0.0 < probability <= 1.0:
        wrong.append(f"probability is {probability:g}; expected above 0 and at most 1")
    if step is not None and not 0.0 < step < np.inf:
        wrong.append(f"step is {step:g} rad/s; expected above 0")
    if wrong:
        raise OptionError("; ".join(wrong))


def _reach(
    motor: UncertainMotor, specification: Specification, temperatures: list[float]
) -> float | None:
    """Steady speed of the median linear motor under the limits, at its worst temperature [rad/s].

    None if the drive has no limit that bounds it.
    """
    draws = motor.draws
    speeds = []
    for temperature in temperatures:
        gain, poles = motor.plants(temperature)
        static = gain / poles[:, 2]
        speeds.append(np.median(static) * specification.voltage)
        # In steady state Kt i = b w; the static gain is Kt / (Ra b + Kt^2).
        constant = gain * np.maximum(draws["L"], np.finfo(float).tiny) * draws["J"]
        speeds.append(np.median(constant / draws["b"]) * specification.current)
    lowest = float(np.nanmin(speeds))
    return lowest if np.isfinite(lowest) else None


def _fastest_rise(judge: Judge, probability: float) -> float | None:
    """Rise time with the drive at its limits until the reference is reached [s].

    The fraction `probability` of the draws does not pass it at the worst temperature.  None if the
    drive has no limit, or if the drive does not reach the reference in time.
    """
    limits = (judge.specification.voltage, judge.specification.current)
    if not np.isfinite(limits).any():
        return None
    gain, poles = judge.motor.plants(judge.temperatures[0])
    # The tiny integral gain makes the reference the final value.
    gains = np.array([_AT_LIMIT * np.max(poles[:, 2] / gain), np.finfo(float).tiny, 0.0, 0.0])
    rises = judge.judged(gains[:, None]).metrics["rise_time"][0]
    slack = slack_at(-np.nan_to_num(rises, nan=np.inf), probability)
    slowest = -float(np.min(slack))
    return slowest if np.isfinite(slowest) else None


def _entry(
    judge: Judge,
    controller: tuple[str, Array],
    probability: float,
    reached: tuple[float | None, float | None],
) -> dict[str, Any]:
    """Entry of one controller: its judgement, what is to blame, limit cycles and responses."""
    text, gains = controller
    samples, found = _long_enough(judge, gains)
    of_draws = found.of_draws[0]
    met = int(np.count_nonzero(of_draws >= 0))
    share = met / of_draws.size
    # Jeffreys' interval of a proportion.
    low, high = beta.ppf([0.05, 0.95], met + 0.5, of_draws.size - met + 0.5)
    slack = float(slack_at(of_draws, probability))
    entry = {
        "controller": text,
        "gains": dict(zip(GAINS, map(float, gains), strict=True)),
        "meets": share >= probability,
        "probability": share,
        "probability_q05": float(low),
        "probability_q95": float(high),
        "slack": slack if np.isfinite(slack) else None,
        "worst": _worst(judge, found, probability),
        "temperatures": _by_temperature(judge, found),
        "limit_active_probability": float(found.limited[0].any(axis=0).mean()),
        "hunting": hunting(judge, gains, samples),
        "blame": [] if share == 1.0 else blamed(judge, gains, samples, probability),
        "responses": _bands(judge, gains, samples),
    }
    return entry | {"statement": statement(entry, probability, judge.step, *reached)}


def _long_enough(judge: Judge, gains: Array) -> tuple[int, Judgement]:
    """Judgement with a simulated time in which the speed settles, if it settles at all."""
    samples = judge.samples()
    found = judge.judged(gains[:, None], samples)
    for _ in range(_LONGER):
        settles = np.isfinite(found.metrics["settling_time"]).mean()
        if settles > 0.99 or 2 * samples > most_samples(judge.specification):
            break
        samples *= 2
        found = judge.judged(gains[:, None], samples)
    return samples, found


def _worst(judge: Judge, found: Judgement, probability: float) -> dict[str, Any]:
    """Requirement and temperature with the smallest distance that the required fraction reaches."""
    reached = {
        (name, k): float(slack_at(slack[0, k], probability))
        for name, slack in found.slack.items()
        for k in range(len(judge.temperatures))
    }
    name, k = min(reached, key=lambda key: reached[key])
    metric = METRICS[name]
    # The value that the required fraction of the draws does not pass, if it exists.
    sign = -1 if metric.is_upper else 1
    values = found.metrics[name][0, k]
    signed = np.where(np.isnan(values), -np.inf, sign * values)
    value = sign * float(slack_at(signed, probability))
    return {
        "metric": name,
        "temperature_degC": judge.temperatures[k],
        "limit": judge.specification.required[name],
        "value": value if np.isfinite(value) else None,
        "quantile": probability if metric.is_upper else 1 - probability,
        "unit": metric.unit,
        "met_probability": float((found.slack[name][0, k] >= 0).mean()),
        "slack": reached[name, k] if np.isfinite(reached[name, k]) else None,
    }


def _by_temperature(judge: Judge, found: Judgement) -> list[dict[str, Any]]:
    entries = []
    for k, temperature in enumerate(judge.temperatures):
        meets = np.min(np.stack([slack[0, k] for slack in found.slack.values()]), axis=0) >= 0
        entry: dict[str, Any] = {
            "temperature_degC": temperature,
            "probability": float(meets.mean()),
        }
        for name, metric in METRICS.items():
            entry[name] = quantity(found.metrics[name][0, k], metric.unit)
            if name in found.slack:
                entry[name]["met_probability"] = float((found.slack[name][0, k] >= 0).mean())
        entry["peak_current"] = quantity(found.peak_current[0, k], "A")
        entry["peak_voltage"] = quantity(found.peak_voltage[0, k], "V")
        entries.append(entry)
    return entries


def _bands(judge: Judge, gains: Array, samples: int) -> list[dict[str, Any]]:
    """Speed, current and voltage after the step: pointwise median and 90 % band."""
    few = judge.of(
        judge.motor.thinned(100), sorted({judge.temperatures[0], judge.temperatures[-1]})
    )
    shown = min(samples, judge.samples())
    entries = []
    for temperature, run in zip(few.temperatures, few.responses(gains, shown), strict=True):
        kept = evenly(run.time.size, _POINTS)
        entry: dict[str, Any] = {"temperature_degC": temperature, "time_s": run.time[kept].tolist()}
        for name in ("speed", "current", "voltage"):
            drawn = np.clip(np.nan_to_num(vars(run)[name][kept]), -1e9, 1e9)
            bands = np.quantile(drawn, (0.05, 0.5, 0.95), axis=1)
            entry[name] = dict(zip(("q05", "median", "q95"), bands.tolist(), strict=True))
        entries.append(entry)
    return entries


def _recommended(entries: Sequence[Mapping[str, Any]], specification: Specification) -> str | None:
    """The controller that meets the specification with the largest distance from its limits.

    Without a required steady error, a controller without integral action is not recommended.
    """
    meeting = [
        entry
        for entry in entries
        if entry["meets"] and (entry["gains"]["ki"] or specification.steady_error is not None)
    ]
    best = max(meeting, key=lambda entry: entry["slack"], default=None)
    return None if best is None else str(best["controller"])
