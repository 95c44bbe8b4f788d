"""Plot of one parameter of one motor over its fits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.fleet.drift import Drift
from identification.fleet.figure import framed
from identification.fleet.refit import Refit
from identification.quantities import DECLARED_PARAMETERS
from identification.reporting.svg import Frame, path, span, svg, text, tick_words
from identification.result.numbers import number_text, scaled_unit, unit_power, unit_prefix

__all__ = ["history_figure"]

_BOX = (92.0, 10.0, 358.0, 150.0)
_MOST_LABELS = 4


def history_figure(
    name: str, refits: Sequence[Refit], changes: Sequence[dict[str, Drift]], times: Sequence[str]
) -> str:
    """SVG of medians with 90 % intervals over fits, oldest first; empty if none identifies it.

    Significant changes against the fit before are highlighted.  The times of the fits are UTC, ISO
    8601; the drawing shows their dates, and keeps the times for the script of a page.
    """
    unit = DECLARED_PARAMETERS[name].unit
    shown = [
        (index, estimate.q05, estimate.median, estimate.q95)
        for index, refit in enumerate(refits)
        if (estimate := refit.estimates.get(name)) is not None
        and estimate.usable is not None
        and estimate.q05 is not None
        and estimate.median is not None
        and estimate.q95 is not None
    ]
    if not shown:
        return ""
    places, low, middle, high = np.array(shown, dtype=np.float64).T
    largest = float(np.abs([low, high]).max())
    factor, unit = unit_prefix(unit, [largest])
    power = unit_power(factor * largest)
    scale = factor * 10.0**-power
    frame = Frame(_BOX, (-0.5, len(refits) - 0.5), span(scale * low, scale * high, margin=0.12))
    # A date at each fit, or at some of many.
    below = "".join(
        text(float(frame.x(k)), _BOX[1] + _BOX[3] + 14, times[k][:10], "tick mid", time=times[k])
        for k in range(0, len(times), -(-len(times) // _MOST_LABELS))
    )
    words = tick_words(*frame.y_range, 4)
    body = framed(frame, words, f"{name} [{scaled_unit(unit, power)}]", below, at=15)
    across = frame.x(places)
    body += path(across, frame.y(scale * middle), "zero")
    for at, x, bottom, centre, top in zip(
        places, across, frame.y(scale * low), frame.y(scale * middle), frame.y(scale * high),
        strict=True,
    ):  # fmt: skip
        drift = changes[int(at)].get(name)
        kind = " loud" if drift is not None and drift.is_significant else ""
        body += f'<path class="stem{kind}" d="M{x:.1f} {bottom:.1f}V{top:.1f}"/>'
        body += f'<path class="dots few{kind}" d="M{x:.1f} {centre:.1f}h0"/>'
    described = (
        f"{len(shown)} fits, from {number_text(float(middle[0]))} to "
        f"{number_text(float(middle[-1]))} {unit}, medians with 90 % intervals."
    )
    return svg(460, 190, f"{name} over the fits", described, body)
