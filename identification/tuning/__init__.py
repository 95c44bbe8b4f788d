"""Tuning of speed controllers that meet a specification over the uncertainty of the motor.

    specification.py  required metrics, limits and timing of the drive
    motor.py          motor with draws of all parameters, nominal or with effects
    drive.py          simulation of the sampled loop with limits and anti-windup
    judge.py          metrics of each draw at each temperature, distance from the limits
    blame.py          contribution of each parameter's uncertainty
    hunting.py        limit cycles and stick-slip
    search.py         search for gains
    statement.py      judgement in words
    tune.py           `tune`: content of the file of ``motorid tune``

Each module imports only modules above it.
"""

from __future__ import annotations

from identification.speed_loop.controller import KINDS
from identification.tuning.motor import UncertainMotor, motor_of
from identification.tuning.specification import (
    METRICS,
    UNITS,
    Specification,
    parse_specification,
)
from identification.tuning.tune import tune

__all__ = [
    "KINDS",
    "METRICS",
    "UNITS",
    "Specification",
    "UncertainMotor",
    "motor_of",
    "parse_specification",
    "tune",
]
