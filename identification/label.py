"""Names of a motor and of its test bench, which a result carries but no computation uses."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Final

from identification.errors import OptionError

__all__ = ["LONGEST_LABEL", "Label"]

LONGEST_LABEL: Final = 200
"""Largest length of a name [characters]."""


@dataclass(frozen=True)
class Label:
    """Names that identify the subject of a result.

    Raises:
        OptionError: A name is too long or not printable.
    """

    motor: str = ""
    """Name of the motor; empty if unknown."""
    bench: str = ""
    """Name of the test bench; empty if unknown."""

    def __post_init__(self) -> None:
        for name, text in asdict(self).items():
            if len(text) > LONGEST_LABEL or not text.isprintable():
                raise OptionError(
                    f"{name} is {text[:40]!r}; expected at most {LONGEST_LABEL} printable "
                    "characters",
                    value=text[:40],
                )

    def member(self) -> dict[str, dict[str, str]]:
        """Member ``label`` of result.json with the given names; empty if there is none."""
        given = {name: text for name, text in asdict(self).items() if text}
        return {"label": given} if given else {}
