"""A run: what one bench recorded of one motor, in SI units, checked.

Everything downstream takes a `Run` and may rely on what is said here; nothing downstream parses,
converts or repairs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["Run", "RunWarning", "Source"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RunWarning:
    """Something about a run that a reader of the result should know.

    `code` is a stable word such as ``clipped_channel``; `message` is one sentence with the values.
    """

    code: str
    message: str
    file: str
    row: int | None = None
    column: str | None = None

    def __str__(self) -> str:
        """The place and the message on one line, as errors have it: ``run3.csv, column n: ...``.

        The row is left out: it is where the matter begins, and most are about the whole column.
        """
        return f"{self.file}{f', column {self.column}' if self.column else ''}: {self.message}"


@dataclass(frozen=True)
class Source:
    """Column of a file that a channel was read from: ``(cell * scale + offset)`` in `unit`."""

    header: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Run:
    """One run of one motor.

    Args:
        name: File name as the user gave it (no directories).
        sha256: Hash of the bytes that were read, in hexadecimal.
        time: (n_sample,) strictly increasing [s].
        voltage: (n_sample,) [V].
        current: (n_sample,) [A].
        speed: (n_sample,) [rad/s].
        temperature: (n_sample,) [degC], or None where the file has none.
        position: (n_sample,) [rad], or None.
        segments: Half-open sample ranges between gaps in the record; a run without gaps has one,
            ``((0, n_sample),)``.  The state of the motor is continuous within a segment only.
        clipped: Channel name to boolean (n_sample,), True where the sensor was at its limit.
        warnings: What was noticed while reading.
        sources: Channel name to the column that it was read from; empty for a run that was made.
    """

    name: str
    sha256: str
    time: Array
    voltage: Array
    current: Array
    speed: Array
    temperature: Array | None = None
    position: Array | None = None
    segments: tuple[tuple[int, int], ...] = ()
    clipped: dict[str, NDArray[np.bool_]] = field(default_factory=dict)
    warnings: tuple[RunWarning, ...] = ()
    sources: Mapping[str, Source] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.segments:
            object.__setattr__(self, "segments", ((0, self.time.size),))

    @property
    def rows(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def sample_rate_hz(self) -> float:
        """Sampling frequency from the median interval [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))
