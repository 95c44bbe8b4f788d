"""How the identified motor behaves in a closed speed loop, hot and cold.

    controller.py     what the user writes: P:1, PI:2,0.5, PID:2,0.5,0.1
    loop.py           motor and controller as transfer functions, one for each draw
    roots.py          roots of many polynomials of degree two and three
    modes.py          sums of modes, safe where poles meet
    envelope.py       when such a sum stays below a level
    step_response.py  rise, settling, peak and overshoot, exactly
    margins.py        gain margin, phase margin and bandwidth, exactly
    spread.py         all of it over the posterior draws: the feedback list of a result
    curves.py         step responses with bands, for plotting

Each file stands on those above it; `feedback_metrics` and `step_curves` are the doors.
"""

from __future__ import annotations

from identification.feedback.controller import Controller, parse_controller, parse_controllers
from identification.feedback.curves import StepCurve, step_curves
from identification.feedback.spread import METRIC_UNITS, feedback_metrics

__all__ = [
    "METRIC_UNITS",
    "Controller",
    "StepCurve",
    "feedback_metrics",
    "parse_controller",
    "parse_controllers",
    "step_curves",
]
