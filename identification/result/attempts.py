"""Fault isolation for report sections: a line of text replaces a section that cannot be computed.

    attempts = Attempts()
    attempts.rows("table of runs", run_rows, data)
    attempts.remarks
    figure("step response", step_figure, steps)

The report shows a result that is already on disk.  Values that one figure cannot show (an infinite
simulation, an empty curve) must not suppress the other figures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, ParamSpec, TypeVar

import numpy as np
from markupsafe import Markup

__all__ = ["Attempts", "figure"]

_Part = TypeVar("_Part")
_Given = ParamSpec("_Given")

_FAILURES: Final = (ArithmeticError, LookupError, TypeError, ValueError)
"""Exceptions that unusual values can raise; numpy's LinAlgError is a ValueError."""


@dataclass
class Attempts:
    """Sections of one page, and remarks on those that could not be computed."""

    remarks: list[str] = field(default_factory=list)
    """One sentence for each missing section."""

    def part(
        self,
        name: str,
        compute: Callable[_Given, _Part],
        *args: _Given.args,
        **kwargs: _Given.kwargs,
    ) -> _Part | None:
        """Compute a section; return None and add a remark if the values do not allow it."""
        try:
            with np.errstate(all="ignore"):
                return compute(*args, **kwargs)
        except _FAILURES as error:
            why = str(error) or type(error).__name__
            self.remarks.append(
                f"The {name} cannot be drawn for these values ({why}); result.json contains the "
                "numbers."
            )
            return None

    def rows(
        self,
        name: str,
        compute: Callable[_Given, Iterable[_Part]],
        *args: _Given.args,
        **kwargs: _Given.kwargs,
    ) -> tuple[_Part, ...]:
        """Compute several items; return () and add a remark if the values do not allow it."""
        return self.part(name, lambda: tuple(compute(*args, **kwargs))) or ()


def figure(
    name: str, draw: Callable[_Given, str], *args: _Given.args, **kwargs: _Given.kwargs
) -> Markup:
    """Draw a figure; return a line of text instead if the values do not allow it."""
    attempts = Attempts()
    drawn = attempts.part(name, draw, *args, **kwargs)
    if drawn is None:
        return Markup('<p class="muted">{}</p>').format(*attempts.remarks)
    return Markup(drawn)  # noqa: S704  figures escape external text
