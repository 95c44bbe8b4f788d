"""What of a curve the declared parameters may be, which no data tell.

A curve in the speed, in the mechanical balance, may have any straight line added to it as long as
the viscous friction is changed by as much; one in the current, in the electrical balance, trades
with the resistance, and one in the current in the mechanical balance with the scale of torque,
inertia and friction.  The search takes the line out of the curve, and a posterior is sampled
without it.  What is said in the end has it: its size is drawn, and the declared parameters follow
so that the motor stays the same.  Their intervals are as wide as they have to be, and they are not
called determined.

How large the line may be is taken from the curve itself: several times what remains beside it, as
of powers of a signal (i |i| has a line four times as large as the rest, |i|^1.5 seven times, a step
nearly twice).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.effects.curve import (
    HEIGHTS,
    REGRESSORS,
    MissingTorque,
    MissingVoltage,
)
from identification.effects.curves import sampled
from identification.effects.imitation import is_formed
from identification.effects.refit import refitted_as
from identification.fit.solve import Fit, Patience

__all__ = ["Line", "lines_of", "with_linear_parts", "with_lines_drawn"]

Array = NDArray[np.float64]

_LARGER: Final = 4.0
"""Size of a line over the size of what remains beside it."""
_MOST: Final = 0.5
"""Share of what a declared parameter does that a line may take: one standard deviation."""
_ALL: Final = 0.95
"""Share of it that no draw passes."""


@dataclass(frozen=True)
class Line:
    """A line that a curve may have or a declared parameter.

    Args:
        equation: ``electrical`` or ``mechanical``.
        signal: What it is in proportion to.
        size: Size of the signal, in its unit.
        width: Standard deviation of the line at that size [V] or [N m].
        unit: Its unit.
    """

    equation: str
    signal: str
    size: float
    width: float
    unit: str

    @property
    def name(self) -> str:
        """Name of its parameter."""
        return f"unlisted.linear_{self.signal}"

    def drawn(self, draws: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
        """Draws with a line in the curve and the declared parameters changed by as much.

        Args:
            draws: Draws without the line by name, of one shape each.
            rng: Where the line is drawn from.
        """
        size = self.width * rng.standard_normal(draws["J"].shape) / self.size
        if (self.equation, self.signal) == ("mechanical", "speed"):
            # Mirrored where less than no friction would be left.
            size = np.where(size > draws["b"], 2 * draws["b"] - size, size)
            return draws | {"b": draws["b"] - size, self.name: size * self.size}
        if self.equation == "mechanical" or self.signal == "speed":
            own = draws["Kt25"]
        else:
            own = draws["Ra25"] if self.signal == "current" else np.ones(size.shape)
        size = np.clip(size, -_ALL * own, _ALL * own)
        return draws | self._compensated(draws, 1.0 - size / own) | {self.name: size * self.size}

    def _compensated(self, draws: dict[str, Array], left: Array) -> dict[str, Array]:
        """Declared parameters and heights that leave the motor as it is.

        Args:
            draws: Draws without the line.
            left: Share that is left of what the line is taken from [-].
        """
        if (self.equation, self.signal) == ("electrical", "current"):
            return {"Ra25": draws["Ra25"] * left, "alpha_Ra": draws["alpha_Ra"] / left}
        scaled = {"J": draws["J"] * left, "b": draws["b"] * left}
        if (self.equation, self.signal) == ("electrical", "speed"):
            return scaled | {"Kt25": draws["Kt25"] * left, "alpha_Kt": draws["alpha_Kt"] / left}
        heights = {k: v * left for k, v in draws.items() if k.startswith("unlisted.height_")}
        if self.signal == "voltage":
            scaled |= {name: draws[name] * left for name in ("Ra25", "Kt25", "L")}
        return scaled | heights


def lines_of(fit: Fit) -> tuple[Line, ...]:
    """The lines that curves of a fit have free; see `with_linear_parts`."""
    found = []
    for term in fit.simulator.model.terms:
        if isinstance(term, MissingTorque | MissingVoltage) and term.linear:
            sizes = (term.current, term.speed, term.size)
            found += [
                Line(term.equation, name, size, width, term.unit)
                for name, size, width in zip(REGRESSORS, sizes, term.linear, strict=True)
                if width > 0.0
            ]
    return tuple(found)


def with_lines_drawn(draws: dict[str, Array], lines: Sequence[Line], seed: int) -> dict[str, Array]:
    """Draws of a posterior with lines that the data leave open.

    Args:
        draws: Draws by name, of one shape each, from a model that has no lines.
        lines: The lines.
        seed: Seed of the lines.
    """
    rng = np.random.default_rng([seed, len(lines)])
    for line in lines:
        draws = line.drawn(draws, rng)
    return draws


def with_linear_parts(fit: Fit, patience: Patience | None = None) -> Fit:
    """The fit with the linear parts of its curves free; its optimum is where it was.

    Args:
        fit: Fit of a model, with or without curves.
        patience: When to give up.
    """
    for term in fit.simulator.model.terms:
        if isinstance(term, MissingTorque | MissingVoltage) and not term.linear:
            linear = _widths(term, fit)
            if any(linear):
                fit = refitted_as(fit, replace(term, linear=linear), patience)
    return fit


def _widths(term: MissingTorque | MissingVoltage, fit: Fit) -> tuple[float, ...]:
    """Standard deviation of each linear part [N m] or [V]."""
    values = dict(zip(fit.coordinates.names, fit.values, strict=True))
    heights = np.array([values[f"unlisted.height_{k}"] for k in range(1, HEIGHTS + 1)])
    columns, regressors = sampled(term, fit.simulator.records)
    size = float(np.sqrt(np.mean((columns @ heights) ** 2)))
    basis = columns + regressors[:, :2] @ np.array(term.imitated).T
    most = {
        ("electrical", "current"): values["Ra25"] * term.current,
        ("electrical", "speed"): values["Kt25"] * term.speed,
        ("mechanical", "current"): values["Kt25"] * term.current,
    }
    widths = []
    for name, regressor in zip(REGRESSORS, regressors.T, strict=True):
        width = 0.0
        if name in term.drivers and is_formed(basis, regressor):
            own = most.get((term.equation, name), term.size)
            width = min(_LARGER * size / float(np.sqrt(np.mean(regressor**2))), _MOST * own)
        widths.append(width)
    return tuple(widths)
