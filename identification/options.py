"""Options of a fit that a user may set, and the budgets of the effort levels.

The budgets count floating-point operations (see `work`), not time, so that a level gives the same
answer on every machine.  One core of 2026 computes about ten giga-operations per second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

from identification.errors import OptionError
from identification.known import Prior, known_values
from identification.nameplate import Nameplate, nameplate_of

__all__ = ["EFFORTS", "Effort", "EffortName", "FitOptions", "PART_ROWS"]


EffortName = Literal["quick", "normal", "thorough"]


@dataclass(frozen=True)
class Effort:
    """Limits of one level."""

    search: float
    """Operations of the search for effects, independent of the length of the runs."""
    search_part: float
    """Additional operations for each of the first `PART_ROWS` samples, the size of the
    representative subset."""
    search_each: float
    """Additional operations for each sample; the model found is fitted to all samples."""
    sampling: float
    """Operations of the sampler."""
    steps: int
    """Largest number of sampler steps."""

    def search_of(self, rows: int) -> float:
        """Operations of the search on `rows` samples."""
        return self.search + self.search_part * min(rows, PART_ROWS) + self.search_each * rows


PART_ROWS: Final = 10_000
"""Samples in the representative subset that the search uses if there are many more."""

EFFORTS: Final[dict[EffortName, Effort]] = {
    "quick": Effort(1.5e10, 1e7, 1.25e6, sampling=2e11, steps=600),
    "normal": Effort(6e10, 4e7, 5e6, sampling=1.2e12, steps=3000),
    "thorough": Effort(6e11, 4e8, 5e7, sampling=1e13, steps=20000),
}
"""A normal search of 24,000 samples may take a minute on one core, one of 370 samples eight
seconds.  Most searches end long before, when no effect is left to find."""


@dataclass(frozen=True)
class FitOptions:
    """Options of `identification.pipeline.identify`."""

    seed: int = 0
    """Seed of the sampler; the same seed gives the same result."""
    posterior: bool = True
    """True to sample the posterior; otherwise intervals come from the covariance of the fit."""
    effects: bool = True
    """True to search for effects; otherwise the nominal model is final."""
    hold: Literal["auto", "zoh", "foh"] = "auto"
    """Voltage between samples: zero-order hold ``zoh``, first-order hold ``foh``, or ``auto``,
    which the data decide."""
    temperatures: tuple[float, ...] = (25.0, 125.0)
    """Temperatures of the feedback metrics [degC]."""
    controllers: tuple[str, ...] = ("P:1",)
    """Controllers of the feedback metrics: ``P:1``, ``PI:kp,ki``, ``PID:kp,ki,kd``."""
    effort: EffortName = "normal"
    """Limit of the computation: ``quick``, ``normal`` or ``thorough``."""
    time_limit: float | None = None
    """Time after which the search and the sampler stop with their current result [s]; None for no
    limit, so that the result does not depend on a clock."""
    set_aside: bool = False
    """True if runs that contradict physics or the other runs are excluded."""
    force: bool = False
    """True to fit contradictory runs; the result is marked."""
    known: tuple[str, ...] = ()
    """Known values, ``NAME=VALUE[+-SPREAD[%]]`` in SI units; see `identification.known`."""
    nameplate: str = ""
    """Nameplate data, ``KEY=VALUE,...``; see `identification.nameplate`."""

    @property
    def plate(self) -> Nameplate:
        """Parameters derived from the nameplate."""
        return nameplate_of(self.nameplate)

    @property
    def priors(self) -> tuple[Prior, ...]:
        """Priors of the user, one per parameter; a known value overrides the nameplate."""
        known = known_values(self.known)
        names = {prior.name for prior in known}
        return (*known, *(prior for prior in self.plate.priors if prior.name not in names))

    def __post_init__(self) -> None:
        if self.hold not in ("auto", "zoh", "foh"):
            raise OptionError(f"hold is {self.hold!r}; expected auto, zoh or foh", value=self.hold)
        if not 0 <= self.seed < 2**32:
            raise OptionError(
                f"seed is {self.seed}; expected a whole number from 0 to 4294967295",
                value=self.seed,
            )
        if self.effort not in get_args(EffortName):
            raise OptionError(
                f"effort is {self.effort!r}; expected quick, normal or thorough", value=self.effort
            )
        if self.time_limit is not None and not 0.0 < self.time_limit < math.inf:
            raise OptionError(
                f"time_limit is {self.time_limit} s; expected a positive number of seconds (omit "
                "the option for no limit)",
                value=self.time_limit,
            )
        for temperature in self.temperatures:
            if not -273.15 < temperature < 400.0:
                raise OptionError(
                    f"temperature is {temperature} degC; expected -273.15 to 400 degC",
                    value=temperature,
                )
        known_values(self.known)
        nameplate_of(self.nameplate)
