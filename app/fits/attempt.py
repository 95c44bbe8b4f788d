"""Attempt at a fit that runs under this server, with its messages so far."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from app.fits.engine import AbstractRunning
from app.fits.job import FitJob

__all__ = ["Attempt"]

_LONGEST_STAGE = 100


@dataclass
class Attempt:
    """An attempt that runs under this server.

    Args:
        running: The job on its engine.
        began: Time of the start, on the monotonic clock [s].
        failures: Number of earlier attempts that crashed.
        is_alone: Whether no other fit may run at the same time.
        told: Fields of all messages so far; a later value replaces an earlier one.
        news: Stage and fraction that are not stored yet.
        renewed: Time of the last renewal of the lease, on the monotonic clock [s].
    """

    running: AbstractRunning
    began: float
    failures: int
    is_alone: bool = False
    told: dict[str, Any] = field(default_factory=dict)
    news: dict[str, Any] = field(default_factory=dict)
    renewed: float = 0.0

    @property
    def job(self) -> FitJob:
        """The job of the attempt."""
        return self.running.job

    def hear(self, message: dict[str, Any]) -> None:
        """Process a message; ignore progress that the database could not store.

        Args:
            message: Message of the process, with unchecked content.
        """
        self.told |= message
        progress = message.get("progress")
        if not isinstance(progress, dict):
            return
        stage, fraction = progress.get("stage"), progress.get("fraction")
        if isinstance(stage, str) and isinstance(fraction, int | float) and math.isfinite(fraction):
            self.news = {"stage": stage[:_LONGEST_STAGE], "fraction": float(fraction)}
