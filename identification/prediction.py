"""Simulation of a run with an identified motor: predicted readings of its sensors.

    predict(read_result("out/motor"), "run.csv")["speed_rad_s"]

The simulation uses the voltage, the temperature and, if logged, the angle of the run.  Its first
samples give the initial state.  If the temperature was not logged, or was logged by a lagging
thermometer in coarse steps, it is fitted to the run.  A run without readings, whose current and
speed are constant, starts at these values, and nothing is fitted to it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from identification.arrays import Array
from identification.errors import InputError
from identification.fit.initial import fitted_initial_states
from identification.fit.temperature import with_expected_temperatures, with_own_temperatures
from identification.identified import Identified, read_result
from identification.ingest.given import RunLike, run_of
from identification.ingest.run import Run
from identification.model.composite import Hold, MotorModel
from identification.model.excitation import records_of
from identification.model.parameter import Parameter
from identification.model.simulate import Simulator, initial_states
from identification.result.numbers import finite
from identification.surrogates.entry import term_of

__all__ = ["hottest_of", "model_of", "predict", "simulation_of"]


@np.errstate(all="ignore")
def predict(
    result: Identified | Mapping[str, Any] | str | os.PathLike[str],
    run: RunLike,
    declared: bool = False,
) -> pd.DataFrame:
    """Simulate a run from its inputs alone, as the sensors would log it.

    Args:
        result: What `identify` or `read_result` returns, the content or the path of a result.json.
        run: The run, the path of its file, or a DataFrame; its current and speed only give the
            initial state and an unlogged temperature.
        declared: Whether to use the nominal model instead of the final one.

    Returns:
        Columns ``time_s``, ``current_A`` and ``speed_rad_s``, a row for each sample of the run.

    Raises:
        InputError: The result lacks data that the simulation needs, or the run cannot be read.
    """
    if isinstance(result, str | os.PathLike):
        result = read_result(result)
    content = result.result if isinstance(result, Identified) else result
    measured = run_of(run)
    simulator, values, states = simulation_of(content, measured, declared)
    logged = simulator.logged(values[:, None], states)
    series = np.full((measured.rows, 2), np.nan)
    for record, y in zip(simulator.records, logged, strict=True):
        series[record.start : record.start + record.rows] = y[:, :, 0]
    current, speed = series.T
    return pd.DataFrame({"time_s": measured.time, "current_A": current, "speed_rad_s": speed})


@np.errstate(all="ignore")
def simulation_of(
    result: Mapping[str, Any], run: Run, declared: bool = False
) -> tuple[Simulator, Array, tuple[Array, ...]]:
    """Simulator of a run, physical values (n_parameter,), and (n_state,) of each record.

    Raises:
        InputError: The result lacks data that the simulation needs.
    """
    model, values = model_of(result, declared)
    model = replace(model, terms=tuple(term.predicting for term in model.terms))
    before = _before(result, run)
    records = records_of([run], len(before), hottest_of(before, -np.inf))
    if _object(result, "declared").get("voltage") == "smoothed":
        records = [record.with_smooth_voltage() for record in records]
    noise = _object({"noise": result.get("noise") or {}}, "noise")
    spread = np.maximum(np.std(np.column_stack([run.current, run.speed]), axis=0), 1e-12)
    deviation = np.array(
        [
            abs(_known(noise, name, "the noise of the result") or 1e-3 * size)
            for name, size in zip(("current_A", "speed_rad_s"), spread, strict=True)
        ]
    )
    if run.has_readings:
        known = with_own_temperatures(model, values, records, deviation)
        simulator = Simulator.fitting(model, known, values)
        states = fitted_initial_states(simulator, values, deviation)
    else:
        simulator = Simulator.fitting(model, with_expected_temperatures(records), values)
        states = tuple(initial_states(model, record) for record in simulator.records)
    if model.terms:
        simulator = simulator.converged(values, states)
    return simulator, values, states


def model_of(result: Mapping[str, Any], declared: bool = False) -> tuple[MotorModel, Array]:
    """The final or the nominal model of a result, and its physical values (n_parameter,).

    Raises:
        InputError: A parameter or effect is missing or unknown.
    """
    fitted = _object(result, "declared")
    entries = _object(fitted if declared else result, "parameters")
    effects = [] if declared else _list(result, "effects")
    hold = _hold(fitted)
    model = MotorModel(tuple(term_of(effect) for effect in effects), hold)
    own = {
        f"{effect['name']}.{name}": entry
        for effect in effects
        for name, entry in _object(
            {"parameters": {}, **effect}, "parameters", f"the effect {effect['name']} of the result"
        ).items()
    }
    values = [
        _value(parameter, {**own, **entries}.get(parameter.name)) for parameter in model.parameters
    ]
    return model, np.array(values)


def hottest_of(runs: Iterable[Mapping[str, Any]], otherwise: float) -> float:
    """Highest temperature that runs of a result have logged; `otherwise` if none has any [degC].

    Raises:
        InputError: A temperature is neither a finite number nor null.
    """
    peaks = [_known(run, "hottest_degC", "a run of the result") for run in runs]
    return max((peak for peak in peaks if peak is not None), default=otherwise)


def _value(parameter: Parameter, entry: object) -> float:
    name = parameter.name
    found = entry if isinstance(entry, Mapping) else {}
    for key in ("estimate", "median", "mean"):
        value = found.get(key)
        if isinstance(value, int | float):
            number = finite(value)
            is_positive = parameter.search == "log" or name == "L"
            if number is None or (is_positive and number <= 0):
                raise InputError(
                    f"{name} of the result is {str(value)[:40]}; expected a finite value"
                    f"{' above zero' if is_positive else ''}",
                    column=name,
                )
            return number
    effect, _, own = name.rpartition(".")
    lacking = f"the effect {effect} of the result lacks the parameter {own}" if effect else None
    raise InputError(
        f"{lacking or f'the result has no value of {name}'}; expected a result.json as written by "
        "'motorid fit'",
        column=name,
    )


def _known(content: Mapping[str, Any], name: str, place: str) -> float | None:
    """Finite number of an object of the result, or None if it is null or missing."""
    value = content.get(name)
    if value is None:
        return None
    number = finite(value)
    if number is None:
        raise InputError(
            f"{place} has the {name} {str(value)[:40]!r}; expected a finite number or null; use "
            "the unchanged result.json of 'motorid fit'",
            column=name,
        )
    return number


def _hold(fitted: Mapping[str, Any]) -> Hold:
    hold: Hold | None = fitted.get("hold")
    if hold in (None, "zoh", "foh"):
        return hold or "zoh"
    raise InputError(
        f"the result has the hold {str(hold)[:40]!r}; expected zoh or foh; use the unchanged "
        "result.json of 'motorid fit'",
        column="hold",
    )


def _object(content: Mapping[str, Any], name: str, place: str = "the result") -> Mapping[str, Any]:
    found = content.get(name)
    if not isinstance(found, Mapping):
        raise _lacks(place, f"object {name!r}")
    return found


def _list(content: Mapping[str, Any], name: str) -> list[Any]:
    found = content.get(name) or []
    if not isinstance(found, list):
        raise _lacks("the result", f"list {name!r}")
    return found


def _lacks(place: str, what: str) -> InputError:
    return InputError(
        f"{place} has no {what}; expected a result.json of schema_version 1 as written by "
        "'motorid fit'"
    )


def _before(result: Mapping[str, Any], run: Run) -> list[Mapping[str, Any]]:
    """Runs recorded before this one; all of them if the run is not part of the campaign."""
    runs = [run for run in _list(result, "runs") if isinstance(run, Mapping)]
    for place, known in enumerate(runs):
        if known.get("sha256") == run.sha256:
            return runs[:place]
    return runs
