"""Charts of the report and of the pages of the service."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, evenly
from identification.reporting.columns import extremes
from identification.reporting.figures.chart import Band, Line, chart
from identification.result.numbers import (
    number_text,
    scaled_unit,
    unit_power,
    unit_prefix,
    unit_text,
)
from identification.result.residuals import Correlation

if TYPE_CHECKING:
    from identification.result.report_data import (
        CoefficientCurve,
        MissingTerm,
        MissingTrace,
        PosteriorChain,
        StepCurve,
    )

__all__ = [
    "coefficient_figure",
    "compared_steps_figure",
    "correlation_figure",
    "missing_over_time",
    "missing_term_figure",
    "prediction_figure",
    "profile_figure",
    "step_figure",
    "trace_figure",
]

_CHANNEL_UNITS: Final = {"speed": "rad/s", "current": "A"}
_BUCKETS: Final = 450
"""Buckets of a drawing that spans the page."""
_MOST_DOTS: Final = 1500
_FEW: Final = 120
_POINTS: Final = 240
_WALKERS: Final = 2


def coefficient_figure(curve: CoefficientCurve, temperatures: Sequence[Array]) -> str:
    """Coefficient over temperature with its band, and a histogram of the logged temperatures."""
    lines = [*_histogram(temperatures, (float(curve.temperature[0]), float(curve.temperature[-1])))]
    if curve.before is not None:
        lines.append(Line("nominal model", "before", curve.temperature, curve.before, "dashed"))
    lines.append(Line("final model", "after", curve.temperature, curve.median))
    ends = (
        f"From {number_text(float(curve.median[0]))} at {curve.temperature[0]:.0f} °C to "
        f"{number_text(float(curve.median[-1]))} {unit_text(curve.unit)} at "
        f"{curve.temperature[-1]:.0f} °C, median with 90 % band."
    )
    return chart(
        f"{curve.name} over temperature", ends,
        ("temperature [°C]", f"{curve.name} [{unit_text(curve.unit)}]"),
        lines, [Band("after", curve.temperature, curve.q05, curve.q95)],
    )  # fmt: skip


def step_figure(steps: Sequence[StepCurve]) -> str:
    """Step responses of one controller at all temperatures, each with its band and its label."""
    coldest_first = sorted(steps, key=lambda step: step.temperature_degC)
    named = [(f"{step.temperature_degC:g} °C", step) for step in coldest_first]
    # From heat0, the coldest, to heat4, the hottest.
    low, high = (coldest_first[end].temperature_degC for end in (0, -1))
    heats = [4.0 * (one.temperature_degC - low) / ((high - low) or 1.0) for one in coldest_first]
    kinds = [f"heat{round(heat)}" for heat in heats]
    described = "; ".join(
        f"{label} settles at {number_text(float(step.median[-1]))}" for label, step in named
    )
    title = f"Step responses with {steps[0].controller}"
    return _step_chart(title, described + ".", named, kinds)


def compared_steps_figure(first: StepCurve, second: StepCurve) -> str:
    """Step responses of two fits with the same controller at the same temperature.

    The first one has the colour of the nominal model.
    """
    described = (
        f"The first fit settles at {number_text(float(first.median[-1]))}, the second at "
        f"{number_text(float(second.median[-1]))}."
    )
    title = f"Step responses with {first.controller} at {first.temperature_degC:g} °C"
    return _step_chart(
        title, described, [("first", first), ("second", second)], ("before", "after")
    )


def _step_chart(
    title: str, described: str, named: Sequence[tuple[str, StepCurve]], kinds: Sequence[str]
) -> str:
    factor, unit = unit_prefix("s", [float(step.time[-1]) for _, step in named])
    lines, bands = [], []
    for (label, step), kind in zip(named, kinds, strict=True):
        time = factor * step.time
        bands.append(Band(kind, time, step.q05, step.q95))
        lines.append(Line(label, kind, time, step.median))
        if step.simulated is not None:
            lines.append(Line(f"{label} with effects", kind, time, step.simulated, "dashed"))
    labels = (f"time after the step [{unit}]", "speed / reference")
    return chart(title, described, labels, lines, bands)


def prediction_figure(
    name: str, channel: Literal["speed", "current"], time: Array, signals: tuple[Array, Array]
) -> str:
    """Measured signal in grey, the simulated one over it, of a run.

    Time (n_sample,) [s]; signals (n_sample,) [rad/s or A], NaN where unknown.
    """
    measured, simulated = signals
    described = f"Measured and simulated {channel} over {float(time[-1] - time[0]):.4g} s."
    return chart(
        f"{name}: {channel}",
        described,
        ("time [s]", f"{channel} [{_CHANNEL_UNITS[channel]}]"),
        [
            Line("measured", "measured", time, measured),
            Line("simulated", "after", time, simulated, "thin"),
        ],
    )


def profile_figure(time: Array, voltage: Array) -> str:
    """Designed voltage (n_sample,) [V] over time [s]; of many samples, the extremes."""
    shown = extremes([voltage], _BUCKETS)
    described = f"Voltage of the next run over {float(time[-1] - time[0]):.4g} s."
    line = Line("", "voltage", time[shown], voltage[shown], "thin")
    return chart("Proposed run", described, ("time [s]", "voltage [V]"), [line], height=180)


def missing_term_figure(term: MissingTerm) -> str:
    """Estimates against their driver as dots, with the fitted effect and its band."""
    size = term.driver_values.size
    shown = evenly(size, min(size, _MOST_DOTS))
    shown = shown[np.argsort(term.driver_values[shown], kind="stable")]
    sizes = np.abs(term.median if term.median.size else term.estimate)
    power = unit_power(float(np.quantile(sizes, 0.995)) if sizes.size else 0.0)
    scale = 10.0**-power
    estimate = scale * term.estimate[shown]
    low, middle, high = scale * term.q05, scale * term.median, scale * term.q95
    # A few bin means are drawn over the curve; a cloud of samples must not hide it.
    is_few = size <= _FEW
    dots = Line("estimate", "voltage" if is_few else "measured", term.driver_values[shown],
                estimate, "few" if is_few else "dots")  # fmt: skip
    fitted = [Line("fitted", "after", term.grid, middle)] if term.grid.size else []
    effect = f", with the fitted {term.effect}" if term.effect else ""
    return chart(
        f"{term.quantity} versus {term.driver}",
        f"{term.quantity} of the {term.equation} equation versus {term.driver}{effect}.",
        (f"{term.driver} [{unit_text(term.driver_unit)}]",
         f"{term.quantity} [{scaled_unit(term.unit, power)}]"),
        [*fitted, dots] if is_few else [dots, *fitted],
        [Band("after", term.grid, low, high)] if term.grid.size else [],
        y_range=_usual(estimate, low, high),
    )  # fmt: skip


def missing_over_time(trace: MissingTrace) -> str:
    """Missing term over the time of one run with its band, and the fitted effects."""
    power = unit_power(float(np.quantile(np.abs(trace.median), 0.995)))
    lines = (trace.median, trace.q05, trace.q95, trace.fitted)
    median, low, high, fitted = (10.0**-power * values for values in lines)
    has_fit = fitted.size > 0
    shown = extremes([median, low, high, *([fitted] if has_fit else [])], 250)
    time = trace.time[shown]
    drawn = [Line("estimate", "voltage" if has_fit else "after", time, median[shown], "thin")]
    if has_fit:
        drawn.append(Line("fitted", "after", time, fitted[shown]))
    band = Band("measured" if has_fit else "after", time, low[shown], high[shown])
    return chart(
        f"{trace.quantity} over time, {trace.run}",
        f"{trace.quantity} estimated over the run {trace.run}, with its 90 % band.",
        ("time [s]", f"{trace.quantity} [{scaled_unit(trace.unit, power)}]"),
        drawn, [band], height=210,
    )  # fmt: skip


def correlation_figure(title: str, after: Correlation, before: Correlation | None = None) -> str:
    """Correlation over the lag with its 99 % band; both models share one scale."""
    outside = np.abs(after.values) > after.half_width
    shown = [("outside the band", "loud", outside), ("final model", "after", ~outside)]
    lines = [
        Line(label, kind, after.lags, np.where(chosen, after.values, np.nan), "stems")
        for label, kind, chosen in shown
        if chosen.any()
    ]
    if before is not None:
        lines.insert(0, Line("nominal model", "before", before.lags, before.values, "stems"))
    band = Band("measured", after.lags, -after.half_width, after.half_width)
    sizes = [after.values, 2.5 * after.half_width, *([] if before is None else [before.values])]
    top = min(1.15 * max(float(np.max(np.abs(size))) for size in sizes), 1.08)
    described = (
        f"{100.0 * after.outside:.1f} % of {after.lags.size} lags lie outside the band; "
        f"{100.0 * (1.0 - after.level):.0f} % expected for white noise."
    )
    labels = ("lag [samples]", "correlation")
    return chart(title, described, labels, lines, [band], y_range=(-top, top), height=200)


def trace_figure(posterior: PosteriorChain, index: int) -> str:
    """One parameter over the steps: the central 90 % and 50 % of the walkers, and two of them.

    Sixty overlaid walkers form a grey block that hides a slow drift; their quantiles show it.
    """
    name, unit = posterior.names[index], posterior.units[index]
    walks = posterior.chain[:, :, index]
    power = unit_power(float(np.max(np.abs(np.quantile(walks, (0.05, 0.95))))))
    walks = walks * 10.0**-power
    steps, (low, lower, middle, upper, high) = _moving_quantiles(walks)
    lines = [
        Line("", "measured", steps, walks[steps, walker], "thin")
        for walker in range(min(_WALKERS, walks.shape[1]))
    ]
    shown = scaled_unit(unit, power)
    return chart(
        f"Trace of {name}",
        f"Quantiles of {walks.shape[1]} walkers over {walks.shape[0]} steps.",
        ("step", ""),
        [*lines, Line(f"{name} [{shown}]" if shown else name, "after", steps, middle, "thin")],
        [Band("after", steps, low, high), Band("after", steps, lower, upper)],
        height=140,
    )


def _histogram(temperatures: Sequence[Array], limits: tuple[float, float]) -> list[Line]:
    """Histogram of all samples over temperature; empty without samples."""
    values = np.concatenate([[], *temperatures])
    values = values[np.isfinite(values)]
    if not values.size:
        return []
    counts, edges = np.histogram(values, bins=48, range=limits)
    middles = 0.5 * (edges[1:] + edges[:-1])
    return [Line("logged temperatures", "measured", middles, counts / max(counts.max(), 1), "bars")]


def _usual(values: Array, low: Array, high: Array) -> tuple[float, float]:
    """Range of zero, nearly all estimates and the whole curve; outliers do not shrink the plot."""
    ends = np.quantile(values, (0.005, 0.995)) if values.size else np.zeros(0)
    seen = np.concatenate([ends, low, high, [0.0]])
    seen = seen[np.isfinite(seen)]
    room = 0.08 * float(np.ptp(seen)) or 0.5
    return float(seen.min()) - room, float(seen.max()) + room


def _moving_quantiles(walks: Array) -> tuple[NDArray[np.int_], Array]:
    """Centres (n_point,) of blocks of steps, and walker quantiles (5, n_point) in each block."""
    width = max(1, walks.shape[0] // _POINTS)
    points = walks.shape[0] // width
    stretches = walks[: points * width].reshape(points, -1)
    steps = np.arange(points) * width + width // 2
    return steps, np.quantile(stretches, (0.05, 0.25, 0.5, 0.75, 0.95), axis=1)
