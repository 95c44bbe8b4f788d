"""Fault isolation for report sections: a line of text replaces a section that cannot be computed.

    attempts = Attempts()
    attempts.figure("step response", lambda: step_figure(steps))
    attempts.rows("table of runs", lambda: run_rows(data))
    attempts.remarks

The report shows a result that is already on disk.  Values that one figure cannot show (an infinite
simulation, an empty curve) must not suppress the other figures.
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
"""Exceptions that unusual values can raise; numpy's LinAlgError is a ValueError."""


@dataclass
class Attempts:
    """Sections of one page, and remarks on those that could not be computed.

    Args:
        remarks: One sentence for each missing section.
    """

    remarks: list[str] = field(default_factory=list)

    def part(self, name: str, compute: Callable[[], _Part]) -> _Part | None:
        """Compute a section; return None and add a remark if the values do not allow it.

        Args:
            name: Name of the section in the remark.
            compute: Computation, run with floating-point warnings off.
        """
        try:
            with np.errstate(all="ignore"):
                return compute()
        except _FAILURES as error:
            self.remarks.append(_remark(name, error))
            return None

    def rows(self, name: str, compute: Callable[[], Iterable[_Part]]) -> tuple[_Part, ...]:
        """Compute several items; return () and add a remark if the values do not allow it."""
        return self.part(name, lambda: tuple(compute())) or ()

    def figure(self, name: str, draw: Callable[[], str]) -> Markup:
        """Draw a figure; return a line of text instead if the values do not allow it.

        Args:
            name: Name of the figure in the line of text.
            draw: Function that returns the SVG text.
        """
        try:
            with np.errstate(all="ignore"):
                return Markup(draw())  # noqa: S704  svg.text escapes external text
        except _FAILURES as error:
            return Markup('<p class="muted">') + escape(_remark(name, error)) + Markup("</p>")


def _remark(name: str, error: Exception) -> str:
    why = str(error) or type(error).__name__
    return f"The {name} cannot be drawn for these values ({why}); result.json contains the numbers."
