"""Finding of a check: a contradiction in the runs, with its statistic and its correction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from identification.warning import Option, ResultWarning, WarningSeverity

__all__ = ["Finding", "Severity"]

Severity = Literal["refuse", "suspect"]
"""``refuse``: contradicts physics or the other runs.  ``suspect``: possible but unusual."""


@dataclass(frozen=True)
class Finding:
    """One contradiction or one suspicion."""

    code: str
    """Stable identifier such as ``reversed_channel``."""
    severity: Severity
    """``refuse`` blocks a fit, ``suspect`` does not."""
    file: str
    """Name of the run; empty if it concerns all runs."""
    column: str | None
    """Canonical name of the channel, or None."""
    message: str
    """Description of the fault."""
    statistic: str
    """Name of the deciding statistic."""
    value: float
    """Its value."""
    limit: float
    """Limit that it was compared with."""
    corrections: tuple[str, ...] = ()
    """``--map`` arguments that correct the fault; empty if no mapping can."""
    separable: bool = True
    """True if the fault is known to be in this run, regardless of the others."""
    remedy: str = ""
    """Action at the end of the message that removes the cause; empty if it has none."""
    option: Option | None = None
    """Option of the command line that `remedy` names; None if it names none."""

    def __str__(self) -> str:
        """Location, message, statistic with its limit, and the correction to type."""
        return str(self.warning())

    def warning(self, lead: str = "", severity: WarningSeverity = "warning") -> ResultWarning:
        """The finding as a warning of the result; `lead` stands before the location."""
        location = ", column ".join(word for word in (self.file, self.column) if word)
        text = f"{location}: {self.message}" if location else self.message
        text += f" ({self.statistic} {self.value:.3g}, limit {self.limit:.3g})"
        maps = " ".join(f"--map '{word}'" for word in self.corrections)
        fix = f"correct it with {maps}" if maps else self.remedy
        option = "map" if maps else self.option
        return ResultWarning(self.code, severity, lead + text, fix, option)

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
