"""Missing torque or voltage as a cubic B-spline in one signal.

A *curve* is a cubic spline with free coefficients in the electrical or mechanical equation; over
the shaft angle it is a Fourier series.  It may be multiplied by a second signal, the carrier:
friction that grows with the load is a curve in the magnitude of the torque of the motor, carried by
the direction of the motion.

Source: Eilers and Marx, Statistical Science 11 (1996), 89-121 (B-splines on equidistant knots).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractForced, Scope
from identification.effects.parameters import amplitude
from identification.model.declared import coefficient_at
from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.pointwise import values_at
from identification.model.term import Expression, Signals, Values

__all__ = ["HEIGHTS", "REGRESSORS", "STRAIGHT", "AbstractCurve"]

HEIGHTS: Final = 9
_STEEP: Final = 3e-3
_FINE: Final = 2000
_SIGNALS: Final = ("current", "speed", "voltage", "temperature", "angle", "time", "run")
"""Signals that change in a run."""

STRAIGHT: Final = ("temperature", "time", "time in the run", "position")
"""Signals that are not compressed by asinh."""
REGRESSORS: Final = ("current", "speed", "voltage")
"""Signals of the linear parts."""


@dataclass(frozen=True)
class AbstractCurve(AbstractForced):
    """Cubic B-spline in one signal, times a carrier.

        term = -sum_k g_k B_k(z) c - l . r,      g = h - sum_j (a_j . h) s_j

    Here z is the signal x, compressed as asinh(x / zero) unless it is in `STRAIGHT`, c the carrier,
    h the spline coefficients and r the regressors of the nominal parameters (current, speed and
    voltage, each over its scale).  Each s_j is a combination of current and speed, written as a
    spline, and a_j . h is the amount of it in the curve.  Coefficients along s_j have no effect, so
    only their prior determines them.
    """

    along: str
    """Name of the signal; the torque of the motor is that over Kt25 [A]."""
    carrier: str
    """Empty, ``direction`` of the motion, ``speed`` or ``current``."""
    size: float
    """Scale of the term [N m] or [V]."""
    lower: float
    """Lower end of the knots in z."""
    upper: float
    """Upper end of the knots in z."""
    zero: float
    """Width of the linear range of the compression, in the unit of the signal."""
    speed: float
    """Speed scale [rad/s]."""
    current: float
    """Current scale [A]."""
    starts: tuple[float, ...] = ()
    """Start time of each run and end time of the last run, on a clock that adds up the durations of
    the runs [s].  A local curve is zero in later runs."""
    removed: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...] = ()
    """Pairs (s_j, a_j) of coefficients of the basis functions [-]."""
    warming: float = 0.0
    """alpha_Kt with which a curve over the torque is scored; the simulation uses its own [1/K]."""
    linear: tuple[float, ...] = ()
    """Prior standard deviations of l for current, speed and voltage; a part is absent if its entry
    is zero or the tuple is empty [N m] or [V]."""

    name = "unlisted"
    unit: ClassVar[str]
    source = "Eilers and Marx, Statistical Science 11 (1996), 89-121"

    @property
    def variant(self) -> str:
        """The signals and the equation."""
        along = self.along.replace("size of", "magnitude of the")
        factor = f", times {self.carrier}" if self.carrier else ""
        factor = factor.replace("direction", "sign of speed")
        return f"curve over {along}{factor}, in the {self.equation} equation"

    @property
    def scope(self) -> Scope:
        """One span for a torque or voltage over time, which does not recur in other runs.

        With a carrier, the curve is a coefficient that drifts.  After a drift over all runs it
        keeps its last value, and a drift within each run recurs, so validation runs can test both.
        """
        is_course = self.along.startswith("time") and not self.carrier
        return "one span" if is_course else "all runs"

    def _here(self, signals: Signals) -> Expression:
        """Factor that is one in runs that have the curve, zero elsewhere [-]."""
        if not (self.is_local and self.starts):
            return ca.SX(1)
        return (signals.run > -0.5) * (signals.run < len(self.starts) - 1.5)

    @property
    def drivers(self) -> tuple[str, ...]:
        """Signals of the curve and then of the carrier; a current as the carrier comes first."""
        along = self.along.removeprefix("size of ").removesuffix(" in the run")
        along = "current" if along == "torque" else along
        carried = {"": (), "direction": ("speed",), "speed": ("speed",), "current": ("current",)}
        others = carried[self.carrier]
        both = (*others, along) if self.carrier == "current" else (along, *others)
        return tuple(dict.fromkeys(both))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        heights = [
            amplitude(f"height_{k}", self.unit, f"spline coefficient {k}", self.size, signed=True)
            for k in range(1, HEIGHTS + 1)
        ]
        return (
            *heights,
            *(
                Parameter(
                    f"linear_{name}", self.unit, f"coefficient of the part linear in {name}",
                    scale=width, prior_sd=1.0
                )
                for name, width in self._free()
            ),
        )  # fmt: skip

    def _free(self) -> list[tuple[str, float]]:
        """Signals of the free linear parts, with their prior standard deviations."""
        return [pair for pair in zip(REGRESSORS, self.linear, strict=False) if pair[1] > 0.0]

    def heights(self, values: Mapping[str, float]) -> Array:
        """(n_coefficient,) spline coefficients from the values of a fit by name [N m] or [V]."""
        return np.array([values[f"{self.name}.height_{k}"] for k in range(1, HEIGHTS + 1)])

    def missing(self, signals: Signals, values: Values) -> Expression:
        """The torque [N m] or voltage [V]."""
        heights = ca.vertcat(*[getattr(values, f"height_{k}") for k in range(1, HEIGHTS + 1)])
        kept = heights
        for line, amount in self.removed:
            kept = kept - ca.DM(line) * ca.dot(ca.DM(amount), heights)
        basis = self.basis_of(self.along_of(signals, values.alpha_Kt))
        total = ca.dot(kept, ca.vertcat(*basis)) * self.carrier_of(signals)
        sizes = {"current": self.current, "speed": self.speed, "voltage": self.size}
        for name, _ in self._free():
            total = total + getattr(values, f"linear_{name}") * getattr(signals, name) / sizes[name]
        return -total * self._here(signals)

    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
        return -self.columns(record, current, speed) @ starts

    @property
    def kept(self) -> Array:
        """Matrix of g over h, (n_coefficient, n_coefficient) [-]."""
        lines = [np.outer(line, amount) for line, amount in self.removed]
        return np.asarray(np.eye(HEIGHTS) - np.sum(lines, axis=0) if lines else np.eye(HEIGHTS))

    def over_signal(self, heights: Array) -> tuple[Array, Array]:
        """The signal over its range, and the curve there without carrier, each (n_point,)."""
        grid, table = _table(self)
        signal = grid if self.along in STRAIGHT else self.zero * np.sinh(grid)
        return signal, np.asarray(self.kept @ heights @ table)

    def drawn(self, record: Record, current: Array, speed: Array) -> tuple[Array, Array]:
        """Compressed signal [-] and carrier [-] along a trajectory, each (n_sample,)."""
        others = [record.column(name) for name in _SIGNALS[2:]]
        drawn, carried = values_at(_drawn(self), np.column_stack([current, speed, *others])).T
        return drawn, carried

    def columns(self, record: Record, current: Array, speed: Array) -> Array:
        """Basis functions times carrier, without collinear part, (n_sample, n_coefficient) [-]."""
        drawn, carried = self.drawn(record, current, speed)
        if self.along == "position":
            x = ca.SX.sym("x")
            basis = ca.Function("basis", [x], [ca.vertcat(*self.basis_of(x))])
            hats = values_at(basis, drawn[:, None])
        else:
            grid, table = _table(self)
            hats = np.column_stack([np.interp(drawn, grid, hat) for hat in table])
            for k, slope in [] if self.along in STRAIGHT else self._ends(drawn):
                hats[:, k] += slope
        return np.asarray(hats * carried[:, None] @ self.kept)

    def along_of(self, signals: Signals, warming: Expression) -> Expression:
        """The signal, compressed by asinh unless it is in `STRAIGHT`, at alpha_Kt [1/K]."""
        if self.along == "time":
            before = ca.SX(0)
            for run, start in enumerate(self.starts):
                begun = start - (self.starts[run - 1] if run else 0.0)
                before = before + begun * (signals.run > run - 0.5)
            return signals.time + before
        if self.along == "time in the run":
            return signals.time
        if self.along == "position":
            return signals.angle
        name = self.along.removeprefix("size of ")
        if name == "torque":
            value = coefficient_at(1.0, warming, signals.temperature) * signals.current
        else:
            value = getattr(signals, name)
        if self.along.startswith("size of "):
            value = ca.sqrt(value * value + (0.1 * self.zero) ** 2)
        if self.along != "temperature":
            ratio = value / self.zero
            value = ca.log(ratio + ca.sqrt(ratio * ratio + 1))
        return value

    def carrier_of(self, signals: Signals) -> Expression:
        """Factor on the curve [-]."""
        if self.carrier == "direction":
            return signals.speed / ca.sqrt(signals.speed**2 + (_STEEP * self.speed) ** 2)
        if self.carrier == "speed":
            return signals.speed / self.speed
        if self.carrier == "current":
            return signals.current / self.current
        return ca.SX(1)

    def basis_of(self, along: Expression) -> list[Expression]:
        """Cubic B-splines on equidistant knots, also of an array; a Fourier basis for the angle."""
        if self.along == "position":
            found = []
            for order in range(1, HEIGHTS // 2 + 1):
                found += [ca.sin(order * along), ca.cos(order * along)]
            return [*found, ca.SX(1)][:HEIGHTS]
        width = (self.upper - self.lower) / (HEIGHTS - 3)
        least, most = _limits_of(along)
        inside = least(most(along, self.lower), self.upper)
        found = []
        for k in range(HEIGHTS):
            off = abs((inside - self.lower) / width - (k - 1))
            wide, narrow = most(2 - off, 0), most(1 - off, 0)
            found.append((wide * wide * wide - 4 * (narrow * narrow * narrow)) / 6)
        if self.along not in STRAIGHT:
            # Linear extrapolation beyond the observed range.
            for k, slope in self._ends(along):
                found[k] = found[k] + slope
        return found

    def _ends(self, along: Expression) -> list[tuple[int, Expression]]:
        """Linear extrapolation beyond both ends: index and increment of each basis function."""
        twice = 2 * (self.upper - self.lower) / (HEIGHTS - 3)
        least, most = _limits_of(along)
        below, above = least(along - self.lower, 0) / twice, most(along - self.upper, 0) / twice
        return [(0, -below), (2, below), (HEIGHTS - 3, -above), (HEIGHTS - 1, above)]


@lru_cache(64)
def _drawn(term: AbstractCurve) -> ca.Function:
    """Compressed signal and carrier as a function of `_SIGNALS`."""
    symbols = {name: ca.SX.sym(name) for name in _SIGNALS}
    signals = Signals(**symbols, peak_temperature=ca.SX(0))
    both = ca.vertcat(term.along_of(signals, term.warming), term.carrier_of(signals))
    return ca.Function("drawn", [ca.vertcat(*symbols.values())], [both])


def _limits_of(along: Expression) -> tuple[Callable[..., Expression], Callable[..., Expression]]:
    """Elementwise minimum and maximum, for arrays and for expressions."""
    return (np.minimum, np.maximum) if isinstance(along, np.ndarray) else (ca.fmin, ca.fmax)


@lru_cache(64)
def _table(term: AbstractCurve) -> tuple[Array, Array]:
    """(n_point,) values of the compressed signal, and (n_coefficient, n_point) the basis there."""
    grid = np.linspace(term.lower, term.upper, _FINE)
    return grid, np.array(term.basis_of(grid))
