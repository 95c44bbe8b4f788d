"""Forms of the pages: fields of an address or a body, as typed, and the options that they give."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

from fastapi import Request
from pydantic import BaseModel, Field

from app.errors import FieldRefused
from app.texts import parts
from identification.errors import OptionError
from identification.numerals import decimal_of

__all__ = ["FIELDS", "DesignForm", "LoopForm", "PredictionForm", "TuningForm", "number", "texts_of"]

_MOST_TEMPERATURES: Final = 5
_GAINS: Final = {"P": ("kp",), "PI": ("kp", "ki"), "PID": ("kp", "ki", "kd")}
_LONGEST: Final = 200

FIELDS: Final = {
    "rise_time": ("Rise time", "s"),
    "settling_time": ("Settling time", "s"),
    "overshoot": ("Overshoot", "%"),
    "steady_error": ("Steady error", "%"),
    "phase_margin": ("Phase margin", "deg"),
    "gain_margin": ("Gain margin", "dB"),
    "voltage": ("Voltage limit", "V"),
    "current": ("Current limit", "A"),
    "sample_time": ("Sample time", "s"),
    "delay": ("Delay", "s"),
}
"""Label and unit of each number of a specification."""

_DEFAULTS: Final = {"overshoot": "10", "phase_margin": "45", "sample_time": "0.001"}


async def texts_of(request: Request) -> dict[str, str]:
    """Texts of a form in the body of a request, by name."""
    async with request.form(max_files=0, max_fields=1_000) as form:
        return {name: value for name, value in form.items() if isinstance(value, str)}


def number(field: str, text: str, default: float | None = None) -> float:
    """Number in a field of a form; the default, if there is one, in place of an empty text.

    Raises:
        FieldRefused: The text is not a finite number.
    """
    if default is not None and not text.strip():
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FieldRefused(f"{field}: {text[:40]!r} is not a number{_in_points(text)}", field)
    return value


def _in_points(text: str) -> str:
    """Hint at the decimal point if the text has a decimal comma."""
    changed = text.strip().replace(",", ".")
    is_number = re.fullmatch(r"[-+]?\d{1,15}\.\d{1,15}", changed) and "," in text
    return f"; write {changed}" if is_number else ""


@dataclass(frozen=True)
class LoopForm:
    """Fields of the speed loop."""

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
        controller = str(feedback[0]["controller"]) if feedback else "P:1"
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
            "temperature": ", ".join([*asked][:_MOST_TEMPERATURES] or ["25", "125"]),
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
        if len(given) > _MOST_TEMPERATURES:
            raise OptionError(f"{len(given)} temperatures; expected at most {_MOST_TEMPERATURES}")
        try:
            return [float(part) for part in given]
        except ValueError:
            raise OptionError(
                f"temperatures {self.temperature[:60]!r} are not numbers; expected degC separated "
                "by commas, for example 25, 80"
            ) from None


@dataclass(frozen=True)
class TuningForm:
    """Fields of a specification of the speed loop."""

    values: Mapping[str, str]
    """Text of each of `FIELDS`; empty for no requirement or limit."""
    kind: str
    """``P``, ``PI``, ``PI+FF`` or ``PID``."""
    controller: str
    """Controller to judge instead; empty to tune one."""
    probability: str
    """Required fraction of the draws [-]."""
    temperature: str
    """Temperatures [degC], separated by commas."""

    @classmethod
    def of(cls, given: Mapping[str, str], result: Mapping[str, Any]) -> Self:
        """Build the form from the query of an address; without a query, with defaults."""
        known = {} if given else _DEFAULTS | {"rise_time": _rise_time(result)}
        return cls(
            values={name: given.get(name, known.get(name, "")).strip() for name in FIELDS},
            kind=given.get("kind", "PI").strip(),
            controller=given.get("controller", "").strip(),
            probability=given.get("probability", "0.95").strip(),
            temperature=LoopForm.of(given, result).temperature,
        )

    def options(self) -> dict[str, Any]:
        """Arguments of the service.

        Raises:
            OptionError: Fields are not numbers, or temperatures are not accepted.
        """
        numbers, wrong = {}, []
        for name, text in {**self.values, "probability": self.probability}.items():
            try:
                if text:
                    numbers[name] = decimal_of(text)
            except ValueError:
                wrong.append(
                    f"{name.replace('_', ' ')} {text[:60]!r} is not a number{_in_points(text)}"
                )
        if wrong:
            raise OptionError("; ".join(wrong))
        probability = numbers.pop("probability", 0.95)
        return {
            "specification": numbers,
            "kinds": (self.kind,),
            "controllers": (self.controller,) if self.controller else (),
            "temperatures": LoopForm("P", "1", "0", "0", self.temperature).temperatures,
            "probability": probability,
        }


def _rise_time(result: Mapping[str, Any]) -> str:
    """Twice the rise time of the PI controller of the report [s].

    Without a requirement on the speed of the loop, any slow controller meets the others.
    """
    times = [entry["rise_time_s"]["median"] for entry in result.get("feedback_suited") or ()]
    known = [time for time in times if time is not None]
    return f"{2.0 * max(known):.2g}" if known else ""


class PredictionForm(BaseModel):
    """Run to predict, selected from a list."""

    run: str = Field(default="", max_length=60)
    """ID of the run."""
    declared: bool = False
    """Simulate the nominal model instead of the final one."""
    after: str = Field(default="", max_length=200)
    """Cursor of a list of older runs, from which nothing is predicted yet."""


@dataclass(frozen=True)
class DesignForm:
    """Fields of the next run."""

    narrow: str = ""
    """Quantity to narrow; empty for all parameters."""
    limits: str = ""
    """Limits, ``NAME=VALUE,...``."""
    temperature: str = ""
    """Temperatures [degC], separated by commas or blanks."""
    duration: str = ""
    """Duration [s]."""
    rate: str = ""
    """Sample rate [Hz]."""

    @classmethod
    def of(cls, given: Mapping[str, str]) -> Self:
        """Build the form from the query of an address."""
        names = cls.__dataclass_fields__
        return cls(**{k: given[k].strip()[:_LONGEST] for k in names if k in given})

    @property
    def options(self) -> dict[str, Any]:
        """Fields of `DesignOptions`; a field that is not a number is refused."""
        return {
            "limits": (self.limits,) if self.limits else (),
            "duration": number("duration", self.duration) if self.duration else None,
            "rate": number("rate", self.rate) if self.rate else None,
            "temperatures": tuple(number("temperature", one) for one in parts(self.temperature)),
            "narrow": self.narrow,
        }
