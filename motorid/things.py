"""Runs, fits and batches in responses of the service.

The members that scripts need most are attributes; `content` holds the complete response.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

__all__ = ["ENDED", "Batch", "FitState", "Run"]

ENDED = ("succeeded", "failed", "cancelled", "partial")
"""Final states of a fit or a batch."""


@dataclass(frozen=True)
class Run:
    """Stored run."""

    id: str
    """ID at the service."""
    sha256: str
    """SHA-256 of the uploaded bytes."""
    rows: int
    """Number of samples."""
    file: str
    """File name given at the upload."""
    motor: str | None
    """Name of the motor, or None."""
    content: Mapping[str, Any] = field(repr=False, default_factory=dict)
    """Complete response."""

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """Build a run from a response."""
        return cls(
            id=content["id"],
            sha256=content["sha256"],
            rows=content["rows"],
            file=content["file"],
            motor=content.get("motor"),
            content=content,
        )


@dataclass(frozen=True)
class FitState:
    """Fit at the time of the request."""

    id: str
    """ID at the service."""
    status: str
    """queued, running, succeeded, failed or cancelled."""
    stage: str
    """Current stage."""
    fraction: float
    """Completed fraction."""
    motor: str | None
    """Name of the motor, or None."""
    result: dict[str, Any] | None = field(repr=False)
    """Content of result.json of a succeeded fit requested by its id, else None."""
    error: Mapping[str, Any] | None
    """Reason of a failure, or None."""
    content: Mapping[str, Any] = field(repr=False, default_factory=dict)
    """Complete response."""

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """Build a fit from a response."""
        progress = content["progress"]
        return cls(
            id=content["id"],
            status=content["status"],
            stage=progress["stage"],
            fraction=progress["fraction"],
            motor=content.get("motor"),
            result=content.get("result"),
            error=content.get("error"),
            content=content,
        )

    @property
    def has_ended(self) -> bool:
        """True if the state is final."""
        return self.status in ENDED


@dataclass(frozen=True)
class Batch:
    """Batch at the time of the request."""

    id: str
    """ID at the service."""
    status: str
    """queued, running, succeeded, partial, failed or cancelled."""
    fraction: float
    """Completed fraction."""
    counts: Mapping[str, int]
    """Number of its fits in each state."""
    fits: tuple[Mapping[str, Any], ...] = field(repr=False)
    """For each motor `fit`, `motor`, `status`, `progress` and `error`; empty in lists."""
    name: str | None
    """Name in lists, or None."""
    content: Mapping[str, Any] = field(repr=False, default_factory=dict)
    """Complete response."""

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """Build a batch from a response."""
        return cls(
            id=content["id"],
            status=content["status"],
            fraction=content["progress"]["fraction"],
            counts=content["counts"],
            fits=tuple(content.get("fits", ())),
            name=content.get("name"),
            content=content,
        )

    @property
    def has_ended(self) -> bool:
        """True if all its fits have ended."""
        return self.status in ENDED
