"""Simulation of a run by a result: what its sensors would have logged.

    prediction = predict(json.loads(text), read_run("run.csv"))

Only voltage, temperature and, where logged, angle of the run are used, and its first samples for
the state in which it begins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.effects.catalogue import CATALOGUE
from identification.effects.unlisted import unlisted_term
from identification.errors import InputError
from identification.fit.accuracy import accurate
from identification.fit.initial import fitted_initial_states
from identification.ingest.run import Run
from identification.model.composite import Hold, MotorModel
from identification.model.excitation import records_of
from identification.model.parameter import Parameter
from identification.model.simulate import Simulator
from identification.model.term import AbstractTerm

__all__ = ["Prediction", "model_of", "predict"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """Simulated channels of one run.

    Args:
        time: (n_sample,) [s].
        current: (n_sample,) [A].
        speed: (n_sample,) [rad/s].
    """

    time: Array
    current: Array
    speed: Array


def predict(result: Mapping[str, Any], run: Run, declared: bool = False) -> Prediction:
    """Simulate a run from its inputs alone.

    Args:
        result: Content of a result.json.
        run: The run; its current and speed serve for the initial state only.
        declared: Whether to use the declared model and not the final one.

    Raises:
        InputError: The result lacks what a simulation needs.
    """
    model, values = model_of(result, declared)
    before = _before(result, run)
    peaks = [r["hottest_degC"] for r in before if r.get("hottest_degC") is not None]
    hottest = max(peaks, default=-np.inf)
    records = records_of([run], len(before), hottest)
    simulator = Simulator.fitting(model, records, values)
    noise = result.get("noise") or {}
    spread = np.maximum(np.std(np.column_stack([run.current, run.speed]), axis=0), 1e-12)
    deviation = np.array(
        [
            noise.get(name) or 1e-3 * size
            for name, size in zip(("current_A", "speed_rad_s"), spread, strict=True)
        ]
    )
    states = fitted_initial_states(simulator, values, deviation)
    if model.terms:
        simulator = accurate(simulator, values, states, deviation)
    logged = simulator.logged(values[:, None], states)
    series = np.full((run.rows, 2), np.nan)
    for record, y in zip(records, logged, strict=True):
        series[record.start : record.start + record.rows] = y[:, :, 0]
    return Prediction(run.time, series[:, 0], series[:, 1])


def model_of(result: Mapping[str, Any], declared: bool = False) -> tuple[MotorModel, Array]:
    """The model of a result and its parameters.

    Args:
        result: Content of a result.json.
        declared: Whether to take the declared model and not the final one.

    Returns:
        The model and (n_parameter,) physical values.

    Raises:
        InputError: A parameter or effect is missing or unknown.
    """
    try:
        entries = result["declared"]["parameters"] if declared else result["parameters"]
        terms = () if declared else tuple(_term(effect) for effect in result.get("effects", ()))
        hold: Hold = result["declared"].get("hold") or "zoh"
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"the result has no {error}; expected a result.json of schema_version 1 as written by "
            "'motorid fit'"
        ) from error
    model = MotorModel(terms, hold)
    own = {
        f"{effect['name']}.{name}": entry
        for effect in ([] if declared else result.get("effects", ()))
        for name, entry in effect.get("parameters", {}).items()
    }
    values = [
        _value(parameter, {**own, **entries}.get(parameter.name)) for parameter in model.parameters
    ]
    return model, np.array(values)


def _value(parameter: Parameter, entry: Mapping[str, Any] | None) -> float:
    name = parameter.name
    for key in ("estimate", "median", "mean"):
        value = (entry or {}).get(key)
        if isinstance(value, int | float):
            number = _number(value)
            is_positive = parameter.search == "log" or name == "L"
            if not math.isfinite(number) or (is_positive and number <= 0):
                raise InputError(
                    f"{name} of the result is {number:.6g}; expected a finite value"
                    f"{' above zero' if is_positive else ''}",
                    column=name,
                )
            return number
    raise InputError(
        f"the result has no value of {name}; expected a result.json as written by 'motorid fit'",
        column=name,
    )


def _number(value: float) -> float:
    """As a floating-point number; infinite where a whole number is beyond all of them."""
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _term(effect: Mapping[str, Any]) -> AbstractTerm:
    if effect["name"] == "unlisted":
        return unlisted_term(effect["equation"], effect["settings"])
    kind = CATALOGUE.get(effect["name"])
    if kind is None:
        raise InputError(
            f"effect {effect['name']!r} is not known; expected one of {', '.join(CATALOGUE)}",
            value=effect["name"],
        )
    term: AbstractTerm = kind(**effect.get("settings", {}))
    return term


def _before(result: Mapping[str, Any], run: Run) -> list[Mapping[str, Any]]:
    """The runs that were recorded before: all, where the run was no part of the campaign."""
    runs = list(result.get("runs") or [])
    for place, known in enumerate(runs):
        if known.get("sha256") == run.sha256:
            return runs[:place]
    return runs
