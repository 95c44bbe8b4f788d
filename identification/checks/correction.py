"""``--map`` arguments that correct a run, in terms of the columns it was read from.

    training_3.csv:current_A=I motor * -1 in mA

reads the current from the column "I motor" in mA, with the sign reversed.
"""

from __future__ import annotations

from identification.ingest.run import Run, Source
from identification.ingest.units import canonical_unit, find_unit

__all__ = ["exchange", "factor", "left_out", "other_unit"]


def factor(run: Run, channel: str, number: float) -> str:
    """Mapping of a channel, by its canonical name, multiplied by a number."""
    channel = _logged(run, channel)
    source = _source(run, channel)
    words = f"{source.header} * {_number(source.scale * number)}"
    if source.offset:
        words += f" + {_number(source.offset * number)}"
    if source.unit != canonical_unit(channel).name:
        words += f" in {source.unit}"
    if source.period is not None:
        words += f" mod {_number(source.period)}"
    return f"{run.name}:{channel}={words}"


def exchange(run: Run, first: str, second: str) -> tuple[str, ...]:
    """Mappings of two channels to each other's column, in SI units; none for a derived channel."""
    if any(_logged(run, channel) != channel for channel in (first, second)):
        return ()
    return _as_si(run, first, second), _as_si(run, second, first)


def _as_si(run: Run, channel: str, other: str) -> str:
    """Mapping of a channel to the column of another one, in the channel's SI unit."""
    return f"{run.name}:{channel}={_source(run, other).header} in {canonical_unit(channel).name}"


def other_unit(run: Run, channel: str, unit: str) -> str:
    """Mapping of a channel to its column in another unit; that of a derived one is a factor."""
    known = find_unit(unit)
    if known is not None and _logged(run, channel) != channel:
        return factor(run, channel, known.factor)
    return f"{run.name}:{channel}={_source(run, channel).header} in {unit}"


def left_out(run: Run, channel: str) -> str:
    """Mapping that omits an optional channel."""
    return f"{run.name}:{channel}="


def _logged(run: Run, channel: str) -> str:
    """The channel, or the one from which it is derived."""
    return _source(run, channel).origin or channel


def _source(run: Run, channel: str) -> Source:
    return run.sources.get(channel, Source(channel, canonical_unit(channel).name))


def _number(value: float) -> str:
    return f"{value:.12g}"
