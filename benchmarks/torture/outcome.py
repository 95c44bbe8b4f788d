"""Outcome of one stress test."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Outcome"]


@dataclass(frozen=True)
class Outcome:
    """One line of the table.

    Args:
        test: Description of the test.
        asked: Requirement.
        measured: Measured result, with numbers.
        passed: Whether the requirement is met.
    """

    test: str
    asked: str
    measured: str
    passed: bool
