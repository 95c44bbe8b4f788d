"""Performance of the identified motor in a closed speed loop at chosen temperatures.

    controller.py     controllers: P:1, PI:2,0.5, PID:2,0.5,0.1 and the class of further ones
    metrics.py        step metrics, and their distribution over the posterior draws
    loop.py           motor and controller as transfer functions, and the PI that suits a motor
    roots.py          roots of many polynomials or functions at once
    modes.py          sums of exponential modes, also for coincident poles, and their bounds
    step_response.py  rise, settling, peak and overshoot, exactly
    margins.py        gain margin, phase margin and bandwidth, exactly, also with a delay
    spread.py         metrics and responses over the draws at each temperature
    closed_loop.py    simulation of the loop with the effects of the motor
    sampled.py        rise, settling, peak and overshoot of a simulated response
    nonlinear.py      feedback metrics of the motor with its effects

Each module imports only modules above it.  The entry points are `feedback_metrics`, `step_curves`
and, for the motor with its effects, `nonlinear.simulated_loops`.
"""

from __future__ import annotations

from identification.speed_loop.controller import (
    AbstractController,
    TransferFunction,
    parse_controller,
    parse_controllers,
)
from identification.speed_loop.loop import suited_controller
from identification.speed_loop.metrics import METRIC_UNITS
from identification.speed_loop.spread import StepCurve, feedback_metrics, step_curves

__all__ = [
    "METRIC_UNITS",
    "AbstractController",
    "StepCurve",
    "TransferFunction",
    "feedback_metrics",
    "parse_controller",
    "parse_controllers",
    "step_curves",
    "suited_controller",
]
