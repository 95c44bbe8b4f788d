"""Form of a specification: fields of an address, and the view of its answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np

from app.pages.loop_form import LoopForm
from identification.errors import OptionError
from identification.numerals import decimal_of

__all__ = ["FIELDS", "TuningForm", "tuning_view"]

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
_METRICS: Final = tuple(FIELDS)[:6]


@dataclass(frozen=True)
class TuningForm:
    """Fields of the form, as typed."""

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
        known = {} if given else _DEFAULTS
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
                wrong.append(f"{name} {text[:60]!r} is not a number")
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


def tuning_view(found: Mapping[str, Any], remarks: tuple[str, ...]) -> dict[str, Any]:
    """View of the first controller of a tuning: statement, step response and metrics."""
    from identification.reporting.figures.curves import step_figure
    from identification.reporting.figures.drawn import drawn_chart
    from identification.result.attempts import figure
    from identification.result.numbers import listed
    from identification.result.report_data import StepResponse

    entry, step = found["controllers"][0], found["step_rad_s"]
    steps = [
        StepResponse(
            response["temperature_degC"],
            entry["controller"],
            np.array(response["time_s"]),
            *(np.array(response["speed"][name]) / step for name in ("median", "q05", "q95")),
        )
        for response in entry["responses"]
    ]
    rows = [_row(name, entry["temperatures"], found["specification"][name]) for name in _METRICS]
    return {
        "controller": entry["controller"],
        "meets": entry["meets"],
        "probability": f"{100 * entry['probability']:.3g} %",
        "statement": entry["statement"],
        "step": f"{step:g}",
        "draws": found["draws"],
        "figure": figure("step response", lambda: drawn_chart(step_figure(steps))),
        "temperatures": [f"{at['temperature_degC']:g} °C" for at in entry["temperatures"]],
        "rows": rows,
        "effects": listed([name.replace("_", " ") for name in found["effects"]]),
        "remarks": remarks,
    }


def _row(
    name: str, temperatures: Sequence[Mapping[str, Any]], limit: float | None
) -> tuple[str, str, float | None, list[tuple[str, float | None]]]:
    """Label, unit, limit and cells of one metric, with the 90 % interval at each temperature."""
    from identification.result.numbers import UNKNOWN, number_text, unit_prefix

    label, unit = FIELDS[name]
    ends = [(at[name]["q05"], at[name]["q95"]) for at in temperatures]
    factor, unit = unit_prefix(unit, [limit, *(end for pair in ends for end in pair)])
    cells = []
    for at, pair in zip(temperatures, ends, strict=True):
        known = [factor * end for end in pair if end is not None]
        texts = list(dict.fromkeys(number_text(end) for end in known)) if len(known) == 2 else []
        cells.append((" to ".join(texts) or UNKNOWN, at[name].get("met_probability")))
    return label, unit, None if limit is None else factor * limit, cells
