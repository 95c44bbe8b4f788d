"""Local substepping: integration of selected sample intervals in several substeps.

One third-order step per sample interval has an error far below the noise almost everywhere.  The
exceptions are few: intervals in which friction changes sign, the current passes the knee of the
brush drop, or a torque is periodic in a fast angle.  Only those intervals are divided, and only
around the passage, so a motor with sharp friction costs little more than a smooth one.

The error of a substep is estimated by step doubling: it is the change of current and speed when the
substep is halved.  Substeps with too large an error are halved, once or several times, and measured
again.  They stay fixed during a fit, which keeps its cost a smooth function of the parameters.

Source: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd edition, Springer
(1993), section II.4 (step doubling).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Index
from identification.model.blocks import blocks
from identification.model.composite import INPUTS, Hold, MotorModel
from identification.model.scan import Scan, scan_of
from identification.model.step import advance, part_of_interval
from identification.model.step_plan import StepPlan

__all__ = [
    "FINER",
    "MOST_SUBSTEPS",
    "ROUNDS",
    "Substeps",
    "divided",
    "doublings",
    "errors_of",
    "evenly",
    "refined",
    "settled",
]

MOST_SUBSTEPS: Final = 64
"""Sample interval over the shortest substep, at most."""
_UNRESOLVED: Final = 1e6
"""Error over the tolerance of a substep whose simulation diverges."""
FINER: Final = 8.0
"""Tolerance over the smaller one with which it is compared."""
ROUNDS: Final = 6
"""Measurements of the errors at most until the substeps meet a tolerance."""
_ATTEMPTS: Final = 3


@dataclass(frozen=True, eq=False)
class Substeps:
    """Substeps of the sample intervals of a record."""

    counts: NDArray[np.int64]
    """(n_sample,) substeps of each interval."""
    shares: Array
    """(n_row,) length of each substep over that of its interval [-]."""

    @staticmethod
    def even(counts: NDArray[np.int64]) -> Substeps:
        """Equal substeps in each interval; the counts are (n_sample,)."""
        return Substeps(counts, np.repeat(1.0 / counts, counts))

    @property
    def rows(self) -> int:
        """Number of substeps."""
        return self.shares.size

    @cached_property
    def first_rows(self) -> Index:
        """(n_sample,) row of the divided inputs at which each interval begins."""
        return np.concatenate([[0], np.cumsum(self.counts)[:-1]])

    @property
    def begins(self) -> Array:
        """(n_row,) time between the starts of the interval and of the substep, as a share [-]."""
        before = np.cumsum(self.shares) - self.shares
        within = before - np.repeat(before[self.first_rows], self.counts)
        return np.asarray(np.maximum(within, 0.0))

    def of(self, samples: slice) -> Substeps:
        """Substeps of a range of sample intervals."""
        counts = self.counts[samples]
        start = int(self.counts[: samples.start or 0].sum())
        return Substeps(counts, self.shares[start : start + int(counts.sum())])

    def at_most(self, number: int) -> Substeps:
        """Intervals with more substeps than `number` get as many equal ones."""
        many = self.counts > number
        kept = self.shares[~np.repeat(many, self.counts)]
        counts = np.where(many, number, self.counts)
        shares = np.full(int(counts.sum()), 1.0 / number)
        shares[~np.repeat(many, counts)] = kept
        return Substeps(counts, shares)

    def halved(self, times: NDArray[np.int64]) -> Substeps:
        """Substeps halved so many times each, (n_row,)."""
        parts = 2**times
        counts = np.add.reduceat(parts, self.first_rows)
        return Substeps(counts, np.repeat(self.shares / parts, parts))


def evenly(rows: Sequence[int], substeps: int) -> tuple[Substeps, ...]:
    """Equal substeps, as many in each interval, for records with so many samples."""
    return tuple(Substeps.even(np.full(n, substeps, dtype=np.int64)) for n in rows)


def divided(inputs: Array, substeps: Substeps, hold: Hold) -> Array:
    """Inputs (n_row, n_input) with one row per substep, from those of the samples."""
    rows = np.repeat(inputs, substeps.counts, axis=0)
    begins, shares = substeps.begins, substeps.shares
    part = part_of_interval(rows.T, hold, begins, shares) | {"substep": begins / shares}
    return np.column_stack([part[name] for name in INPUTS])


@lru_cache
def error_scan(model: MotorModel, plan: StepPlan) -> Scan:
    """Loop that advances in half steps and outputs their difference from the whole step, (2,)."""
    x, u, p = model.symbols()
    step = ca.Function("step", [x, u, p], [advance(model, plan, x, u, p)])
    parts = [part_of_interval(ca.vertsplit(u), model.held, begin, 0.5) for begin in (0.0, 0.5)]
    first, second = (ca.vertcat(*[part[name] for name in INPUTS]) for part in parts)
    end = step(step(x, first, p), second, p)
    return scan_of(ca.Function("errors", [x, u, p], [end, (end - step(x, u, p))[:2]]), effort="few")


def errors_of(
    loop: tuple[MotorModel, StepPlan],
    inputs: Sequence[Array],
    start: tuple[Array, Sequence[Array]],
    substeps: Sequence[Substeps],
) -> list[Array]:
    """Integration errors of the substeps of each record (n_row, 2) [A, rad/s], block by block.

    For each record the inputs are (n_sample, n_input).  The start has physical values (n_parameter,
    1), and an initial state (n_state, 1) of each record.
    """
    scan, values, carries = error_scan(*loop), start[0], list(start[1])
    found: list[list[Array]] = [[] for _ in substeps]
    rows = sum(each.rows for each in substeps)
    for going, parts in blocks([each.counts.size for each in substeps], rows):
        fine = [
            divided(inputs[k][part], substeps[k].of(part), loop[0].held)
            for k, part in zip(going, parts, strict=True)
        ]
        ends, errors = scan(fine, values, [carries[k] for k in going])
        for k, end, error in zip(going, ends, errors, strict=True):
            carries[k] = end
            found[k].append(error[:, :, 0].copy())
    return [np.concatenate(parts) for parts in found]


def refined(
    substeps: tuple[Substeps, ...],
    measured: Callable[[Sequence[Substeps]], list[Array]],
    tolerance: Array,
    rounds: int,
    most: int = MOST_SUBSTEPS,
    errors: list[Array] | None = None,
) -> tuple[tuple[Substeps, ...], list[Array] | None]:
    """Substeps of all records, halved until each sample interval meets the tolerance.

    The tolerance is the allowed error of current and speed per sample interval (2,) [A, rad/s]; no
    substep becomes shorter than its interval over `most`.  The errors of substeps, (n_row, 2) for
    each record, are `measured` and the substeps halved at most `rounds` times; those of the given
    ones are not measured again if known.

    Returns:
        The substeps, the given ones if none is halved, and their errors; None if not measured.
    """
    for _ in range(rounds):
        errors = measured(substeps) if errors is None else errors
        pairs = zip(substeps, errors, strict=True)
        halvings = [doublings(each, error, tolerance, most) for each, error in pairs]
        if not any(times.any() for times in halvings):
            break
        pieces = zip(substeps, halvings, strict=True)
        substeps, errors = tuple(each.halved(times) for each, times in pieces), None
    return substeps, errors


def settled(
    substeps: tuple[Substeps, ...],
    measured: Callable[[Sequence[Substeps]], list[Array]],
    tolerance: Array,
    readings: Callable[[tuple[Substeps, ...]], list[Array]],
    agree: Callable[[Sequence[Array], Sequence[Array]], bool],
    *,
    rounds: int = 1,
    most: int = MOST_SUBSTEPS,
) -> tuple[Substeps, ...]:
    """Substeps that meet a tolerance and whose readings agree with those of an eighth of it.

    If they do not, the finer substeps are compared in the same way, up to three times.  The
    arguments are those of `refined`; the errors of the finer substeps are measured `rounds` times.
    """
    substeps, errors = refined(substeps, measured, tolerance, ROUNDS, most)
    before: list[Array] | None = None
    for _ in range(_ATTEMPTS):
        tolerance = tolerance / FINER
        finer, later = refined(substeps, measured, tolerance, rounds, most, errors)
        if finer is substeps:
            break
        before, after = before or readings(substeps), readings(finer)
        if agree(before, after):
            break
        before, substeps, errors = after, finer, later
    return substeps


def doublings(
    substeps: Substeps, errors: Array, tolerance: Array, most: int = MOST_SUBSTEPS
) -> NDArray[np.int64]:
    """Number of halvings of each substep, (n_row,), at most three.

    The errors (n_row, n_channel) of each substep share the tolerance of their sample interval,
    which is divided until their sum is below it and no further.  The allowed error of a substep is
    the tolerance over the number n = (sum r)^2 / sum r^2 of substeps that have the error, r being
    the errors over the tolerance.  Since sum r^2 <= max r sum r, the largest one is halved whenever
    sum r > 1.
    """
    ratio = np.max(np.abs(errors) / tolerance, axis=1)
    ratio = np.where(np.isfinite(ratio), np.minimum(ratio, _UNRESOLVED), _UNRESOLVED)
    total, squares = (np.add.reduceat(each, substeps.first_rows) for each in (ratio, ratio**2))
    spread = np.where(total > 1.0, total**2 / np.maximum(squares, 1e-300), 0.0)
    excess = ratio * np.repeat(spread, substeps.counts)
    # An error falls as 1/n at a kink and as 1/n^3 elsewhere.  The exponent 2 is a compromise; the
    # next error measurement corrects it.
    wanted = np.ceil(0.5 * np.log2(np.clip(excess, 1.0, 64.0)))
    allowed = np.floor(np.log2(np.maximum(substeps.shares * most, 1.0)) + 1e-9)
    return np.asarray(np.minimum(wanted, allowed), dtype=np.int64)
