"""Warning of a result: a code for programs, a severity, and a sentence with its remedy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

__all__ = ["Option", "ResultWarning", "WarningSeverity", "both_ways"]

WarningSeverity = Literal["critical", "warning", "note"]
"""``critical``: do not rely on the result.  ``warning``: parts of it are biased, uncertain or
incomplete.  ``note``: an observation about the runs or the origin of a value."""

Option = Literal[
    "declared", "effects", "effort", "force", "known", "map", "set_aside", "time_limit"
]
"""Option that a remedy uses, by the name that a request to the service has for it."""

_IN_THE_SERVICE: Final[dict[Option, str]] = {
    "declared": "the nominal model under “Measured and simulated runs”, or declared=true",
    "effects": "“Search for missing effects”, or option effects",
    "effort": "“Effort”, or option effort",
    "force": "“Contradictory runs: fit anyway”, or option force",
    "known": "“Known values”, or option known",
    "map": "“Mapping” of the run, or its member mapping",
    "set_aside": "“Contradictory runs: set aside”, or option set_aside",
    "time_limit": "option time_limit",
}
"""Field of the form, and option of a request, that do what the option of the command line does."""


@dataclass(frozen=True)
class ResultWarning:
    """One warning of a result."""

    code: str
    """Stable identifier such as ``unexplained_channel``."""
    severity: WarningSeverity
    """Consequence for the result."""
    message: str
    """Description with the values."""
    fix: str = ""
    """Action that removes the cause, which `message` may contain; empty if there is none."""
    option: Option | None = None
    """Option of the command line that `fix` names; None if it names none."""

    def __str__(self) -> str:
        """Message and remedy as one line of text."""
        if not self.fix or f"; {self.fix}" in self.message:
            return self.message
        return f"{self.message}; {self.fix}"

    def details(self) -> dict[str, str]:
        """The parts that a program needs beside the text, for result.json."""
        details = {"code": self.code, "severity": self.severity, "fix": self.fix}
        if self.option is not None:
            details["fix_http"] = _IN_THE_SERVICE[self.option]
        return details


def both_ways(option: Option) -> str:
    """Option of the command line, then the same in the service, for messages without a remedy."""
    return f"--{option.replace('_', '-')} (service: {_IN_THE_SERVICE[option]})"
