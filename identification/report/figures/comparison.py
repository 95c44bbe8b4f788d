"""Step responses of two fits over each other."""

from __future__ import annotations

from identification.report.svg import Frame, axes, band, line, span, svg
from identification.result.numbers import number_text
from identification.result.report_data import StepResponse

__all__ = ["compared_steps_figure"]


def compared_steps_figure(first: StepResponse, second: StepResponse) -> str:
    """Step responses of two fits with the same controller at the same temperature.

    Args:
        first: Step response of the first fit, in the colour of the nominal model.
        second: Step response of the second fit.

    Returns:
        SVG text.
    """
    end = max(float(first.time[-1]), float(second.time[-1]))
    bands = [limit for step in (first, second) for limit in (step.q05, step.q95)]
    frame = Frame((54.0, 10.0, 396.0, 196.0), (0.0, end), span(*bands, [0.0], margin=0.05))
    body = axes(frame, "time after the step [s]", "speed / reference")
    for step, kind in ((first, "before"), (second, "after")):
        body += band(frame, step.time, step.q05, step.q95, f"band {kind}")
        body += line(frame, step.time, step.median, f"line {kind}")
    described = (
        f"The first fit settles at {number_text(float(first.median[-1]))}, the second at "
        f"{number_text(float(second.median[-1]))}."
    )
    title = f"Step responses with {first.controller} at {first.temperature_degC:g} °C"
    return svg(460, 246, title, described, body)
