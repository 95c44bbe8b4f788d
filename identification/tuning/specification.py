"""Specification of a speed loop: required metrics, and limits and timing of the drive.

    parse_specification("rise_time=0.02,overshoot=10,phase_margin=45,voltage=24,sample_time=1e-3")

The requirements bound the metrics of each posterior draw at each temperature.  The other values
describe the drive: the simulation saturates voltage and current, samples the speed every
`sample_time` and applies the voltage `delay` later.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.errors import OptionError
from identification.numerals import decimal_of

__all__ = ["METRICS", "UNITS", "Metric", "Specification", "parse_specification"]

_LEAST_SAMPLE: Final = 1e-7
_GAIN_MARGIN: Final = 6.0
_PHASE_MARGIN: Final = 30.0
_MOST_DELAY: Final = 20.0
"""Largest delay [sample times]."""


@dataclass(frozen=True)
class Metric:
    """Required metric."""

    unit: str
    is_upper: bool
    """True if the requirement is an upper limit."""
    is_margin: bool = False
    """True if it is a margin of the linear loop; others come from the simulation."""

    def slack(self, values: Array, limit: float) -> Array:
        """Distance of values from the limit, relative to it; negative if it is not met [-].

        At most 1.  A value that does not exist (NaN: the speed does not settle) gives -inf.
        """
        ratio = values / limit
        with np.errstate(invalid="ignore"):
            slack = 1.0 - ratio if self.is_upper else ratio - 1.0
        return np.minimum(np.where(np.isnan(slack), -np.inf, slack), 1.0)


METRICS: Final = {
    "rise_time": Metric("s", is_upper=True),
    "settling_time": Metric("s", is_upper=True),
    "overshoot": Metric("%", is_upper=True),
    "steady_error": Metric("%", is_upper=True),
    "gain_margin": Metric("dB", is_upper=False, is_margin=True),
    "phase_margin": Metric("deg", is_upper=False, is_margin=True),
}
"""Metrics that a specification may require, by name."""

UNITS: Final = {
    **{name: metric.unit for name, metric in METRICS.items()},
    **{"voltage": "V", "current": "A", "sample_time": "s", "delay": "s"},
}
"""Units of the values of a specification, by name."""


@dataclass(frozen=True)
class Specification:
    """Requirements and drive of a speed loop; a requirement that is None is not made.

    Raises:
        OptionError: Values are not accepted; the message names all of them.
    """

    rise_time: float | None = None
    """Longest rise time from 10 % to 90 % [s]."""
    settling_time: float | None = None
    """Longest time until the speed stays within 2 % [s]."""
    overshoot: float | None = None
    """Largest overshoot [%]."""
    steady_error: float | None = None
    """Largest deviation of the final speed from the reference [%]."""
    gain_margin: float | None = None
    """Smallest gain margin [dB]."""
    phase_margin: float | None = None
    """Smallest phase margin [deg]."""
    voltage: float = math.inf
    """Largest voltage of the drive [V]."""
    current: float = math.inf
    """Largest current of the drive [A]."""
    sample_time: float = 1e-3
    """Sample time of the controller [s]."""
    delay: float = 0.0
    """Time between sampling the speed and applying the voltage [s]."""

    def __post_init__(self) -> None:
        wrong = [
            f"{field.name} is {value:g} {UNITS[field.name]}; expected a number above 0"
            for field in fields(self)
            if (value := getattr(self, field.name)) is not None
            and field.name != "delay"
            and not value > 0
        ]
        if not 0 <= self.delay <= _MOST_DELAY * max(self.sample_time, 0.0):
            wrong.append(
                f"delay is {self.delay:g} s; expected 0 to {_MOST_DELAY:g} sample times of "
                f"{self.sample_time:g} s"
            )
        if not _LEAST_SAMPLE <= self.sample_time < math.inf:
            wrong.append(f"sample_time is {self.sample_time:g} s; expected at least 1e-7 s")
        times = [time for time in (self.rise_time, self.settling_time) if time and time > 0]
        if times and min(times) < self.sample_time < math.inf:
            wrong.append(
                f"sample_time is {self.sample_time:g} s; expected at most the required "
                f"{min(times):g} s, within which the controller has to act"
            )
        if not self.required:
            wrong.append(f"it requires nothing; expected at least one of {', '.join(METRICS)}")
        if wrong:
            raise OptionError(f"specification: {'; '.join(wrong)}")

    @property
    def required(self) -> dict[str, float]:
        """Limit of each required metric."""
        return {name: limit for name, limit in asdict(self).items() if name in METRICS and limit}

    def with_usual_margins(self) -> Specification:
        """Specification that requires the usual stability margins where it names none.

        Source: Ogata, Modern Control Engineering, 5th ed., section 7-7: a phase margin of 30 to 60
        degrees and a gain margin above 6 dB.
        """
        return replace(
            self,
            gain_margin=_GAIN_MARGIN if self.gain_margin is None else self.gain_margin,
            phase_margin=_PHASE_MARGIN if self.phase_margin is None else self.phase_margin,
        )

    @property
    def lag(self) -> float:
        """Delay of the voltage on average: computation and half a sample time of the hold [s]."""
        return self.delay + 0.5 * self.sample_time


def parse_specification(text: str | Mapping[str, float]) -> Specification:
    """Parse a specification such as ``rise_time=0.02,overshoot=10,voltage=24``.

    Commas, semicolons or blanks separate its parts.

    Raises:
        OptionError: Names or values are not accepted; the message names all of them.
    """
    if not isinstance(text, str):
        return _specification(dict(text), [])
    values: dict[str, float] = {}
    wrong = []
    for word in text.replace(";", ",").replace(" ", ",").split(","):
        name, equals, cell = (part.strip() for part in word.partition("="))
        if not name and not cell:
            continue
        if name in values:
            wrong.append(f"{name} is given twice")
        try:
            values[name] = decimal_of(cell)
        except ValueError:
            wrong.append(f"{word[:60]!r} is not {'a number' if equals else 'NAME=VALUE'}")
    return _specification(values, wrong)


def _specification(values: dict[str, float], wrong: list[str]) -> Specification:
    known = [field.name for field in fields(Specification)]
    unknown = [name for name in values if name not in known]
    if unknown:
        wrong.append(f"{', '.join(unknown)} is not known; expected {', '.join(known)}")
    wrong += [f"{name} is not a number" for name, value in values.items() if math.isnan(value)]
    if wrong:
        raise OptionError(f"specification: {'; '.join(wrong)}")
    return Specification(**values)
