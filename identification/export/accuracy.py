"""Accuracy of an export: stiffness of its model, and the error of a fixed number of substeps.

A result contains no signals, so both are evaluated along a synthetic run: the voltage follows a
square wave with rests and then a sine, both of the size that the training runs had.
"""

from __future__ import annotations

from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import INPUTS, MotorModel
from identification.model.scan import scan_of
from identification.model.substeps import divided
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["design_stiffness", "substep_errors"]

_SHARES: Final = (-1.0, -0.3, -1e-3, 0.0, 1e-3, 0.3, 1.0)
_ROWS: Final = 600
_TRIED: Final = (1, 2, 4, 8, 16, 32, 64, 128, 256)
_REFERENCE: Final = 1024
_TEMPERATURE: Final = INPUTS.index("temperature")


def design_stiffness(model: MotorModel, values: Array, span: Array) -> float:
    """Largest spectral radius of df/dx over the signals of the training runs [1/s].

    The values are physical, (n_parameter,); `span` (2,) is the range of current and speed [A,
    rad/s].
    """
    x, u, p = model.symbols()
    jacobian = ca.Function("jacobian", [x, u, p], [ca.jacobian(model.rates(x, u, p), x)])
    inputs = np.zeros(len(INPUTS))
    inputs[_TEMPERATURE] = inputs[INPUTS.index("peak_temperature")] = REFERENCE_TEMPERATURE_DEGC
    largest = 0.0
    for i in _SHARES:
        for w in _SHARES:
            state = np.zeros(x.numel())
            state[:2] = i * span[0], w * span[1]
            found = np.asarray(jacobian(state, inputs, values))
            if np.isfinite(found).all():
                largest = max(largest, float(np.abs(np.linalg.eigvals(found)).max()))
    return largest if largest > 0 else np.nan


def substep_errors(
    step: ca.Function, model: MotorModel, values: Array, interval: float, span: Array
) -> dict[int, float]:
    """Largest error of current and speed over their ranges, by number of substeps [-].

    The reference is the simulation with 1024 substeps.

    Args:
        step: Step function (carry, inputs, parameter) -> (next carry, readings).
        model: The model.
        values: (n_parameter,) physical.
        interval: Sample interval [s].
        span: (2,) range of current and speed [A, rad/s].
    """
    rows = _synthetic(values, interval, span)
    carry = np.zeros((step.size1_in(0), 1))
    temperatures = [k for k, name in enumerate(model.state_names) if name.endswith("temperature")]
    carry[temperatures] = REFERENCE_TEMPERATURE_DEGC
    scan = scan_of(step, effort="once")

    def simulated(count: int) -> Array:
        counts = np.full(rows.shape[0], count, dtype=np.int64)
        parts = scan([divided(rows, counts, model.held)], values[:, None], [carry])
        return np.asarray(parts[1][0][::count, :, 0])

    reference = simulated(_REFERENCE)
    size = np.maximum(np.ptp(reference, axis=0), 1e-300)
    return {count: float(np.max(np.abs(simulated(count) - reference) / size)) for count in _TRIED}


def _synthetic(values: Array, interval: float, span: Array) -> Array:
    """Inputs (n_row, n_input) of the synthetic run."""
    resistance, constant = values[0], values[2]
    size = 0.5 * (abs(resistance) * span[0] + abs(constant) * span[1])
    k = np.arange(_ROWS)
    square = np.array([1.0, 0.0, -0.6, 0.0, 0.3, -1.0])[(k // 50) % 6]
    voltage = size * np.where(k < _ROWS // 2, square, np.sin(2 * np.pi * k / 150))
    voltage = np.where(k < 5, 0.0, voltage)
    columns = dict.fromkeys(INPUTS, np.zeros(_ROWS)) | {
        "interval": np.append(np.full(_ROWS - 1, interval), 0.0),
        "voltage": voltage,
        "voltage_next": np.append(voltage[1:], voltage[-1]),
        "time": k * interval,
        "substeps": np.ones(_ROWS),
    }
    for name in ("temperature", "temperature_next", "peak_temperature"):
        columns[name] = np.full(_ROWS, REFERENCE_TEMPERATURE_DEGC)
    return np.column_stack([columns[name] for name in INPUTS])
