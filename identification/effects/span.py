"""External torque during one span of all runs, of another size in each run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import casadi as ca

from identification.effects.confusion import SINGLE_RUN
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import amplitude, columns
from identification.effects.runs import EACH_RUN
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["LoadSpan", "load_moments", "short_load", "tried_spans", "within"]

_SHORTEST: Final = 5.0
"""Least duration of a load, in widths of an edge; an edge is two samples wide."""


def load_moments(duration: float) -> tuple[Parameter, Parameter]:
    """Times at which a load begins and ends, in runs of at most this duration [s]."""
    start = Parameter(
        "start", "s", "time at which the load begins", scale=duration / 50,
        lower=-duration, upper=2 * duration,
        prior_mean=duration / 2, prior_sd=50.0,
    )  # fmt: skip
    return start, replace(start, name="stop", meaning="time at which the load ends")


def within(signals: Signals, values: Values, edge: float) -> Expression:
    """Factor that is one from `start` to `stop` and zero elsewhere, with edges of a width [s]."""

    def passed(moment: Expression) -> Expression:
        late = (signals.time - moment) / edge
        return 0.5 * (1 + late / ca.sqrt(late * late + 1))

    return passed(values.start) - passed(values.stop)


def short_load(values: Mapping[str, float], edge: float) -> str:
    """Reason to reject a load shorter than ten samples; else empty.

    Lost or wrong samples have the same effect on the log.
    """
    lasts = values["stop"] - values["start"]
    if lasts > _SHORTEST * edge:
        return ""
    return (
        f"implausible: the load lasts {1e3 * lasts:.3g} ms, expected more than ten samples "
        f"({1e3 * _SHORTEST * edge:.3g} ms)"
    )


def tried_spans(scales: CampaignScales) -> list[tuple[float, float]]:
    """Begin and end [s] of half-overlapping spans of 1/2, 1/4 and 1/8 of the runs."""
    lengths = sorted({record.run: float(record.time[-1]) for record in scales.records}.values())
    spans, scanned = [], 0.0
    for last in lengths:
        if last < 1.2 * scanned:
            continue
        scanned = last
        for parts in (2, 4, 8):
            length = last / parts
            spans += [(0.5 * k * length, 0.5 * k * length + length) for k in range(2 * parts - 1)]
    return spans


@dataclass(frozen=True)
class LoadSpan(AbstractEffect, AbstractTorque):
    """External torque during the same span of all runs, of another size in each run.

    tau = -T_r   while start <= t < stop in run r                       [N m]
    """

    torque_size: float
    """Torque scale; in a result, the root mean square of the torques [N m]."""
    edge: float
    """Width of an edge [s]."""
    duration: float
    """Duration of the longest run [s]."""
    own: bool = True
    """True if the torques are per-record states; if not, one parameter, as the score requires."""

    name = "load_step"
    variant = EACH_RUN
    amplitude_scale = "torque_size"
    confusions = (SINGLE_RUN,)
    drivers = ("time",)
    moments = ("start", "stop")
    varies = True
    source = "Krishnan, Electric Motor Drives (2001), section 2.3"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        torque = amplitude("torque", "N m", "load torque", self.torque_size, signed=True)
        moments = load_moments(self.duration)
        return moments if self.own else (*moments, torque)

    @property
    def states(self) -> tuple[State, ...]:
        return (State("torque", "N m", scale=self.torque_size, is_own=True),) if self.own else ()

    def flaw(self, values: Mapping[str, float]) -> str:
        return short_load(values, self.edge)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        size = states.torque if self.own else values.torque
        return -size * within(signals, values, self.edge)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate with a torque free in each record; none for a single run."""
        if len(scales.runs) < 2:
            return []
        sizes = scales.torque, 2 * scales.interval, scales.run_duration
        starts = [(*span, 0.1 * scales.torque) for span in tried_spans(scales)]
        return [Candidate(cls(*sizes, own=False), columns(*starts), fitted=cls(*sizes))]
