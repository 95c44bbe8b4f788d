"""Measured run of one motor, in SI units, checked.

All later stages take a `Run` and rely on the properties documented here; none of them parses,
converts or repairs data.
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
    """Warning about a run, for the reader of the result.

    `code` is a stable identifier such as ``clipped_channel``; `message` is one sentence with the
    values.
    """

    code: str
    message: str
    file: str
    row: int | None = None
    column: str | None = None

    def __str__(self) -> str:
        """File, column and message on one line, like an error: ``run3.csv, column n: ...``.

        The row is omitted: it marks only the first occurrence, and most warnings concern the whole
        column.
        """
        return f"{self.file}{f', column {self.column}' if self.column else ''}: {self.message}"


@dataclass(frozen=True)
class Source:
    """Source column of a channel; its value in `unit` is ``cell * scale + offset``."""

    header: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Run:
    """One run of one motor.

    Args:
        name: File name as given by the user, without directories.
        sha256: SHA-256 of the file content, in hexadecimal.
        time: (n_sample,) strictly increasing [s].
        voltage: (n_sample,) [V].
        current: (n_sample,) [A].
        speed: (n_sample,) [rad/s].
        temperature: (n_sample,) [degC], or None if not recorded.
        position: (n_sample,) [rad], or None if not recorded.
        segments: Half-open sample ranges between gaps in the record; a run without gaps has one,
            ``((0, n_sample),)``.  The motor state is continuous within a segment only.
        clipped: Channel name to boolean (n_sample,), True where the sensor saturated.
        warnings: Warnings issued while reading.
        sources: Channel name to source column; empty for a synthetic run.
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
        """Sampling frequency, from the median sampling interval [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))
