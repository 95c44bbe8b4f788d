"""Search of the profile that separates models and narrows parameters best.

    1  score a library of profiles at the first temperature
    2  score the best ones at the other temperatures, at half amplitude and in pairs
    3  exchange levels and lengths of the best one, one segment at a time (coordinate exchange)
    4  repeat this from the best one under a load, if the bench has one
    5  scale the best one until every draw of every model holds the limits

A profile is scaled to the limits before it is scored.  The number of candidates is counted, so the
result does not depend on the speed of the machine.

Source: Meyer and Nachtsheim, Technometrics 37 (1995), 60-69 (coordinate exchange).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.design.criteria import Separation, information_bits, narrowed, separation
from identification.design.models import time_constants
from identification.design.profiles import Profile, library, slew_limited
from identification.design.response import Predictor, Response
from identification.design.task import Task
from identification.errors import ComputationError
from identification.threads import repeatable_algebra

__all__ = ["Candidate", "Designer", "Proposal", "propose"]

_SEARCH_DRAWS: Final = 8
_CHECK_DRAWS: Final = 200
_AT_ONCE: Final = 25
_SEPARATED: Final = 40.0
"""Negative logarithm of the bound of a wrong choice [bit] beyond which models count as separated;
it leaves a margin for the linearisation."""
_WORK: Final = 600_000
"""Samples that the exchange simulates with each model."""
_MOST_EXCHANGES, _FEWEST_EXCHANGES = 240, 40
_MOST_SEGMENTS: Final = 60
_LEVELS: Final = (-1.0, -0.5, -0.15, 0.0, 0.15, 0.5, 1.0)
_LENGTHS: Final = (0.4, 2.5)
_ROUNDS: Final = 10
_MARGIN: Final = 0.98


@dataclass(frozen=True)
class Candidate:
    """A scored run."""

    profile: Profile
    voltage: Array
    """(n_sample,) [V]."""
    temperature: float
    """Temperature [degC]."""
    load: float
    """Load torque between the pauses of the profile [N m]."""
    responses: tuple[Response, ...]
    score: float
    """Separation plus narrowing [bit]."""


@dataclass(frozen=True)
class Proposal:
    """The run that is proposed."""

    task: Task
    best: Candidate
    peaks: dict[str, float]
    """Largest current [A], speed [rad/s] and distance of the shaft [rad] in any draw."""
    separation: Separation | None
    """Expected separation; None if there are no alternatives."""
    bits: tuple[float, ...]
    """Expected information about the parameters of each model [bit]."""
    covariance: Array
    """Covariance of the final model's parameters after the run."""
    by_temperature: dict[float, float]
    """Best score found at each temperature [bit]."""


@dataclass(frozen=True)
class Designer:
    """Scores of candidate runs for one task."""

    task: Task

    @cached_property
    def predictors(self) -> tuple[Predictor, ...]:
        """Simulation with each model."""
        task = self.task
        period = max(2, round(task.rows / 10))
        square = np.where(np.arange(task.rows) // period % 2 == 0, 1.0, -1.0)
        return tuple(
            Predictor.prepared(model, task.limits.voltage * square, task) for model in task.models
        )

    def draws(self, count: int) -> list[Array]:
        """Draws of the parameters of each model, (n_parameter, count)."""
        return [model.draws(count, self.task.seed + k) for k, model in enumerate(self.task.models)]

    @cached_property
    def _few(self) -> list[Array]:
        return self.draws(_SEARCH_DRAWS)

    def candidate(
        self, profile: Profile, temperature: float, load: float = 0.0
    ) -> Candidate | None:
        """The profile within the limits with its score; None if no amplitude holds them."""
        shape = profile.sampled(self.task.rows)
        voltage = self.within(self._few, shape, temperature, load)
        return None if voltage is None else self.scored(profile, voltage, temperature, load)

    def within(
        self,
        draws: Sequence[Array],
        shape: Array,
        temperature: float,
        load: float,
        *,
        is_final: bool = False,
    ) -> Array | None:
        """Voltage (n_sample,) [V] at which all draws of all models hold the limits; None if none.

        The shape (n_sample,) is scaled; the arguments are those of `peaks`, or of `final_peaks`.
        """
        peaks_of = self.final_peaks if is_final else self.peaks
        limits, interval = self.task.limits, self.task.interval
        amplitude, allowed = limits.voltage, asdict(limits)
        for _ in range(_ROUNDS):
            voltage = slew_limited(amplitude * shape, limits.slew * interval)
            found = peaks_of(draws, voltage, temperature, load)
            excess = float(np.max([value / allowed[name] for name, value in found.items()]))
            if excess <= 1.0:
                return voltage
            if not math.isfinite(excess):
                return None
            amplitude *= _MARGIN / excess
        return None

    def peaks(
        self, draws: Sequence[Array], voltage: Array, temperature: float, load: float
    ) -> dict[str, float]:
        """Largest current [A], speed [rad/s] and distance of the shaft [rad] in any draw.

        The draws of each model are physical values (n_parameter, n_draw), the voltage is
        (n_sample,) [V], the temperature in degC, the load a torque [N m].
        """
        return _largest(
            _peaks(predictor.states(voltage, temperature, values, load), self.task.interval)
            for predictor, values in zip(self.predictors, draws, strict=True)
        )

    def final_peaks(
        self, draws: Sequence[Array], voltage: Array, temperature: float, load: float
    ) -> dict[str, float]:
        """Largest values as `peaks` has them, but between the samples too."""
        return _largest(
            _peaks(*predictor.states_between(voltage, temperature, values[:, block], load))
            for predictor, values in zip(self.predictors, draws, strict=True)
            for block in _blocks(values.shape[1])
        )

    def scored(
        self, profile: Profile, voltage: Array, temperature: float, load: float = 0.0
    ) -> Candidate | None:
        """A run, its voltage (n_sample,) [V], with its score; None if a model diverges."""
        responses = tuple(p.response(voltage, temperature, load) for p in self.predictors)
        if not all(
            np.isfinite(one.mean).all() and np.isfinite(one.sensitivity).all() for one in responses
        ):
            return None
        score = self._narrowing(responses)
        if self.task.are_rivals:
            score += min(self.separated(responses).closeness, _SEPARATED)
        return Candidate(profile, voltage, temperature, load, responses, score)

    def separated(self, responses: tuple[Response, ...]) -> Separation:
        """Expected separation of the models by a run."""
        return separation(responses, [model.probability for model in self.task.models])

    def _narrowing(self, responses: tuple[Response, ...]) -> float:
        """Logarithm of the narrowing of the quantity, or of the parameters on average [bit]."""
        models, quantity = self.task.models, self.task.quantity
        pairs = list(zip(models, responses, strict=True))
        if self.task.are_rivals:
            pairs = pairs[:1]
        bits = []
        for model, response in pairs:
            if quantity is None:
                size = len(model.names)
                bits.append(information_bits(model.covariance, response.information) / size)
            else:
                after = narrowed(model.covariance, response.information)
                widths = quantity.width(model.covariance), quantity.width(after)
                bits.append(math.log2(widths[0] / widths[1]) if widths[1] > 0.0 else 0.0)
        return float(np.mean(bits))


def propose(task: Task) -> Proposal:
    """Design the next run.

    Raises:
        ComputationError: No candidate can be simulated within the limits.
    """
    with repeatable_algebra():
        return _proposed(Designer(task))


def _proposed(designer: Designer) -> Proposal:
    task = designer.task
    rng = np.random.default_rng(task.seed)
    fast, slow = time_constants(task.models)
    profiles = library(task.duration, max(fast, 3.0 * task.interval), slow, rng)
    found = _ranked(designer.candidate(one, task.temperatures[0]) for one in profiles)
    found = _ranked([*found, *_varied(designer, found)])
    if not found:
        raise ComputationError(
            "no candidate run can be simulated within the limits; raise a limit of current, speed "
            "or position"
        )
    best = _exchanged(designer, found[0], rng)
    loaded = _ranked(
        designer.candidate(one.profile, one.temperature, load)
        for load in task.loads
        for one in (best, *found[:5])
    )
    if loaded:
        best = max(best, _exchanged(designer, loaded[0], rng), key=lambda one: one.score)
    by_temperature = {
        temperature: max((c.score for c in found if c.temperature == temperature), default=-np.inf)
        for temperature in task.temperatures
    }
    by_temperature[best.temperature] = max(best.score, by_temperature[best.temperature])
    return _proposal(designer, best, by_temperature)


def _proposal(designer: Designer, best: Candidate, by_temperature: dict[float, float]) -> Proposal:
    task = designer.task
    many = designer.draws(_CHECK_DRAWS)
    shape, final = best.voltage / task.limits.voltage, None
    # The voltage cannot undo a load that drives the motor beyond a limit.
    for load in dict.fromkeys(share * best.load for share in (1.0, 0.5, 0.0)):
        voltage = designer.within(many, shape, best.temperature, load, is_final=True)
        if voltage is not None:
            final = designer.scored(best.profile, voltage, best.temperature, load)
            break
    if final is None:
        raise ComputationError(
            "the designed run does not hold the limits in every draw of the parameters; raise a "
            "limit, or identify the motor better first"
        )
    model, information = task.models[0], final.responses[0].information
    return Proposal(
        task=task,
        best=final,
        peaks=designer.final_peaks(many, final.voltage, final.temperature, final.load),
        separation=designer.separated(final.responses) if task.are_rivals else None,
        bits=tuple(
            information_bits(one.covariance, response.information)
            for one, response in zip(task.models, final.responses, strict=True)
        ),
        covariance=narrowed(model.covariance, information),
        by_temperature=by_temperature,
    )


def _peaks(states: Array, interval: float) -> dict[str, float]:
    """Largest current, speed and distance of states (n, 2, n_lane) at an interval [s]."""
    speed = states[:, 1, :]
    signals = {
        "current": states[:, 0, :],
        "speed": speed,
        "position": interval * np.cumsum(speed, axis=0),
    }
    return {name: float(np.max(np.abs(signal))) for name, signal in signals.items()}


def _largest(peaks: Iterable[dict[str, float]]) -> dict[str, float]:
    """Largest of each value; NaN, as of a simulation that diverges, is the largest."""
    found = list(peaks)
    return {name: float(np.max([one[name] for one in found])) for name in found[0]}


def _blocks(count: int) -> list[slice]:
    return [slice(k, k + _AT_ONCE) for k in range(0, count, _AT_ONCE)]


def _ranked(candidates: Iterable[Candidate | None]) -> list[Candidate]:
    found = [one for one in candidates if one is not None and math.isfinite(one.score)]
    return sorted(found, key=lambda one: -one.score)


def _varied(designer: Designer, found: list[Candidate]) -> list[Candidate | None]:
    """The best candidates at other temperatures, at other amplitudes and in pairs."""
    made: list[Candidate | None] = []
    for one in found[:5]:
        for temperature in designer.task.temperatures[1:]:
            made.append(designer.candidate(one.profile, temperature))
    best = _ranked([*found, *made])
    temperature = best[0].temperature if best else designer.task.temperatures[0]
    for one in best[:3]:
        made += [designer.candidate(one.profile.scaled(f), temperature) for f in (0.5, 0.25)]
    profiles = list({one.profile.label: one.profile for one in best}.values())[:5]
    for first, second in combinations(profiles, 2):
        made.append(designer.candidate(first.followed_by(second), temperature))
    return made


def _exchanged(designer: Designer, best: Candidate, rng: np.random.Generator) -> Candidate:
    """Improve a candidate by the exchange of levels and lengths, one segment at a time."""
    if best.profile.lengths.size > _MOST_SEGMENTS:
        return best
    left = int(np.clip(_WORK // designer.task.rows, _FEWEST_EXCHANGES, _MOST_EXCHANGES))
    for k in rng.permutation(best.profile.lengths.size):
        for changed in _neighbours(best.profile, int(k)):
            if left == 0:
                return best
            left -= 1
            one = designer.candidate(changed, best.temperature, best.load)
            if one is not None and one.score > best.score:
                best = one
    return best


def _neighbours(profile: Profile, k: int) -> Iterable[Profile]:
    """Profiles that differ in segment `k`: its level, or its length."""
    label = profile.label if profile.label.endswith("refined") else f"{profile.label}, refined"
    slope = profile.ends[k] - profile.starts[k]
    for level in _LEVELS:
        starts, ends = profile.starts.copy(), profile.ends.copy()
        starts[k], ends[k] = level, np.clip(level + slope, -1.0, 1.0)
        if starts[k] != profile.starts[k]:
            yield replace(profile, label=label, starts=starts, ends=ends)
    for factor in _LENGTHS:
        lengths = profile.lengths.copy()
        lengths[k] *= factor
        yield replace(profile, label=label, lengths=lengths)
