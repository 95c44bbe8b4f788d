"""What one torture test asked, measured and concluded."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Outcome"]


@dataclass(frozen=True)
class Outcome:
    """One line of the table.

    Args:
        test: What was done to the service.
        asked: What it must show.
        measured: What it showed, with its figures.
        passed: Whether that is what was asked.
    """

    test: str
    asked: str
    measured: str
    passed: bool
