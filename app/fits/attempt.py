"""An attempt at a fit that runs under this server, and its messages so far."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from app.fits.engine import AbstractRunning
from app.fits.job import Job

__all__ = ["Attempt"]

_LONGEST_STAGE = 100


@dataclass
class Attempt:
    """An attempt that runs here.

    Args:
        running: The job as its engine has it.
        began: When it was begun, on the monotonic clock [s].
        failures: How many attempts failed before.
        is_alone: Whether no other fit may run meanwhile.
        told: All members of its messages; of each name the last.
        news: Stage and fraction that are not written down yet.
        renewed: When its lease was renewed, on the monotonic clock [s].
    """

    running: AbstractRunning
    began: float
    failures: int
    is_alone: bool = False
    told: dict[str, Any] = field(default_factory=dict)
    news: dict[str, Any] = field(default_factory=dict)
    renewed: float = 0.0

    @property
    def job(self) -> Job:
        """The job."""
        return self.running.job

    def hear(self, message: dict[str, Any]) -> None:
        """Take a message; progress that the tables could not hold is passed over.

        Args:
            message: What the process wrote, which may be anything.
        """
        self.told |= message
        progress = message.get("progress")
        if not isinstance(progress, dict):
            return
        stage, fraction = progress.get("stage"), progress.get("fraction")
        if isinstance(stage, str) and isinstance(fraction, int | float) and math.isfinite(fraction):
            self.news = {"stage": stage[:_LONGEST_STAGE], "fraction": float(fraction)}
