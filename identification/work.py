"""Count of floating-point operations, the repeatable measure of cost that bounds every stage.

A limit in seconds makes the answer depend on the load of the machine.  Here the numerical kernels
charge their operations to a meter, and a stage stops when its budget is spent.  Equal input and
equal versions therefore give equal results under any load and with any number of threads.

    with metered():
        budget = Budget(2e10)
        while not budget.spent: ...

A clock is used only if the user sets a time limit.  `metered` then asks the clock whether to stop;
from that moment every budget is spent, and `was_interrupted` is true.

The count is an estimate: rows times lanes times operations of a simulated step, the products of the
normal equations, and a fixed charge for each compiled structure.  It has to be repeatable and to
grow with computing time; it need not be exact.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

import numpy as np

__all__ = ["TOUCH", "Budget", "charge", "charge_once", "metered", "operations", "was_interrupted"]


TOUCH = 20.0
"""Operations that take as long as reading and writing one number of a large array."""


@dataclass
class _Meter:
    is_due: Callable[[], bool] = lambda: False
    operations: float = 0.0
    known: set[Hashable] = field(default_factory=set)
    interrupted: bool = False


_meter: ContextVar[_Meter] = ContextVar("meter")
_outside = _Meter()


@contextmanager
def metered(is_due: Callable[[], bool] | None = None) -> Iterator[None]:
    """Meter for one identification, which starts at zero and without compiled structures.

    `is_due` is called between the steps of a stage and returns whether to stop.
    """
    token = _meter.set(_Meter(is_due) if is_due else _Meter())
    try:
        yield
    finally:
        _meter.reset(token)


def operations() -> float:
    """Operations charged so far."""
    return _meter.get(_outside).operations


def was_interrupted() -> bool:
    """True if the time limit stopped the stages before their budgets were spent."""
    meter = _meter.get(_outside)
    meter.interrupted = meter.interrupted or meter.is_due()
    return meter.interrupted


def charge(count: float) -> None:
    """Charge floating-point operations to the meter."""
    _meter.get(_outside).operations += count


def charge_once(key: Hashable, count: float) -> None:
    """Charge floating-point operations of preparing a cached object, unless charged before.

    A cached object from an earlier identification in this process is charged as well, so that the
    count is repeatable.
    """
    meter = _meter.get(_outside)
    if key not in meter.known:
        meter.known.add(key)
        meter.operations += count


class Budget:
    """Operations that may be spent from now on, within an enclosing budget if there is one."""

    def __init__(self, count: float = np.inf, within: Budget | None = None) -> None:
        self._end = operations() + count
        self._within = within

    @property
    def left(self) -> float:
        """Remaining operations; negative if more were spent."""
        own = self._end - operations()
        return own if self._within is None else min(own, self._within.left)

    @property
    def spent(self) -> bool:
        """True if no operations remain, or the stages were stopped."""
        return self.left < 0.0 or was_interrupted()

    def extend(self, count: float) -> None:
        """Move the end of this budget and of the enclosing ones by some operations."""
        self._end += count
        if self._within is not None:
            self._within.extend(count)
