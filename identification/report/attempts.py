"""Parts of the report that may fail without the page: a line of text stands in their place.

    attempts = Attempts()
    attempts.figure("step response", lambda: step_figure(steps))
    attempts.rows("table of runs", lambda: run_rows(data))
    attempts.remarks

The page is a view of a result that is on the disk already.  Numbers that no figure can show
(an infinite simulation, an empty curve) are no reason to lose the other figures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, TypeVar

import numpy as np
from markupsafe import Markup, escape

__all__ = ["Attempts"]

_Part = TypeVar("_Part")

_FAILURES: Final = (ArithmeticError, LookupError, TypeError, ValueError)
"""Errors that values may cause; numpy's LinAlgError is a ValueError."""


@dataclass
class Attempts:
    """Parts of one page, and what could not be computed.

    Args:
        remarks: One sentence for each part that is missing.
    """

    remarks: list[str] = field(default_factory=list)

    def part(self, name: str, compute: Callable[[], _Part]) -> _Part | None:
        """What is computed; None and a remark where the values do not allow it.

        Args:
            name: The part as the remark calls it.
            compute: Computation, with floating-point warnings off.
        """
        try:
            with np.errstate(all="ignore"):
                return compute()
        except _FAILURES as error:
            self.remarks.append(_remark(name, error))
            return None

    def rows(self, name: str, compute: Callable[[], Iterable[_Part]]) -> tuple[_Part, ...]:
        """The same of several; none and a remark where the values do not allow it."""
        return self.part(name, lambda: tuple(compute())) or ()

    def figure(self, name: str, draw: Callable[[], str]) -> Markup:
        """A drawing, or a line of text in its place.

        Args:
            name: The figure as the line calls it.
            draw: Function that returns the text of the drawing.
        """
        try:
            with np.errstate(all="ignore"):
                return Markup(draw())  # noqa: S704  svg.text escapes what comes from outside
        except _FAILURES as error:
            return Markup('<p class="muted">') + escape(_remark(name, error)) + Markup("</p>")


def _remark(name: str, error: Exception) -> str:
    why = str(error) or type(error).__name__
    return f"The {name} cannot be drawn from these values ({why}); result.json holds the numbers."
