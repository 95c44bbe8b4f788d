"""Extension point of the search: what an effect declares beyond its equations.

An effect is a term (`model.term`) that the search can find.  `AbstractEffect` declares what the
search, the report and the documentation need of it; `docs/write-an-effect.md` shows an example.
`candidates` returns prototypes of the effect for the motor at hand.  A prototype is the term at
starting values of finite size.  The score test uses prototypes instead of the derivative at zero,
which vanishes for a filter or lag, and does not have the shape of friction near standstill.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar, Literal, Self, TypeVar

from identification.arrays import Array
from identification.effects.confusion import Confusion
from identification.effects.parameters import one_sign
from identification.model.declared import DECLARED
from identification.model.excitation import Record
from identification.model.term import (
    AbstractDelay,
    AbstractHold,
    AbstractMean,
    AbstractSampleFilter,
    AbstractTerm,
)

__all__ = [
    "REGISTERED",
    "AbstractEffect",
    "AbstractForced",
    "AbstractRunEffect",
    "CampaignScales",
    "Candidate",
    "Scope",
    "effects_of",
    "register",
    "runs_text",
]

Effect = TypeVar("Effect", bound="type[AbstractEffect]")

Scope = Literal["all runs", "some runs", "one span"]
"""Part of a campaign in which an effect acts."""


@dataclass(frozen=True)
class CampaignScales:
    """Scales of one campaign, from its signals and a fit."""

    records: tuple[Record, ...]
    """Training records."""
    current: float
    """Root mean square of the current [A]."""
    speed: float
    """Root mean square of the speed [rad/s]."""
    voltage: float
    """Root mean square of the voltage [V]."""
    torque: float
    """Kt25 times `current` [N m]."""
    interval: float
    """Median sample interval [s]."""
    duration: float
    """Duration of the longest record [s]."""
    values: Array
    """(7,) physical values of the nominal parameters in the fit."""
    angle_logged: bool
    """True if the shaft angle is logged; if not, it is integrated from the speed."""
    orders: tuple[float, ...] = ()
    """Prominent orders of the residual, in periods per revolution [-]."""
    frequencies: tuple[float, ...] = ()
    """Prominent frequencies of the residual; only the search for surrogates has them [Hz]."""
    effects: Mapping[str, float] = field(default_factory=dict)
    """Values of the parameters of effects in the fit, such as ``speed_filter.time_constant``."""

    def nominal(self, name: str) -> float:
        """Value of a nominal parameter in the fit, such as ``Ra25`` [unit of the parameter]."""
        return float(self.values[[parameter.name for parameter in DECLARED].index(name)])

    @property
    def run_duration(self) -> float:
        """Duration of the longest run, of which the records may be segments [s]."""
        ends = (max(record.duration, float(record.time[-1])) for record in self.records)
        return max(ends, default=self.duration)

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the training runs, ascending."""
        return tuple(sorted({record.run for record in self.records}))

    def direction(self, channel: Literal[0, 1]) -> int:
        """Sign of the current (0) or speed (1) of all runs; 0 if there are both signs."""
        return one_sign(record.measured[:, channel] for record in self.records)

    @property
    def temperatures(self) -> tuple[float, float]:
        """Lowest and highest temperature logged in the training runs [degC]."""
        columns = [record.column("temperature") for record in self.records]
        return min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)

    @property
    def heated(self) -> float:
        """Range of the logged temperature over all training runs [K]."""
        coldest, hottest = self.temperatures
        return hottest - coldest


@dataclass(frozen=True)
class AbstractEffect(AbstractTerm):
    """Term that the search can find, or one law of such an effect.

    The class docstring is the entry of the effect in `docs/effects.md`: one sentence, the formula
    with its unit, and remarks.

    Attributes:
        name: Name in result.json; laws of one effect share it.
        equation: Part of the model that the effect enters.
        source: Publication of the law.
        confusions: Effects and parameters that are confounded with this one.
        defining: Shape parameters whose range defines the effect.
        moments: Parameters that are times of events, which may fall on any sample.
        laws: Other classes with the same name, among the candidates of this one.
        amplitude_scale: Field with the standard deviation of the amplitudes that are free in each
            record, of an effect that can have such amplitudes.
        heats: True if the sum of its states is a rise of the winding by its own losses [K].
        is_approximate: True if its formula stands for laws of another form.
    """

    source: ClassVar[str]
    confusions: ClassVar[tuple[Confusion, ...]] = ()
    defining: ClassVar[tuple[str, ...]] = ()
    moments: ClassVar[tuple[str, ...]] = ()
    laws: ClassVar[tuple[type[AbstractEffect], ...]] = ()
    amplitude_scale: ClassVar[str] = ""
    heats: ClassVar[bool] = False
    is_approximate: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """Prototypes for a campaign; empty if its runs cannot reveal the effect."""

    @classmethod
    def is_excluded(cls, scales: CampaignScales) -> bool:  # noqa: ARG003
        """True if the logged signals alone exclude the effect."""
        return False

    @property
    def variant(self) -> str:
        """Label that tells terms of the same name apart: channel, run or signals; often empty."""
        return ""

    @property
    def scope(self) -> Scope:
        """Part of a campaign in which the effect acts."""
        return "all runs"

    @property
    def is_local(self) -> bool:
        """True if the term applies only to the runs or times in which it was found."""
        return self.scope != "all runs"

    @property
    def varies(self) -> bool:
        """True if the size differs from run to run, so that some runs have hardly any of it."""
        return False

    @property
    def reference_run(self) -> int | None:
        """Number of the run in which a size that differs from run to run is zero by definition."""
        return None

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the runs to which the term is restricted; empty for all runs."""
        return ()

    @property
    def plotted(self) -> tuple[str, ...]:
        """Signals against which the report plots the effect: its drivers, by default."""
        return self.drivers

    @property
    def richer(self) -> tuple[AbstractEffect, ...]:
        """Extended variants, tried in turn once this term has been accepted; often none."""
        return ()

    @property
    def rival_laws(self) -> tuple[AbstractEffect, ...]:
        """Other laws with as many parameters, tried before the next effect is kept; often none."""
        return ()

    @property
    def sharper(self) -> Self:
        """The term with its smoothing ten times narrower; the term itself if it has none."""
        return self

    def flaw(self, values: Mapping[str, float]) -> str:
        """Reason why parameters by name contradict the effect, in words; else empty.

        The value `spread` is the size of the amplitudes that are free in each record, if any.
        """
        return ""

    def expecting(self, size: float) -> Self:
        """The term with this standard deviation of its per-record amplitudes [their unit]."""
        return replace(self, **{self.amplitude_scale: size})

    @property
    def settings(self) -> dict[str, object]:
        """Fields of the term by name; they tell it from laws of the same name and equation."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(frozen=True)
class AbstractRunEffect(AbstractEffect):
    """Effect of some runs: simulated in all runs at once, then scored for each run and for sets."""

    run: int | None
    """Number of the run; None for all runs, as the score test requires."""
    others: tuple[int, ...] = field(default=(), kw_only=True)
    """Numbers of further runs with the same effect."""

    @property
    def runs(self) -> tuple[int, ...]:
        return () if self.run is None else (self.run, *self.others)

    @property
    def variant(self) -> str:
        return runs_text(self.runs) if self.runs else ""

    def in_runs(self, run: int, *others: int) -> Self:
        """The effect in one run, or in `run` and `others`."""
        return replace(self, run=run, others=others)


class AbstractForced(AbstractEffect):
    """An effect that only adds a torque or voltage, linear in the amplitudes that are scored."""

    @abstractmethod
    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
        """Torque [N m] or voltage [V] along a trajectory, (n_sample, n_start).

        Current [A] and speed [rad/s] are (n_sample,), parameters `starts` (n_parameter, n_start).
        """


@dataclass(frozen=True)
class Candidate:
    """A term to try, with the values from which its score and its refit start."""

    term: AbstractEffect
    """The term that is scored, its fields set for this motor."""
    starts: Array
    """(n_parameter, n_start) physical values, each of finite size."""
    joint: int = 1
    """Number of consecutive starts that are linear amplitudes and are scored together."""
    fitted: AbstractEffect | None = None
    """The term that is refitted, if it differs from `term`: its parameters are the first ones of
    `term`, and the others become states, free in each record.  Such starts are scored with
    per-record amplitudes."""
    tried: Array | None = None
    """(n_parameter, n_point) more starting points of the refit, which the score cannot rank."""
    traded: tuple[tuple[Array, dict[str, float]], ...] = ()
    """Additional starting points of the refit, each with factors on parameters that are already in
    the model: these parameters give back the effect that they had absorbed."""
    each_run: Candidate | None = None
    """The same starts with an amplitude that is free in each run, of a term that is `by_run`."""

    @property
    def lanes(self) -> int:
        """Number of simulations side by side: the number of starts, at least one."""
        return max(int(self.starts.shape[1]), 1)

    @property
    def prototypes(self) -> int:
        """Number of separately scored prototypes; one scored in several runs counts once."""
        return max(self.lanes // self.joint, 1)

    @property
    def can_rest(self) -> bool:
        """True if the term has neutral values, at which it leaves the model unchanged."""
        sampled = AbstractDelay | AbstractHold | AbstractMean | AbstractSampleFilter
        if self.term.states or isinstance(self.term, sampled):
            return False
        return any(parameter.vanishes for parameter in self.term.parameters)

    @property
    def resting(self) -> Array:
        """(n_parameter,) neutral values, if the term has any."""
        first = self.starts.reshape(-1, self.lanes)[:, 0].copy()
        for row, parameter in enumerate(self.term.parameters):
            if parameter.vanishes:
                first[row] = 0.0
        return first

    @property
    def by_run(self) -> bool:
        """True if the term is simulated in all runs at once and scored for each run."""
        return isinstance(self.term, AbstractRunEffect) and not (self.term.runs or self.by_record)

    def in_runs(self, run: int, *others: int) -> Candidate:
        """The candidate restricted to one run, or to `run` and `others`."""
        assert isinstance(self.term, AbstractRunEffect)
        return replace(self, term=self.term.in_runs(run, *others))

    @property
    def final(self) -> AbstractEffect:
        """The term that a refit uses."""
        return self.fitted or self.term

    @property
    def by_record(self) -> bool:
        """True if the amplitudes are free in each record."""
        return bool(self.final.states) and self.final is not self.term


REGISTERED: dict[str, type[AbstractEffect]] = {}
"""Effects by name, in the order of registration; `catalogue` has all of them."""


def register(effect: Effect) -> Effect:
    """Add an effect to the catalogue, as the decorator of its class.

    Raises:
        ValueError: Another class has the name.
    """
    other = REGISTERED.setdefault(effect.name, effect)
    if other is not effect:
        raise ValueError(
            f"the effect {effect.name!r} of {effect.__module__} has the name of "
            f"{other.__module__}.{other.__name__}; expected another name"
        )
    return effect


def runs_text(runs: Iterable[int]) -> str:
    """Runs in words, counted from 1."""
    numbers = [str(one + 1) for one in sorted(runs)]
    if len(numbers) < 2:
        return f"run {numbers[0]}" if numbers else "a run"
    return f"runs {', '.join(numbers[:-1])} and {numbers[-1]}"


def effects_of(terms: Iterable[AbstractTerm]) -> tuple[AbstractEffect, ...]:
    """The effects among the terms of a model."""
    return tuple(term for term in terms if isinstance(term, AbstractEffect))
