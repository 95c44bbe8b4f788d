"""Speed controllers: P, PI, PI+FF and PID, the class that others extend, and the parser.

A controller maps the reference r and the speed w to the motor's voltage v,

    v = (Nr(s) r - N(s) w) / D(s),          Nr = N for a controller of the speed error r - w

P, PI and PID control the error in the ideal parallel form

    C(s) = kp + ki / s + kd s          kp [V s/rad], ki [V/rad], kd [V s^2/rad]

PI+FF adds the static feed-forward kff r [V s/rad] of the reference to PI.

The derivative acts on the error and has no filter.  It needs none: the motor has two poles and no
zero from voltage to speed, so C(s) w/v is strictly proper, and every response and margin of the
speed is finite.  Only the voltage has an impulse at a step of the reference, and no result reports
the voltage.  docs/write-a-controller.md shows how to add another controller.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.errors import OptionError
from identification.numerals import decimal_of

__all__ = [
    "ACCEPTED_CONTROLLERS",
    "KINDS",
    "PID",
    "AbstractController",
    "TransferFunction",
    "parse_controller",
    "parse_controllers",
]

ACCEPTED_CONTROLLERS: Final = (
    "P:kp, PI:kp,ki, PI+FF:kp,ki,kff or PID:kp,ki,kd, such as P:1 or PI:2,0.5"
)

_LONGEST_SHOWN: Final = 60

Coefficients = tuple[float, ...]


@dataclass(frozen=True)
class TransferFunction:
    """Controller v = (Nr(s) r - N(s) w) / D(s), by coefficients of falling powers of s.

    Raises:
        OptionError: A coefficient is not finite, D begins with 0, or a numerator has a degree above
            that of D plus 1.
    """

    numerator: Coefficients
    """N; the coefficient of s^k has the unit V s/rad s^k."""
    denominator: Coefficients = (1.0,)
    """D; the coefficient of s^k has the unit s^k."""
    reference: Coefficients | None = None
    """Nr, like `numerator`; None if the controller acts on the error r - w."""

    def __post_init__(self) -> None:
        if not np.isfinite([*self.numerator, *self.denominator, *(self.reference or ())]).all():
            raise OptionError(f"{self} has a coefficient that is not finite")
        if not self.denominator or self.denominator[0] == 0.0:
            raise OptionError(f"{self} has a denominator that begins with 0; leave that power out")
        if max(len(self.numerator), len(self.reference or ())) > len(self.denominator) + 1:
            raise OptionError(f"{self} differentiates more than once; expected at most degree 1")

    def padded(self) -> tuple[Array, Array, Array]:
        """N and Nr with one leading coefficient more than D, (n + 2,), and D, (n + 1,), monic."""
        size = len(self.denominator) + 1
        reference = self.numerator if self.reference is None else self.reference
        rows = [
            np.pad(np.array(row) / self.denominator[0], (size - len(row), 0))
            for row in (self.numerator, reference)
        ]
        return rows[0], rows[1], np.array(self.denominator) / self.denominator[0]


class AbstractController(ABC):
    """Linear controller of the speed.

    A member is a frozen dataclass whose fields are its gains.
    """

    text: str
    """Specification as the user wrote it; it names the controller in the result."""

    @abstractmethod
    def transfer_function(self) -> TransferFunction:
        """Transfer function without common roots of numerator and denominator."""


@dataclass(frozen=True)
class PID(AbstractController):
    """PID controller with static feed-forward of the reference; gains that a kind lacks are 0."""

    text: str
    kp: float = 0.0
    """Proportional gain [V s/rad]."""
    ki: float = 0.0
    """Integral gain [V/rad]."""
    kd: float = 0.0
    """Derivative gain [V s^2/rad]."""
    kff: float = 0.0
    """Feed-forward gain [V s/rad]."""

    def transfer_function(self) -> TransferFunction:
        """Feedback kp + ki / s + kd s, and kff from the reference alone."""
        # Without integral gain the pole of the integrator would cancel.
        rest, denominator = ((self.ki,), (1.0, 0.0)) if self.ki else ((), (1.0,))
        reference = (self.kd, self.kp + self.kff, *rest)
        return TransferFunction((self.kd, self.kp, *rest), denominator, reference)


KINDS: Final = {
    "P": ("kp",),
    "PI": ("kp", "ki"),
    "PI+FF": ("kp", "ki", "kff"),
    "PID": ("kp", "ki", "kd"),
}
"""Gains of each kind of controller that has a text, in its order."""


def parse_controller(text: str) -> AbstractController:
    """Parse a controller specification such as ``PI:2,0.5``.

    Negative gains are accepted; an unstable loop is reported as such.

    Args:
        text: Controller type, colon and gains; blanks and the case of the type are ignored.

    Raises:
        OptionError: The controller type is unknown, the number of gains is wrong, a gain is not a
            finite number of at most 1e12 in magnitude, or all gains are zero.
    """
    kind, colon, rest = text.partition(":")
    kind = kind.strip().upper()
    if not colon or kind not in KINDS:
        raise _refused(text, "is of unknown type")
    cells = [cell.strip() for cell in rest.split(",")]
    if len(cells) != len(KINDS[kind]):
        few = "1 gain" if len(cells) == 1 else f"{len(cells)} gains"
        raise _refused(text, f"has {few}; {kind} requires {len(KINDS[kind])}")
    gains = [_gain(text, cell) for cell in cells]
    if not any(gains):
        raise _refused(text, "has only zero gains")
    return PID(text.strip(), **dict(zip(KINDS[kind], gains, strict=True)))


def parse_controllers(controllers: Iterable[str | AbstractController]) -> list[AbstractController]:
    """Parse each text by `parse_controller`; controllers pass unchanged.

    Raises:
        OptionError: There is none, or one is not accepted.
    """
    parsed = [parse_controller(one) if isinstance(one, str) else one for one in controllers]
    if not parsed:
        raise OptionError(f"no controller given; expected {ACCEPTED_CONTROLLERS}")
    return parsed


def _gain(text: str, cell: str) -> float:
    try:
        gain = decimal_of(cell)
    except ValueError:
        raise _refused(text, f"has the gain {_shown(cell)}, which is not a number") from None
    # Larger gains overflow the closed-loop poles, and no amplifier comes near this limit.
    if not math.isfinite(gain) or abs(gain) > 1e12:
        raise _refused(
            text,
            f"has the gain {_shown(cell)}; a gain must be finite and at most 1e12 in magnitude",
        )
    return gain


def _refused(text: str, reason: str) -> OptionError:
    return OptionError(
        f"controller {_shown(text)} {reason}; expected {ACCEPTED_CONTROLLERS}", value=text
    )


def _shown(text: str) -> str:
    cut = text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."
    return repr(cut)
