"""What is missing as a smooth curve in one signal.

A *curve* is a cubic spline with free heights that enters one of the two balances, alone or carried
by a second signal: a friction that grows with the load is a curve in the size of the current
carried by the direction of the motion.

Source: Eilers and Marx, Statistical Science 11 (1996), 89-121 (splines on even knots).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import AbstractForced, amplitude
from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractTorque,
    AbstractVoltage,
    Expression,
    Signals,
    Values,
)

__all__ = ["HEIGHTS", "REGRESSORS", "STRAIGHT", "MissingTorque", "MissingVoltage"]

Array = NDArray[np.float64]

HEIGHTS: Final = 9
_STEEP: Final = 3e-3
_FINE: Final = 2000

STRAIGHT: Final = ("temperature", "time", "time in the run", "position")
"""Signals that are not drawn together far from zero."""
REGRESSORS: Final = ("current", "speed", "voltage")
"""What the linear parts are in proportion to."""


@dataclass(frozen=True)
class _Curve(AbstractForced):
    """A spline along one signal, times a carrier.

        term = -sum_k h_k (B_k(z) c - a_k . r) - l . r

    with z the signal (drawn together with a logarithm far from zero where it changes sign), c the
    carrier, and r what declared parameters multiply: current, speed and, in l alone, voltage.

    Args:
        along: The signal.
        carrier: Empty, ``direction`` of the motion, ``speed`` or ``current``.
        size: Natural size of the term [N m] or [V].
        lower: Least value of the signal, after drawing together.
        upper: Largest.
        zero: Width of what counts as near zero, in the unit of the signal.
        speed: Natural speed [rad/s].
        current: Natural current [A].
        starts: Time at which each run began, in order, counted over all runs, and at which the
            last one ended [s].  A curve that is local is zero in runs beyond.
        imitated: For each basis function its share of current and of speed, over their sizes.
        linear: Standard deviations that l has before the data, for current, speed and voltage over
            their sizes; none where it is zero or the tuple is empty [N m] or [V].
    """

    along: str
    carrier: str
    size: float
    lower: float
    upper: float
    zero: float
    speed: float
    current: float
    starts: tuple[float, ...] = ()
    imitated: tuple[tuple[float, float], ...] = ((0.0, 0.0),) * HEIGHTS
    linear: tuple[float, ...] = ()

    name: ClassVar[str] = "unlisted"
    unit: ClassVar[str]
    source: ClassVar[str] = "Eilers and Marx, Statistical Science 11 (1996), 89-121"

    @property
    def variant(self) -> str:
        """Its signals and its equation."""
        form = " carried by ".join(filter(None, (self.along, self.carrier)))
        return f"{form} in the {self.equation} equation"

    @property
    def is_local(self) -> bool:
        """Whether it is a torque or voltage against time, which other runs do not have.

        A coefficient that drifts over all runs stays where it ended, and one that drifts anew in
        each run does so in others: validation runs have to confirm that.
        """
        return self.along.startswith("time") and not self.carrier

    def _here(self, signals: Signals) -> Expression:
        """One in runs that have the curve, zero elsewhere."""
        if not (self.is_local and self.starts):
            return ca.SX(1)
        return (signals.run > -0.5) * (signals.run < len(self.starts) - 1.5)

    @property
    def drivers(self) -> tuple[str, ...]:  # type: ignore[override]
        """The signals, the one it runs along first, but what is multiplied with before that."""
        along = self.along.removeprefix("size of ").removesuffix(" in the run")
        carried = {"": (), "direction": ("speed",), "speed": ("speed",), "current": ("current",)}
        others = carried[self.carrier]
        both = (*others, along) if self.carrier == "current" else (along, *others)
        return tuple(dict.fromkeys(both))

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Heights of the curve, and its linear parts where these are free."""
        heights = [
            amplitude(f"height_{k}", self.unit, f"height {k} of the curve", self.size, signed=True)
            for k in range(1, HEIGHTS + 1)
        ]
        return (
            *heights,
            *(
                Parameter(
                    f"linear_{name}", self.unit, f"part linear in {name}", scale=width, prior_sd=1.0
                )
                for name, width in self._free()
            ),
        )

    def _free(self) -> list[tuple[str, float]]:
        """Signals of the linear parts that are free, and their widths."""
        return [pair for pair in zip(REGRESSORS, self.linear, strict=False) if pair[1] > 0.0]

    def _missing(self, signals: Signals, values: Values) -> Expression:
        ratio = ca.vertcat(signals.current / self.current, signals.speed / self.speed)
        along = self.along_of(signals)
        carrier = self.carrier_of(signals)
        total = ca.SX(0)
        for k, hat in enumerate(self.basis_of(along)):
            imitated = ca.dot(ca.DM(list(self.imitated[k])), ratio)
            total = total + getattr(values, f"height_{k + 1}") * (hat * carrier - imitated)
        sizes = {"current": self.current, "speed": self.speed, "voltage": self.size}
        for name, _ in self._free():
            total = total + getattr(values, f"linear_{name}") * getattr(signals, name) / sizes[name]
        return -total * self._here(signals)

    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
        """What each start gives along a trajectory, (n_sample, n_start) [N m] or [V]."""
        return -self.columns(record, current, speed) @ starts

    def columns(self, record: Record, current: Array, speed: Array) -> Array:
        """Basis functions along a trajectory, (n_sample, n_height) [-]."""
        along, carrier = _functions(self)
        rows = np.array(
            [
                current,
                speed,
                *[record.column(n) for n in ("voltage", "temperature", "angle", "time", "run")],
            ]
        )
        (drawn,), (carried,) = _evaluated(along, rows), _evaluated(carrier, rows)
        if self.along == "position":
            hats = _evaluated(_basis(self), drawn[None, :]).T
        else:
            grid, table = _table(self)
            hats = np.column_stack([np.interp(drawn, grid, hat) for hat in table])
            for k, slope in [] if self.along in STRAIGHT else self._ends(drawn):
                hats[:, k] += slope
        imitated = np.array(self.imitated) @ np.array([current / self.current, speed / self.speed])
        return np.asarray(hats * carried[:, None] - imitated.T)

    def grid(self, points: int) -> Array:
        """(n_point,) values of the signal, in its unit, dense where the knots are."""
        drawn = np.linspace(self.lower, self.upper, points)
        if self.along in STRAIGHT:
            return drawn
        return np.asarray(self.zero * np.sinh(drawn))

    def shapes(self, grid: Array) -> Array:
        """(n_point, n_height) basis functions over the signal, without a carrier."""
        x = ca.SX.sym("x")
        drawn = x
        if self.along not in STRAIGHT:
            drawn = ca.log(x / self.zero + ca.sqrt((x / self.zero) ** 2 + 1))
        share = {"current": (1 / self.current, 0), "speed": (0, 1 / self.speed)}
        own = share.get(self.along, (0, 0))
        basis = [
            hat - (a * own[0] + b * own[1]) * x
            for hat, (a, b) in zip(self.basis_of(drawn), self.imitated, strict=True)
        ]
        function = ca.Function("shapes", [x], [ca.vertcat(*basis)])
        return np.asarray(function(grid[None, :])).T

    def along_of(self, signals: Signals) -> Expression:
        """The signal, drawn together where it changes sign."""
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
        value = getattr(signals, self.along.removeprefix("size of "))
        if self.along.startswith("size of "):
            value = ca.sqrt(value * value + (0.1 * self.zero) ** 2)
        if self.along not in ("temperature",):
            ratio = value / self.zero
            value = ca.log(ratio + ca.sqrt(ratio * ratio + 1))
        return value

    def carrier_of(self, signals: Signals) -> Expression:
        """What the curve is multiplied with [-]."""
        if self.carrier == "direction":
            return signals.speed / ca.sqrt(signals.speed**2 + (_STEEP * self.speed) ** 2)
        if self.carrier == "speed":
            return signals.speed / self.speed
        if self.carrier == "current":
            return signals.current / self.current
        return ca.SX(1)

    def basis_of(self, along: Expression) -> list[Expression]:
        """Cubic splines on even knots; around the circle for the angle."""
        if self.along == "position":
            found = []
            for order in range(1, HEIGHTS // 2 + 1):
                found += [ca.sin(order * along), ca.cos(order * along)]
            return [*found, ca.SX(1)][:HEIGHTS]
        width = (self.upper - self.lower) / (HEIGHTS - 3)
        inside = ca.fmin(ca.fmax(along, self.lower), self.upper)
        found = []
        for k in range(HEIGHTS):
            off = ca.fabs((inside - self.lower) / width - (k - 1))
            found.append((ca.fmax(2 - off, 0) ** 3 - 4 * ca.fmax(1 - off, 0) ** 3) / 6)
        if self.along not in STRAIGHT:
            # Beyond what was seen it goes on with its last slope.
            for k, slope in self._ends(along):
                found[k] = found[k] + slope
        return found

    def _ends(self, along: Any) -> list[tuple[int, Any]]:
        """What the slopes at both ends add to basis functions beyond them."""
        twice = 2 * (self.upper - self.lower) / (HEIGHTS - 3)
        is_array = isinstance(along, np.ndarray)
        least, most = (np.minimum, np.maximum) if is_array else (ca.fmin, ca.fmax)
        below, above = least(along - self.lower, 0) / twice, most(along - self.upper, 0) / twice
        return [(0, -below), (2, below), (HEIGHTS - 3, -above), (HEIGHTS - 1, above)]


@dataclass(frozen=True)
class MissingTorque(_Curve, AbstractTorque):
    """A torque that no effect of the catalogue explains, as a curve."""

    equation: ClassVar[str] = "mechanical"
    unit: ClassVar[str] = "N m"

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """The torque [N m]."""
        return self._missing(signals, values)


@dataclass(frozen=True)
class MissingVoltage(_Curve, AbstractVoltage):
    """A voltage that no effect of the catalogue explains, as a curve."""

    equation: ClassVar[str] = "electrical"
    unit: ClassVar[str] = "V"

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        """The voltage [V]."""
        return self._missing(signals, values)


@lru_cache(64)
def _functions(term: _Curve) -> tuple[ca.Function, ca.Function]:
    """The signal and the carrier, from what moves in a run."""
    names = ("current", "speed", "voltage", "temperature", "angle", "time", "run")
    symbols = {name: ca.SX.sym(name) for name in names}
    signals = Signals(**symbols, peak_temperature=ca.SX(0))
    rows = ca.vertcat(*symbols.values())
    return (
        ca.Function("along", [rows], [term.along_of(signals)]),
        ca.Function("carrier", [rows], [term.carrier_of(signals)]),
    )


def _basis(term: _Curve) -> ca.Function:
    """The basis over the signal."""
    x = ca.SX.sym("x")
    return ca.Function("basis", [x], [ca.vertcat(*term.basis_of(x))])


@lru_cache(64)
def _table(term: _Curve) -> tuple[Array, Array]:
    """(n_point,) places along the signal, and (n_height, n_point) the basis there."""
    grid = np.linspace(term.lower, term.upper, _FINE)
    return grid, _evaluated(_basis(term), grid[None, :])


def _evaluated(function: ca.Function, points: Array) -> Array:
    """A function at every point, (n_out, n_point), from (n_in, n_point).

    Through buffers: to make a CasADi matrix of an array takes longer than all else here.
    """
    given: Any = np.ascontiguousarray(points.T)
    found: Any = np.empty((points.shape[1], function.size1_out(0)))
    buffer, evaluate = function.map(points.shape[1]).buffer()
    buffer.set_arg(0, memoryview(given))  # type: ignore[call-arg]
    buffer.set_res(0, memoryview(found))  # type: ignore[call-arg]
    evaluate()
    return np.asarray(found.T)
