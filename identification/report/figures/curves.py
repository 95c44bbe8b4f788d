"""Curves with 90 % bands: coefficients over temperature, closed-loop step responses over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.report.svg import Frame, axes, band, line, span, svg, text
from identification.result.numbers import number_text, unit_text
from identification.result.report_data import CoefficientCurve, StepResponse

__all__ = ["coefficient_figure", "step_figure", "temperature_classes"]

Array = NDArray[np.float64]

_BOX = (66.0, 10.0, 384.0, 196.0)


def coefficient_figure(curve: CoefficientCurve, temperatures: Sequence[Array]) -> str:
    """Coefficient over temperature with its band, and a histogram of the logged temperatures.

    Args:
        curve: Median and band.
        temperatures: Logged temperatures of the runs, (n_sample,) each [degC].

    Returns:
        SVG text.
    """
    drawn = [curve.q05, curve.q95] + ([curve.before] if curve.before is not None else [])
    frame = Frame(_BOX, span(curve.temperature, margin=0.0), span(*drawn, margin=0.12))
    body = axes(frame, "temperature [°C]", f"{curve.name} [{unit_text(curve.unit)}]")
    body += _where_data_lie(frame, temperatures)
    body += band(frame, curve.temperature, curve.q05, curve.q95)
    if curve.before is not None:
        body += line(frame, curve.temperature, curve.before, "line before dashed")
    body += line(frame, curve.temperature, curve.median, "line after")
    ends = (
        f"From {number_text(float(curve.median[0]))} at {curve.temperature[0]:.0f} °C to "
        f"{number_text(float(curve.median[-1]))} {unit_text(curve.unit)} at "
        f"{curve.temperature[-1]:.0f} °C, median with 90 % band."
    )
    return svg(460, 246, f"{curve.name} over temperature", ends, body)


def step_figure(steps: Sequence[StepResponse]) -> str:
    """Step responses of one controller at all temperatures, each with its band and its label."""
    coldest_first = sorted(steps, key=lambda step: step.temperature_degC)
    end = max(float(step.time[-1]) for step in steps)
    bands = [limit for step in steps for limit in (step.q05, step.q95)]
    bands += [step.simulated for step in steps if step.simulated is not None]
    frame = Frame((54.0, 10.0, 372.0, 196.0), (0.0, end), span(*bands, [0.0], margin=0.05))
    body = axes(frame, "time after the step [s]", "speed / reference")
    kinds = temperature_classes([step.temperature_degC for step in coldest_first])
    labels: list[float] = []
    for step, kind in zip(coldest_first, kinds, strict=True):
        body += band(frame, step.time, step.q05, step.q95, f"band {kind}")
        body += line(frame, step.time, step.median, f"line {kind}")
        if step.simulated is not None:
            body += line(frame, step.time, step.simulated, f"line dashed {kind}")
        labels.append(float(frame.y(step.median[-1])))
    for place, step, kind in zip(_spread(labels), coldest_first, kinds, strict=True):
        body += text(430, place + 4, f"{step.temperature_degC:g} °C", f"tick strong {kind}")
    described = "; ".join(
        f"{step.temperature_degC:g} °C settles at {number_text(float(step.median[-1]))}"
        for step in coldest_first
    )
    return svg(484, 246, f"Step responses with {steps[0].controller}", described + ".", body)


def temperature_classes(temperatures: Sequence[float]) -> list[str]:
    """CSS class of each temperature, from ``heat0`` (coldest) to ``heat4`` (hottest)."""
    low, high = min(temperatures), max(temperatures)
    width = (high - low) or 1.0
    return [f"heat{round(4.0 * (value - low) / width)}" for value in temperatures]


def _where_data_lie(frame: Frame, temperatures: Sequence[Array]) -> str:
    """Histogram of all samples over temperature, as bars from the bottom."""
    if not temperatures:
        return ""
    values = np.concatenate([run[np.isfinite(run)] for run in temperatures])
    counts, edges = np.histogram(values, bins=48, range=frame.x_range)
    if counts.max() == 0:
        return ""
    _, top, _, height = frame.box
    bottom = top + height
    across = frame.x(edges)
    heights = 0.14 * height * counts / counts.max()
    marks = "".join(
        f"M{a:.1f} {bottom:.1f}V{bottom - tall:.1f}H{b:.1f}V{bottom:.1f}Z"
        for a, b, tall in zip(across[:-1], across[1:], heights, strict=True)
        if tall > 0.0
    )
    return f'<path class="bars" d="{marks}"/>'


def _spread(places: Sequence[float], apart: float = 13.0) -> list[float]:
    """Label positions, shifted down until none overlap, in their order from the top."""
    order = np.argsort(places)
    moved = np.array(places, dtype=np.float64)
    for upper, lower in zip(order[:-1], order[1:], strict=True):
        moved[lower] = max(moved[lower], moved[upper] + apart)
    return [float(value) for value in moved]
