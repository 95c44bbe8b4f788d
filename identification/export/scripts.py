"""Scripts and models in other languages: linear motor with samples, and the motor with effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import casadi as ca
import numpy as np

from identification.arrays import Array, evenly
from identification.export.c_code import TEMPLATES
from identification.export.language import Language, printed
from identification.export.linear import best_values, matrices, polynomials
from identification.export.model import EXTERNAL, Exported
from identification.model.composite import INPUTS
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["SIGNALS", "continuous_notes", "equations", "linear_motors", "script"]

SIGNALS: Final = (
    "voltage", "temperature", "load_torque", "position", "position_given", "temperature_rate",
    "peak_temperature", "time",
)  # fmt: skip
"""Inputs of the continuous equations, in their order."""

_SAMPLES: Final = 100
_HISTORY: Final = {
    "peak_temperature": (
        "the memory of the highest temperature: a loss of magnetisation follows the present one; "
        "set peak_temperature to the highest temperature of the simulation"
    ),
    "temperature_rate": (
        "the slope of the temperature, by which the winding leads the sensor: it is zero unless "
        "temperature_rate is set"
    ),
}
"""Inputs that depend on other instants, and the sentence on each that continuous equations omit."""


def equations(
    motor: Exported, language: Language, names: Sequence[str | Sequence[str]]
) -> tuple[str, str, tuple[str, ...]]:
    """Right-hand sides and sensor readings in a language.

    The names are those of the states, the inputs `SIGNALS` and the parameters.  Return assignments
    to the array `dx`, assignments to the array `y`, and all local variables.
    """
    model = motor.model
    x, _, p = model.symbols()
    s = ca.SX.sym("s", len(SIGNALS))
    column = {name: s[k] for k, name in enumerate(SIGNALS)} | {"angle": s[3]}
    u = ca.vertcat(*[column.get(name.removesuffix("_next"), ca.SX(0)) for name in INPUTS])
    own = p[: p.numel() - len(EXTERNAL)]
    known = ca.vertcat(own, column["load_torque"], column["position_given"])
    rates = ca.Function("rates", [x, s, own], [model.rates(x, u, known)])
    logged = ca.Function("logged", [x, s, own], [model.logged(x, u, known)])
    first, second = (
        printed(function, language, names, [output])
        for function, output in ((rates, "dx"), (logged, "y"))
    )
    return first.text, second.text, tuple(dict.fromkeys((*first.local, *second.local)))


def continuous_notes(motor: Exported, *, delays: bool) -> Iterator[str]:
    """Sentences on what continuous equations, with delays of channels or not, omit of a model."""
    if motor.model.delays and not delays:
        yield "channel_delay is left out, because the equations are continuous"
    terms = (*motor.model.averaged.values(), *motor.model.sample_filters)
    for name in dict.fromkeys(term.name for term in terms):
        yield (f"the filter of samples ({name}) is left out, because the equations are continuous")
    x, u, p = motor.model.symbols()
    rates = motor.model.rates(x, u, p)
    for name, note in _HISTORY.items():
        if ca.depends_on(rates, u[INPUTS.index(name)]):
            yield note


def script(
    template: str,
    motor: Exported,
    language: Language,
    header: list[str],
    linear: Sequence[Mapping[str, Any]] = (),
) -> str:
    """Text of a script or model, with lines about the motor as its header."""
    rates, logged, local = equations(motor, language, ["x", "u", "p"])
    known = {parameter.name: value for parameter, value in motor.parameters}
    start = {"temperature": REFERENCE_TEMPERATURE_DEGC}
    return TEMPLATES.get_template(template).render(
        header=[" ".join(line.split()) for line in header],
        rates=rates,
        logged=logged,
        local=local,
        states=motor.model.state_names,
        starts=motor.starts,
        signals=SIGNALS,
        parameters=motor.parameters,
        peak=motor.peak,
        interval=motor.interval,
        delays={term.channel: known[f"{term.name}.delay"] for term in motor.model.delays},
        linear=linear,
        unknowns=[
            (f"x_{name.replace('.', '_')}", _modelica_unit(unit), start.get(signal, 0.0))
            for name, unit, signal in zip(
                motor.model.state_names, motor.units, motor.starts, strict=True
            )
        ],
        constants=[
            (p.name.replace(".", "_"), _modelica_unit(p.unit), value, p.meaning.replace('"', "'"))
            for p, value in motor.parameters
        ],
    )


def linear_motors(
    result: Mapping[str, Any], draws: Mapping[str, Array], temperatures: Sequence[float]
) -> list[dict[str, Any]]:
    """Numbers of the linear motor at each temperature [degC]: of the best values, then of draws."""
    best = best_values(result)
    return [_linear(best, draws, temperature) for temperature in temperatures]


def _modelica_unit(unit: str) -> str:
    """Unit in the syntax of Modelica: ``N.m`` for N m, ``kg.m2`` for kg m^2."""
    known = {"-": "1", "ohm": "Ohm"}
    return known.get(unit, unit.replace(" ", ".").replace("^", ""))


def _linear(
    values: Mapping[str, float], draws: Mapping[str, Array], temperature: float
) -> dict[str, Any]:
    """Numbers of the linear motor at one temperature: of the best values, then of the samples."""
    kept = evenly(np.asarray(draws["J"]).size, _SAMPLES)
    some = {name: np.asarray(draws[name])[kept] for name in values}
    entry: dict[str, Any] = {"temperature": float(temperature)}
    for name, chosen in (("best", values), ("samples", some)):
        parts = (*polynomials(chosen, temperature), *matrices(chosen, temperature))
        entry[name] = [
            dict(zip(("gain", "denominator", "a", "b"), one, strict=True))
            for one in zip(*(part.tolist() for part in parts), strict=True)
        ]
    return entry
