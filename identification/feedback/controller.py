"""Controller specifications ``P:kp``, ``PI:kp,ki`` and ``PID:kp,ki,kd``, and their parser.

The controller maps the speed error to the motor's voltage, in the ideal parallel form

    C(s) = kp + ki / s + kd s          kp [V s/rad], ki [V/rad], kd [V s^2/rad]

The derivative acts on the error and has no filter.  It needs none: the motor has two poles and no
zero from voltage to speed, so C(s) w/v is strictly proper, and every response and margin of the
speed is finite.  Only the voltage has an impulse at a step of the reference, and no result reports
the voltage.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from identification.errors import OptionError
from identification.numerals import decimal_of

__all__ = ["ACCEPTED_CONTROLLERS", "Controller", "parse_controller", "parse_controllers"]

ACCEPTED_CONTROLLERS: Final = "P:kp, PI:kp,ki or PID:kp,ki,kd, such as P:1 or PI:2,0.5"

_GAINS: Final = {"P": 1, "PI": 2, "PID": 3}
_LONGEST_SHOWN: Final = 60


@dataclass(frozen=True)
class Controller:
    """Linear controller of the speed error.

    Args:
        text: Specification as the user wrote it.
        proportional: Gain kp [V s/rad].
        integral: Gain ki [V/rad].
        derivative: Gain kd [V s^2/rad].
    """

    text: str
    proportional: float
    integral: float = 0.0
    derivative: float = 0.0


def parse_controller(text: str) -> Controller:
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
    if not colon or kind not in _GAINS:
        raise _refused(text, "is of unknown type")
    cells = [cell.strip() for cell in rest.split(",")]
    if len(cells) != _GAINS[kind]:
        few = "1 gain" if len(cells) == 1 else f"{len(cells)} gains"
        raise _refused(text, f"has {few}; {kind} requires {_GAINS[kind]}")
    gains = [_gain(text, cell) for cell in cells]
    if not any(gains):
        raise _refused(text, "has only zero gains")
    return Controller(text.strip(), *gains)


def parse_controllers(texts: Iterable[str]) -> list[Controller]:
    """Parse each text by `parse_controller`.

    Args:
        texts: At least one specification.

    Raises:
        OptionError: There is none, or one is not accepted.
    """
    controllers = [parse_controller(text) for text in texts]
    if not controllers:
        raise OptionError(f"no controller given; expected {ACCEPTED_CONTROLLERS}")
    return controllers


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
