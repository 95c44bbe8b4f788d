"""Finding of a check: a contradiction in the runs, with its statistic and its correction.

Corrections are ``--map`` arguments in terms of the columns that a run was read from:

    training_3.csv:current_A=I motor * -1 in mA

reads the current from the column "I motor" in mA, with the sign reversed.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal

from identification.arrays import Bool
from identification.ingest.mapping import SIGNED
from identification.ingest.run import Run, Source
from identification.ingest.units import canonical_unit, find_unit
from identification.warning import Option, ResultWarning, WarningSeverity

__all__ = [
    "Finding",
    "Measured",
    "Omission",
    "Severity",
    "exchange",
    "factor",
    "left_out",
    "omission",
    "other_unit",
    "refusal",
    "restarted",
    "signed",
    "suspicion",
    "suspicious_unit",
]

Measured = tuple[str, float, float]
"""Deciding statistic of a finding: its name, its value and its limit."""

Severity = Literal["refuse", "suspect"]
"""``refuse``: contradicts physics or the other runs.  ``suspect``: possible but unusual."""


@dataclass(frozen=True)
class Finding:
    """One contradiction or one suspicion."""

    code: str
    """Stable identifier such as ``reversed_channel``."""
    severity: Severity
    """``refuse`` blocks a fit, ``suspect`` does not."""
    file: str
    """Name of the run; empty if it concerns all runs."""
    column: str | None
    """Canonical name of the channel, or None."""
    message: str
    statistic: str
    """Name of the deciding statistic."""
    value: float
    limit: float
    """Limit that it was compared with."""
    corrections: tuple[str, ...] = ()
    """``--map`` arguments that correct the fault; empty if no mapping can."""
    remedy: str = ""
    """Action at the end of the message that removes the cause; empty if it has none."""
    option: Option | None = None
    """Option of the command line that `remedy` names; None if it names none."""

    @property
    def separable(self) -> bool:
        """True if the fault is known to be in one run, whatever the others show."""
        return bool(self.file)

    def __str__(self) -> str:
        """Location, message, statistic with its limit, and the correction to type."""
        return str(self.warning())

    def warning(self, lead: str = "", severity: WarningSeverity = "warning") -> ResultWarning:
        """The finding as a warning of the result; `lead` stands before the location."""
        location = ", column ".join(word for word in (self.file, self.column) if word)
        text = f"{location}: {self.message}" if location else self.message
        text += f" ({self.statistic} {self.value:.3g}, limit {self.limit:.3g})"
        maps = " ".join(f"--map '{word}'" for word in self.corrections)
        fix = f"correct it with {maps}" if maps else self.remedy
        option = "map" if maps else self.option
        return ResultWarning(self.code, severity, lead + text, fix, option)

    def entry(self) -> dict[str, object]:
        """The finding as plain data for result.json and HTTP."""
        entry = dataclasses.asdict(self)
        del entry["remedy"], entry["option"]
        return entry | {"file": self.file or None, "corrections": list(self.corrections)}


def refusal(
    code: str,
    run: Run,
    column: str | None,
    message: str,
    measured: Measured,
    *corrections: str,
    remedy: str = "",
    option: Option | None = None,
) -> Finding:
    """Contradiction in one run, which blocks a fit."""
    return Finding(
        code, "refuse", run.name, column, message, *measured, corrections, remedy, option
    )


def suspicion(
    code: str,
    run: Run | None,
    column: str | None,
    message: str,
    measured: Measured,
    *corrections: str,
    remedy: str = "",
    option: Option | None = None,
) -> Finding:
    """Suspicion about one run, or about all runs."""
    file = "" if run is None else run.name
    return Finding(code, "suspect", file, column, message, *measured, corrections, remedy, option)


def suspicious_unit(
    run: Run, column: str, message: str, measured: Measured, *, word: str
) -> Finding:
    """Suspicion of a wrong unit in all runs, corrected in all of them as `word` corrects one."""
    word = word.removeprefix(f"{run.name}:")
    return suspicion("suspicious_unit", None, column, message, measured, word)


def factor(run: Run, channel: str, number: float) -> str:
    """Mapping of a channel, by its canonical name, multiplied by a number."""
    channel = _logged(run, channel)
    source = _source(run, channel)
    if source.value is not None:
        return f"{run.name}:{channel}={_number(source.value * number)} in {source.unit}"
    words, scale = source.cell, source.scale * number
    is_bare = scale == 1.0 and (bool(source.sign) or source.period is not None)
    if not is_bare:
        words += f" * {_number(scale)}"
    if source.offset:
        words += f" + {_number(source.offset * number)}"
    if is_bare or source.unit != canonical_unit(channel).name:
        words += f" in {source.unit}"
    if source.period is not None:
        words += f" mod {_number(source.period)}"
    return f"{run.name}:{channel}={words}"


def signed(run: Run, channel: str) -> tuple[str, ...]:
    """Mapping of a channel of magnitudes to its column times that of the direction.

    Empty if no unused column has the name of a direction, or the channel cannot be signed.
    """
    channel = _logged(run, channel)
    source = _source(run, channel)
    if run.direction is None or source.sign or source.value is not None or channel not in SIGNED:
        return ()
    sources = {**run.sources, channel: dataclasses.replace(source, sign=run.direction)}
    return (factor(dataclasses.replace(run, sources=sources), channel, 1.0),)


def restarted(run: Run, channel: str, period: float) -> str:
    """Mapping of a channel whose cells start again after a change by a period [SI unit]."""
    source = _source(run, channel)
    unit = find_unit(source.unit)
    cells = period / abs(source.scale * (unit.factor if unit else 1.0))
    sources = {**run.sources, channel: dataclasses.replace(source, period=cells)}
    return factor(dataclasses.replace(run, sources=sources), channel, 1.0)


def exchange(run: Run, first: str, second: str) -> tuple[str, ...]:
    """Mappings of two channels to each other's column, in SI units; none for a derived channel."""
    if any(_logged(run, channel) != channel for channel in (first, second)):
        return ()
    return tuple(
        f"{run.name}:{channel}={_source(run, other).cell} in {canonical_unit(channel).name}"
        for channel, other in ((first, second), (second, first))
    )


def other_unit(run: Run, channel: str, unit: str) -> str:
    """Mapping of a channel to its column in another unit; that of a derived one is a factor."""
    known = find_unit(unit)
    if known is not None and _logged(run, channel) != channel:
        return factor(run, channel, known.factor)
    return f"{run.name}:{channel}={_source(run, channel).cell} in {unit}"


def left_out(run: Run, channel: str) -> str:
    """Mapping that omits an optional channel."""
    return f"{run.name}:{channel}="


@dataclass(frozen=True)
class Omission:
    """Samples that a fit omits, and the suspicion that says why."""

    samples: Bool
    """(n_sample,) True at these samples."""
    finding: Finding


def omission(
    run: Run,
    samples: Bool,
    code: str,
    column: str,
    message: str,
    measured: Measured,
    *,
    remedy: str,
) -> Omission:
    """Omission of samples (n_sample,) of a run."""
    message += f"; the fit omits these samples ({100.0 * float(samples.mean()):.2g} %)"
    return Omission(samples, suspicion(code, run, column, message, measured, remedy=remedy))


def _logged(run: Run, channel: str) -> str:
    """The channel, or the one from which it is derived."""
    return _source(run, channel).origin or channel


def _source(run: Run, channel: str) -> Source:
    return run.sources.get(channel, Source(channel, canonical_unit(channel).name))


def _number(value: float) -> str:
    return f"{value:.12g}"
