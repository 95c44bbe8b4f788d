"""C export: one self-contained file with the integration step of `predict`.

The step is the exponential Rosenbrock step of the simulation, printed from the same expression, so
equal substeps give equal numbers.

A result contains no signals, so the error of a number of substeps is evaluated along a synthetic
run: the voltage follows a square wave with reversals and rests and then a sine, both of the size
that the training runs had, while the motor warms.  Amplitudes that each run has of its own take
their usual size.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Final

import casadi as ca
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from identification.arrays import Array
from identification.export.language import C, printed
from identification.export.model import Exported
from identification.model.composite import INPUTS
from identification.model.history import initial_history
from identification.model.scan import scan_of
from identification.model.substeps import Substeps, divided
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["TEMPLATES", "c_code"]

TEMPLATES: Final = Environment(  # noqa: S701  source code, not HTML
    loader=PackageLoader("identification.export"),
    undefined=StrictUndefined,
    trim_blocks=True,
    keep_trailing_newline=True,
)
TEMPLATES.globals["version"] = version("motorid")

_ENOUGH: Final = 1e-7
"""Error over the range of the signal of the default number of substeps, in the synthetic run.

Reversals at other instants and speeds have up to ten times the error."""
_WARMING: Final = 0.3
"""Rise of the temperature in the synthetic run [K/s]."""
_ROWS: Final = 600
_TRIED: Final = (1, 2, 4, 8, 16, 32, 64, 128, 256)
_REFERENCE: Final = 1024


def c_code(motor: Exported, header: list[str]) -> str:
    """Text of the C file."""
    step = motor.step
    x, u, p = (ca.SX.sym(name, step.size1_in(k)) for k, name in enumerate("xup"))
    following, readings = step(x, u, p)
    names = ["x", "u", "p"]
    advance = printed(ca.Function("advance", [x, u, p], [following]), C, names, ["y"])
    sensors = printed(ca.Function("sensors", [x, u, p], [readings]), C, names, ["y"])
    errors = _substep_errors(motor)
    enough = [count for count, error in errors.items() if error <= _ENOUGH]
    # Markers in place of the readings show which channel each history value starts at.
    history = initial_history(motor.model, np.array([1.0, 2.0]))
    marked = {0.0: "zero", 1.0: "current", 2.0: "speed"}
    return TEMPLATES.get_template("motor.c").render(
        header=[line.replace("*/", "* /") for line in header],
        errors=[(n, e) for n, e in errors.items() if n == 1 or n <= 2 * min(enough, default=256)],
        substeps=min(enough, default=max(errors)),
        states=motor.model.state_names,
        carry=step.size1_in(0),
        parameters=motor.parameters,
        interval=repr(motor.interval),
        span=motor.span.tolist(),
        peak=motor.peak,
        held=motor.model.held,
        advance=advance.text,
        sensors=sensors.text,
        starts=[*motor.starts, *(marked[value] for value in history.tolist())],
    )


def _substep_errors(motor: Exported) -> dict[int, float]:
    """Largest error of current and speed over their ranges, by number of substeps [-].

    The reference is the simulation with 1024 substeps.
    """
    rows, model = _synthetic(motor.values, motor.interval, motor.span), motor.model
    carry = np.zeros((motor.step.size1_in(0), 1))
    states = [state for term in model.terms for state in term.states]
    for k, state in enumerate(states, start=2):
        if state.follows == "temperature":
            carry[k] = REFERENCE_TEMPERATURE_DEGC
        elif state.is_own:
            carry[k] = state.scale
    scan = scan_of(motor.step, effort="once")

    def simulated(count: int) -> Array:
        substeps = Substeps.even(np.full(rows.shape[0], count, dtype=np.int64))
        parts = scan([divided(rows, substeps, model.held)], motor.values[:, None], [carry])
        return np.asarray(parts[1][0][::count, :, 0])

    reference = simulated(_REFERENCE)
    size = np.maximum(np.ptp(reference, axis=0), 1e-300)
    return {count: float(np.max(np.abs(simulated(count) - reference) / size)) for count in _TRIED}


def _synthetic(values: Array, interval: float, span: Array) -> Array:
    """Inputs (n_row, n_input) of the synthetic run."""
    # Ra25 and Kt25, over half of the ranges.
    size = 0.5 * (abs(values[0]) * span[0] + abs(values[2]) * span[1])
    k = np.arange(_ROWS)
    square = np.array([1.0, -1.0, 0.0, -0.6, 0.3, 0.8])[(k // 50) % 6]
    voltage = size * np.where(k < _ROWS // 2, square, np.sin(2 * np.pi * k / 150))
    voltage = np.where(k < 5, 0.0, voltage)
    columns = dict.fromkeys(INPUTS, np.zeros(_ROWS)) | {
        "interval": np.append(np.full(_ROWS - 1, interval), 0.0),
        "voltage": voltage,
        "voltage_next": np.append(voltage[1:], voltage[-1]),
        "time": k * interval,
        "substeps": np.ones(_ROWS),
    }
    warm = REFERENCE_TEMPERATURE_DEGC + _WARMING * columns["time"]
    columns |= {
        "temperature": warm,
        "temperature_next": np.append(warm[1:], warm[-1]),
        "temperature_rate": np.full(_ROWS, _WARMING),
        "peak_temperature": warm,
    }
    return np.column_stack([columns[name] for name in INPUTS])
