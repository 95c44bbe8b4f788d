"""Words of ``--map`` that correct a run, in terms of the columns it was read from.

training_3.csv:current_A=I motor * -1 in mA
"""

from __future__ import annotations

from identification.ingest.run import Run, Source
from identification.ingest.units import canonical_unit

__all__ = ["exchange", "factor", "left_out", "other_unit"]


def factor(run: Run, channel: str, number: float) -> str:
    """The channel times a number.

    Args:
        run: The run that is wrong.
        channel: Canonical name.
        number: What the values have to be multiplied with.
    """
    source = _source(run, channel)
    words = f"{source.header} * {_number(source.scale * number)}"
    if source.offset:
        words += f" + {_number(source.offset * number)}"
    if source.unit != canonical_unit(channel).name:
        words += f" in {source.unit}"
    return f"{run.name}:{channel}={words}"


def exchange(run: Run, first: str, second: str) -> tuple[str, str]:
    """Both channels, each from the other's column, as numbers in SI units.

    Args:
        run: The run that is wrong.
        first: Canonical name.
        second: Canonical name.
    """
    return _as_si(run, first, second), _as_si(run, second, first)


def _as_si(run: Run, channel: str, other: str) -> str:
    """A channel read from the column of another one, in its own SI unit."""
    return f"{run.name}:{channel}={_source(run, other).header} in {canonical_unit(channel).name}"


def other_unit(run: Run, channel: str, unit: str) -> str:
    """The channel's column, read in another unit."""
    return f"{run.name}:{channel}={_source(run, channel).header} in {unit}"


def left_out(run: Run, channel: str) -> str:
    """An optional channel left out."""
    return f"{run.name}:{channel}="


def _source(run: Run, channel: str) -> Source:
    return run.sources.get(channel, Source(channel, canonical_unit(channel).name))


def _number(value: float) -> str:
    return f"{value:.12g}"
