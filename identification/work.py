"""Count of floating-point operations, the measure of cost by which every stage is bounded.

A limit in seconds makes an answer depend on how busy the machine is.  Here the numerical kernels
charge what they compute to a meter, and a stage stops where its share of operations is spent, so
that equal input and equal versions give equal results on any load and with any number of threads.

    with metered():
        budget = Budget(2e10)
        while not budget.spent: ...

Only a user who sets a time limit brings in a clock: `metered` then asks it whether to stop, every
budget is spent from that moment on, and `was_interrupted` says so.

The count is an estimate: rows times lanes times operations of a simulated step, the products of the
normal equations, and a fixed charge for each structure that is compiled.  It has to grow as the
time does and to be repeatable, not to be exact.
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


def _never() -> bool:
    return False


@dataclass
class _Meter:
    is_due: Callable[[], bool] = _never
    operations: float = 0.0
    known: set[Hashable] = field(default_factory=set)
    interrupted: bool = False


_meter: ContextVar[_Meter] = ContextVar("meter")
_outside = _Meter()


@contextmanager
def metered(is_due: Callable[[], bool] | None = None) -> Iterator[None]:
    """A meter that starts at zero and knows no compiled structure, for one identification.

    Args:
        is_due: Asked between the steps of the stages whether to stop; never where None.
    """
    token = _meter.set(_Meter(is_due or _never))
    try:
        yield
    finally:
        _meter.reset(token)


def operations() -> float:
    """Operations charged so far."""
    return _meter.get(_outside).operations


def was_interrupted() -> bool:
    """Whether the stages were told to stop before their budgets were spent."""
    meter = _meter.get(_outside)
    meter.interrupted = meter.interrupted or meter.is_due()
    return meter.interrupted


def charge(count: float) -> None:
    """Charge operations that are computed.

    Args:
        count: Number of floating-point operations.
    """
    _meter.get(_outside).operations += count


def charge_once(key: Hashable, count: float) -> None:
    """Charge the preparation of something that is kept; nothing where it was charged before.

    Whether it really was kept, from an earlier identification in this process, makes no
    difference to the count.

    Args:
        key: What is prepared.
        count: Number of floating-point operations that take as long.
    """
    meter = _meter.get(_outside)
    if key not in meter.known:
        meter.known.add(key)
        meter.operations += count


class Budget:
    """A number of operations that may be spent from now on.

    Args:
        count: Operations; infinite for no limit.
        within: A budget that ends this one too.
    """

    def __init__(self, count: float = np.inf, within: Budget | None = None) -> None:
        self._end = operations() + count
        if within is not None:
            self._end = min(self._end, within._end)

    @property
    def left(self) -> float:
        """Operations that are left; negative where more were spent."""
        return self._end - operations()

    @property
    def spent(self) -> bool:
        """Whether nothing is left, or the stages were told to stop."""
        return self.left < 0.0 or was_interrupted()

    def longer(self, count: float) -> Budget:
        """A budget that starts now and has more operations left than this one.

        Args:
            count: Operations on top.
        """
        return Budget(self.left + count)
