"""A finding: one contradiction in the runs, with the number it rests on and its correction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding", "Severity"]

Severity = Literal["refuse", "suspect"]
"""``refuse``: contradicts physics or the other runs.  ``suspect``: possible, and unusual."""


@dataclass(frozen=True)
class Finding:
    """One contradiction, or one suspicion.

    Args:
        code: Stable word such as ``reversed_channel``.
        severity: Whether a fit is refused for it.
        file: Name of the run; empty where all runs have it.
        column: Canonical name of the channel, or None.
        message: What is wrong, in words.
        statistic: Name of the number that decided.
        value: Its value.
        limit: What it was compared with.
        corrections: Words of ``--map`` that correct it; empty where no mapping can.
        separable: Whether physics says that this run is at fault, whatever the others hold.
    """

    code: str
    severity: Severity
    file: str
    column: str | None
    message: str
    statistic: str
    value: float
    limit: float
    corrections: tuple[str, ...] = ()
    separable: bool = True

    def __str__(self) -> str:
        """Place, message, the number with its limit, and the correction to type."""
        place = ", column ".join(word for word in (self.file, self.column) if word)
        text = f"{place}: {self.message}" if place else self.message
        text += f" ({self.statistic} {self.value:.3g}, limit {self.limit:.3g})"
        if self.corrections:
            text += "; correct it with " + " ".join(f"--map '{word}'" for word in self.corrections)
        return text

    def entry(self) -> dict[str, object]:
        """The finding as plain data for result.json and HTTP."""
        return {
            "code": self.code,
            "severity": self.severity,
            "file": self.file or None,
            "column": self.column,
            "message": self.message,
            "statistic": self.statistic,
            "value": self.value,
            "limit": self.limit,
            "corrections": list(self.corrections),
        }
