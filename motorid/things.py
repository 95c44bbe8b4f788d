"""Runs, fits and batches as the service tells of them.

Each holds what scripts ask for most as an attribute, and all that the service said as `content`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

__all__ = ["ENDED", "Batch", "Fit", "Run"]

ENDED = ("succeeded", "failed", "cancelled", "partial")
"""States of a fit or a batch that are not left."""


@dataclass(frozen=True)
class Run:
    """A run that is stored.

    Args:
        id: Its name at the service.
        sha256: Hash of its bytes.
        rows: Number of samples.
        file: What it was called.
        motor: Which motor it is of, or None.
        content: All that the service says about it.
    """

    id: str
    sha256: str
    rows: int
    file: str
    motor: str | None
    content: Mapping[str, Any] = field(repr=False, default_factory=dict)

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """A run from an answer."""
        return cls(
            id=content["id"],
            sha256=content["sha256"],
            rows=content["rows"],
            file=content["file"],
            motor=content.get("motor"),
            content=content,
        )


@dataclass(frozen=True)
class Fit:
    """A fit as it was when the service was asked.

    Args:
        id: Its name at the service.
        status: queued, running, succeeded, failed or cancelled.
        stage: What is being done.
        fraction: Share of the whole that is done.
        motor: Which motor it is of, or None.
        result: Content of result.json where it succeeded and was asked for by its id, else None.
        error: Why it failed, or None.
        content: All that the service says about it.
    """

    id: str
    status: str
    stage: str
    fraction: float
    motor: str | None
    result: dict[str, Any] | None = field(repr=False)
    error: Mapping[str, Any] | None
    content: Mapping[str, Any] = field(repr=False, default_factory=dict)

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """A fit from an answer."""
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
        """Whether its state will not change any more."""
        return self.status in ENDED


@dataclass(frozen=True)
class Batch:
    """A batch as it was when the service was asked.

    Args:
        id: Its name at the service.
        status: queued, running, succeeded, partial, failed or cancelled.
        fraction: Share of the whole that is done.
        counts: Number of its fits in each state.
        fits: For each motor `fit`, `motor`, `status`, `progress` and `error`; empty in lists.
        name: What lists show, or None.
        content: All that the service says about it.
    """

    id: str
    status: str
    fraction: float
    counts: Mapping[str, int]
    fits: tuple[Mapping[str, Any], ...] = field(repr=False)
    name: str | None
    content: Mapping[str, Any] = field(repr=False, default_factory=dict)

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """A batch from an answer."""
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
        """Whether all its fits have ended."""
        return self.status in ENDED
