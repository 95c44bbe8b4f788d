"""Results of a motor with chosen effects, and a run of it, without a fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.ingest.run import Run
from identification.prediction import simulation_of
from tests.motors import NAMES, drive, motor_named, run_of

__all__ = [
    "CASES",
    "FILTER",
    "FRICTION",
    "INTERVAL",
    "MOTOR",
    "STEP",
    "Inputs",
    "effect",
    "inputs_of",
    "result_with",
    "run_of_the_motor",
]

MOTOR = motor_named("servo 100 W")
INTERVAL = MOTOR.interval

Inputs = dict[str, NDArray[np.float64]]


def effect(name: str, settings: Mapping[str, object], **values: float) -> dict[str, Any]:
    """Entry of an effect in a result."""
    parameters = {key: {"median": value} for key, value in values.items()}
    return {"name": name, "settings": dict(settings), "parameters": parameters}


FRICTION = effect(
    "coulomb_friction", {"torque_size": 0.1, "width": 1.0}, torque=0.02, asymmetry=0.1
)
COGGING = effect(
    "cogging_torque", {"torque_size": 0.1, "angle": "read"},
    order=7.0, sine=0.03, cosine=0.01, sine_2=0.0, cosine_2=0.005,
)  # fmt: skip
HEATING = effect(
    "self_heating", {"power_size": 50.0, "fastest": 0.01, "slowest": 10.0},
    resistance=0.5, time_constant=0.6,
)  # fmt: skip
FILTER = effect(
    "current_filter", {"fastest": 1e-4, "slowest": 0.3, "order": 2}, time_constant=3e-3, second=0.4
)
DELAY = effect(
    "channel_delay", {"channel": "speed", "depth": 8, "interval": INTERVAL}, delay=2.3e-3
)
MEAN = effect("speed_filter", {"law": "mean over the sample interval"})
HOLD = effect("input_hold", {})
STEP = effect(
    "load_step",
    {"run": 1, "torque_size": 0.1, "edge": 2e-3, "duration": 1.0, "others": []},
    torque=0.05, start=0.2, stop=0.6,
)  # fmt: skip

CASES: dict[str, list[dict[str, Any]]] = {
    "nominal": [],
    "friction, heating and a filter": [FRICTION, HEATING, FILTER],
    "cogging and a first-order hold": [COGGING, HOLD],
    "a delay and a mean": [DELAY, MEAN],
}


def result_with(*effects: Mapping[str, Any]) -> dict[str, Any]:
    """Result of the 100 W servo with effects, after three training runs."""
    parameters = {
        name: {"median": value, "sd": 0.01 * abs(value), "unit": "", "identified": True}
        for name, value in zip(NAMES, MOTOR.values, strict=True)
    }
    run = {"role": "training", "sample_rate_hz": 1.0 / INTERVAL, "hottest_degC": 60.0}
    runs = [{"file": f"run{k}.csv", "sha256": str(k) * 64, **run} for k in range(1, 4)]
    channels = {"current": {"rmse": 0.1, "nrmse": 0.02}, "speed": {"rmse": 1.0, "nrmse": 0.01}}
    return {
        "schema_version": 1,
        "runs": runs,
        "declared": {"hold": "zoh", "parameters": parameters},
        "parameters": parameters,
        "effects": [dict(one) for one in effects],
        "errors": {"after": {"training": channels}},
        "noise": {"current_A": 0.05, "speed_rad_s": 0.3},
        "feedback": [],
        "warnings": [],
    }


def run_of_the_motor(rows: int = 600) -> Run:
    """Run of the nominal motor that warms by 3 K/s, beginning in motion."""
    voltage = drive(MOTOR, "steps", rows, np.random.default_rng(4))
    temperature = np.linspace(60.0, 60.0 + 3.0 * INTERVAL * rows, rows)
    return run_of(MOTOR, voltage, temperature, np.array([2.0, 60.0]))


def inputs_of(result: Mapping[str, Any], run: Run) -> tuple[Inputs, NDArray[np.float64]]:
    """What drives a prediction: its inputs by name, and its initial state."""
    simulator, _, (state,) = simulation_of(result, run)
    (record,) = simulator.records
    names = ("voltage", "temperature", "angle")
    columns = {f"{name}{end}": record.column(f"{name}{end}") for name in names
               for end in ("", "_next")}  # fmt: skip
    rate = record.column("temperature_rate")
    return columns | {"temperature_rate": rate, "time": record.time}, state
