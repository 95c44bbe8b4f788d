"""Step responses of two fits over each other."""

from __future__ import annotations

from identification.reporting.figures.chart import Band, Line, chart
from identification.result.numbers import number_text, unit_prefix
from identification.result.report_data import StepResponse

__all__ = ["compared_steps_figure"]


def compared_steps_figure(first: StepResponse, second: StepResponse) -> str:
    """Step responses of two fits with the same controller at the same temperature.

    Args:
        first: Step response of the first fit, in the colour of the nominal model.
        second: Step response of the second fit.
    """
    factor, unit = unit_prefix("s", [float(step.time[-1]) for step in (first, second)])
    lines, bands = [], []
    for label, step, kind in (("first", first, "before"), ("second", second, "after")):
        bands.append(Band(kind, factor * step.time, step.q05, step.q95))
        lines.append(Line(label, kind, factor * step.time, step.median))
    described = (
        f"The first fit settles at {number_text(float(first.median[-1]))}, the second at "
        f"{number_text(float(second.median[-1]))}."
    )
    title = f"Step responses with {first.controller} at {first.temperature_degC:g} °C"
    labels = (f"time after the step [{unit}]", "speed / reference")
    return chart(title, described, labels, lines, bands)
