"""Form of the speed loop: controller, gains and temperatures as texts of an address."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from app.texts import parts
from identification.errors import OptionError

__all__ = ["MOST_TEMPERATURES", "LoopForm"]

MOST_TEMPERATURES = 5

_GAINS = {"P": ("kp",), "PI": ("kp", "ki"), "PID": ("kp", "ki", "kd")}
_DEFAULT = "P:1"


@dataclass(frozen=True)
class LoopForm:
    """Fields of the form, as typed."""

    kind: str
    """``P``, ``PI`` or ``PID``."""
    kp: str
    """Proportional gain [V s/rad]."""
    ki: str
    """Integral gain [V/rad]."""
    kd: str
    """Derivative gain [V s^2/rad]."""
    temperature: str
    """Temperatures [degC], separated by commas, semicolons or blanks."""

    @classmethod
    def of(cls, given: Mapping[str, str], result: Mapping[str, Any]) -> Self:
        """Build the form from the query of an address; a missing field has the value of the fit."""
        feedback = result.get("feedback") or ()
        controller = str(feedback[0]["controller"]) if feedback else _DEFAULT
        kind, _, gains = controller.partition(":")
        kind = kind.strip().upper()
        if kind not in _GAINS:
            kind, gains = "P", "1"
        values = dict(zip(_GAINS[kind], (gain.strip() for gain in gains.split(",")), strict=False))
        asked = dict.fromkeys(f"{entry['temperature_degC']:g}" for entry in feedback)
        known = {
            "kind": kind,
            "kp": "1",
            "ki": "10",
            "kd": "0",
            **values,
            "temperature": ", ".join([*asked][:MOST_TEMPERATURES] or ["25", "125"]),
        }
        return cls(**{name: given.get(name, value).strip() for name, value in known.items()})

    @property
    def controller(self) -> str:
        """The controller as the command line takes it, such as ``PI:2,0.5``."""
        gains = [str(getattr(self, name)) for name in _GAINS.get(self.kind, ("kp",))]
        return f"{self.kind}:{','.join(gains)}"

    @property
    def temperatures(self) -> list[float]:
        """Temperatures [degC], each once.

        Raises:
            OptionError: A part is not a number, or there are too many.
        """
        given = list(dict.fromkeys(parts(self.temperature)))
        if len(given) > MOST_TEMPERATURES:
            raise OptionError(
                f"{len(given)} temperatures; expected at most {MOST_TEMPERATURES}",
                value=self.temperature,
            )
        try:
            return [float(part) for part in given]
        except ValueError:
            raise OptionError(
                f"temperatures {self.temperature[:60]!r} are not numbers; expected degC separated "
                "by commas, for example 25, 80",
                value=self.temperature,
            ) from None
