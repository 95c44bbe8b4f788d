"""Plots of the effects for docs/effects.md: what each law adds to the motor, from the law itself.

    python -m benchmarks.effects_plots

writes docs/pictures/effects/NAME.svg.  The example motor is simulated with and without each effect
at a typical size.  If the missing torque or voltage follows the driver of the effect, it is plotted
over the driver; otherwise the change of current and speed over time is.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.effects_page import EXAMPLE_MOTOR, example_scales
from identification.arrays import Array
from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import AbstractEffect, CampaignScales
from identification.ingest.run import Run
from identification.model.composite import MotorModel
from identification.model.excitation import Record, records_of
from identification.model.simulate import Simulator, initial_states
from identification.reporting.svg import Frame, axes, line, svg, svg_file
from identification.result.atomic import write_text

__all__ = ["Signature", "effect_plot", "main", "signature"]

FOLDER: Final = Path("docs/pictures/effects")

_INTERVAL: Final = 1e-3
_SWEEP_S: Final = 2.0
_SWEEP_HZ: Final = 5.0
_ROWS: Final = 4000
_BINS: Final = 101
_EVERY: Final = 10
"""Samples of a plot over time: one in this number."""
_FOLLOWS: Final = 0.9
"""Fraction of the variance that a function of the driver explains if the term follows it [-]."""

_WIDTH: Final = 330
_HEIGHT: Final = 200
_ROUNDING: Final = 1e-6
"""Smallest change that is plotted [A] or [rad/s]."""
_LEAST: Final = 3e-3
"""Smallest missing term relative to its balance that is plotted over a driver [-]."""

_STYLE: Final = (
    "text{font:12px sans-serif;fill:#777}.mid{text-anchor:middle}.end{text-anchor:end}"
    ".frame{fill:none;stroke:#999}.grid{stroke:#9994}.line{fill:none;stroke:#1e88e5;"
    "stroke-width:1.8}"
)


@dataclass(frozen=True)
class Signature:
    """Difference between the example motor with and without an effect."""

    x: Array
    """(n_sample,) abscissa."""
    x_label: str
    """Its name and unit."""
    curves: dict[str, Array]
    """Name and unit of each ordinate, with (n_sample,) values."""


def signature(kind: type[AbstractEffect], scales: CampaignScales) -> Signature:
    """Simulate an effect at the size of its first candidate."""
    candidate = kind.candidates(scales)[0]
    if candidate.by_run:
        candidate = candidate.in_runs(0)
    record = records_of([_inputs()])[0]
    nominal = _logged(MotorModel(), record, np.array(EXAMPLE_MOTOR))
    start = candidate.starts.reshape(-1, candidate.lanes)[:, candidate.lanes // 2]
    model = MotorModel((candidate.term,))
    found = _logged(model, record, np.concatenate([EXAMPLE_MOTOR, start]))
    time = _INTERVAL * np.arange(_ROWS, dtype=np.float64)
    if kind.equation in ("electrical", "mechanical"):
        sweep = slice(2, int(_SWEEP_S / _INTERVAL) - 2)
        for driver in candidate.term.drivers[:1]:
            over = _over_driver(kind.equation, driver, record, found, nominal, sweep)
            if over is not None:
                return over
    change = (found - nominal)[::_EVERY]
    return Signature(
        time[::_EVERY],
        "time [s]",
        {"change of the current [A]": change[:, 0], "change of the speed [rad/s]": change[:, 1]},
    )


def effect_plot(name: str, shown: Signature) -> str:
    """SVG text of a plot."""
    marks = ""
    width = _WIDTH * len(shown.curves)
    for number, (label, values) in enumerate(shown.curves.items()):
        low, high = float(min(values.min(), 0.0)), float(max(values.max(), 0.0))
        # An unchanged channel is drawn as a line at zero, not as its rounding errors.
        margin = 0.08 * (high - low) if high - low > _ROUNDING else 1.0
        frame = Frame(
            (72.0, 10.0, 240.0, 150.0),
            (float(shown.x.min()), float(shown.x.max())),
            (low - margin, high + margin),
        )
        curve = axes(frame, shown.x_label, label) + line(frame, shown.x, values)
        marks += f'<g transform="translate({_WIDTH * number} 0)">{curve}</g>'
    drawing = svg(width, _HEIGHT, f"Signature of {name}", ", ".join(shown.curves), marks)
    return svg_file(drawing, _STYLE)


def main() -> None:
    """Write the plots of all effects, from the root of the project."""
    scales = example_scales()
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, kind in CATALOGUE.items():
        write_text(FOLDER / f"{name}.svg", effect_plot(name, signature(kind, scales)))


def _inputs() -> Run:
    """Run without effects' traces: a slow sweep of the voltage, then steps, while it warms."""
    time = _INTERVAL * np.arange(_ROWS, dtype=np.float64)
    sweep = 24.0 * np.sin(2.0 * np.pi * _SWEEP_HZ * time)
    steps = np.repeat([12.0, -12.0, 18.0, -6.0, 0.0, 24.0, -18.0, 6.0], _ROWS // 8)
    voltage = np.where(time < _SWEEP_S, sweep, np.roll(steps, _ROWS // 2))
    still = np.zeros(_ROWS)
    temperature = 25.0 + 40.0 * time / time[-1]
    silent = Run("run", "0" * 64, time, voltage, still, still, temperature, still)
    speed = _logged(MotorModel(), records_of([silent])[0], np.array(EXAMPLE_MOTOR))[:, 1]
    position = np.cumsum(speed) * _INTERVAL
    return Run("run", "0" * 64, time, voltage, still, still, temperature, position)


def _logged(model: MotorModel, record: Record, values: Array) -> Array:
    """(n_sample, 2) simulated current and speed from standstill [A, rad/s]."""
    simulator = Simulator.fitting(model, [record], values)
    return simulator.logged(values[:, None], [initial_states(model, record)])[0][:, :, 0]


def _over_driver(
    equation: str, driver: str, record: Record, found: Array, nominal: Array, rows: slice
) -> Signature | None:
    """Missing term over the driver; None if it is no function of it."""
    axis = {
        "speed": (found[:, 1], "speed [rad/s]"),
        "current": (found[:, 0], "current [A]"),
        "position": (np.mod(record.column("angle"), 2.0 * np.pi), "shaft angle [rad]"),
    }.get(driver)
    if axis is None:
        return None
    x = axis[0][rows]
    own, reference = _missing(record, found), _missing(record, nominal)
    scale = {"electrical": record.column("voltage"), "mechanical": EXAMPLE_MOTOR[2] * found[:, 0]}
    labels = {"electrical": "missing voltage [V]", "mechanical": "missing torque [N m]"}
    for name in (equation, *(other for other in labels if other != equation)):
        # The error of the numerical derivatives is nearly the same without the effect.
        values = (own[name] - reference[name])[rows]
        edges = np.linspace(x.min(), x.max(), _BINS + 1)
        bins = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
        counts = np.maximum(np.bincount(bins, minlength=_BINS), 1)
        means = np.bincount(bins, values, minlength=_BINS) / counts
        is_large = np.std(values) > _LEAST * np.std(scale[name])
        if is_large and np.var(values - means[bins]) < (1.0 - _FOLLOWS) * np.var(values):
            filled = np.bincount(bins, minlength=_BINS) > 0
            centres = 0.5 * (edges[1:] + edges[:-1])
            return Signature(centres[filled], axis[1], {labels[name]: means[filled]})
    return None


def _missing(record: Record, logged: Array) -> dict[str, Array]:
    """Residuals of the two balances of the nominal model [V] and [N m]."""
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = EXAMPLE_MOTOR
    heat = record.column("temperature") - 25.0
    current, speed = logged.T
    rates = np.gradient(logged, _INTERVAL, axis=0).T
    resistance, constant = ra * (1.0 + alpha_ra * heat), kt * (1.0 + alpha_kt * heat)
    voltage = inductance * rates[0] + resistance * current + constant * speed
    return {
        "electrical": voltage - record.column("voltage"),
        "mechanical": inertia * rates[1] + friction * speed - constant * current,
    }


if __name__ == "__main__":
    main()
