"""Warning of a result: a code for programs, a severity, and a sentence with its remedy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["ResultWarning", "WarningSeverity"]

WarningSeverity = Literal["critical", "warning", "note"]
"""``critical``: do not rely on the result.  ``warning``: parts of it are biased, uncertain or
incomplete.  ``note``: an observation about the runs or the origin of a value."""


@dataclass(frozen=True)
class ResultWarning:
    """One warning of a result.

    Args:
        code: Stable identifier such as ``unexplained_channel``.
        severity: Consequence for the result.
        message: Description with the values.
        fix: Action that removes the cause, which `message` may contain; empty if there is none.
    """

    code: str
    severity: WarningSeverity
    message: str
    fix: str = ""

    def __str__(self) -> str:
        """Message and remedy as one line of text."""
        if not self.fix or f"; {self.fix}" in self.message:
            return self.message
        return f"{self.message}; {self.fix}"

    def details(self) -> dict[str, str]:
        """The parts that a program needs beside the text, for result.json."""
        return {"code": self.code, "severity": self.severity, "fix": self.fix}
