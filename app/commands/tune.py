"""The command ``motorid tune``: tune or judge speed controllers, write and show them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands import options
from app.commands.arguments import decimal
from identification.errors import OptionError
from identification.numerals import decimal_of

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["tune"]

_MOST_DRAWS = 400
_OF_A_RANGE = 5

_Specification = Annotated[
    str,
    typer.Option(
        metavar="NAME=VALUE,...",
        help="Requirements rise_time, settling_time [s], overshoot, steady_error [%], "
        "phase_margin [deg], gain_margin [dB]; drive voltage [V], current [A], sample_time, "
        "delay [s].",
    ),
]
_Result = Annotated[Path | None, typer.Argument(metavar="[RESULT]", help="result.json of a fit.")]
_Out = Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")]
_Temperatures = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LOW:HIGH|DEGC...", help="Range of temperatures, or single ones.  [default: 25:125]"
    ),
]
_Kinds = Annotated[
    list[str] | None,
    typer.Option(
        "--kind", metavar="KIND...", help="Kinds to tune: P, PI, PI+FF, PID.  [default: all four]"
    ),
]
_Controllers = Annotated[
    list[str] | None,
    typer.Option(
        metavar="C...",
        help="Judge these controllers instead: P:kp, PI:kp,ki, PI+FF:kp,ki,kff, PID:kp,ki,kd.",
    ),
]
_Probability = Annotated[
    float, typer.Option(parser=decimal, metavar="P", help="Probability required of the loop.")
]
_Step = Annotated[
    float | None,
    typer.Option(
        parser=decimal,
        metavar="RAD_S",
        help="Step of the speed reference.  [default: half the speed that the limits allow]",
    ),
]


def tune(
    spec: _Specification,
    result: _Result = None,
    out: _Out = None,
    set: options.Parameters = None,  # noqa: A002  the option's name
    temperature: _Temperatures = None,
    kind: _Kinds = None,
    controller: _Controllers = None,
    probability: _Probability = 0.95,
    step: _Step = None,
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Tune speed controllers to a specification over posterior draws and temperatures.

    Each loop is simulated with the effects found, voltage and current limits, anti-windup, sample
    time and delay.  If the specification cannot be met, the output says by how much.
    """
    from app.commands.console import Output
    from app.commands.files import write_json
    from app.commands.motor import motor_of
    from identification import tuning

    required = tuning.parse_specification(spec)
    temperatures = _temperatures_of(temperature or ["25:125"])
    motor = tuning.motor_of(*motor_of(result, set or [], _MOST_DRAWS))
    found = tuning.tune(
        motor,
        required,
        temperatures=temperatures,
        kinds=[one.upper() for one in kind or tuning.KINDS],
        controllers=controller or [],
        probability=probability,
        step=step,
    )
    write_json(out, found, result)
    Output(json, quiet).show(found, lambda: _print(found))


def _temperatures_of(words: Sequence[str]) -> list[float]:
    """Temperatures of numbers and ranges ``LOW:HIGH``, which give five temperatures each [degC]."""
    temperatures: list[float] = []
    for word in words:
        try:
            ends = [decimal_of(part) for part in word.split(":")]
        except ValueError:
            ends = []
        if len(ends) not in (1, 2) or ends[0] > ends[-1]:
            raise OptionError(
                f"--temperature {word!r}: expected a temperature or LOW:HIGH in degC, such as 0:120"
            )
        low, high = ends[0], ends[-1]
        count = 1 if low == high else _OF_A_RANGE
        temperatures += [low + k * (high - low) / max(count - 1, 1) for k in range(count)]
    return temperatures


def _print(found: Mapping[str, Any]) -> None:
    from app.commands import console
    from identification.tuning import UNITS

    output = console.results_console()
    spec = found["specification"]
    required = ", ".join(
        f"{name} {value:g} {UNITS[name]}" for name, value in spec.items() if value is not None
    )
    temperatures = found["temperature_degC"]
    span = " to ".join(f"{t:g}" for t in sorted({temperatures[0], temperatures[-1]}))
    output.print(f"Specification: {required}", soft_wrap=True)
    output.print(f"Step of {found['step_rad_s']:g} rad/s at {span} °C, {found['draws']} draws")
    if found["effects"]:
        output.print(f"Effects in the loop: {', '.join(found['effects'])}", soft_wrap=True)
    if found["omitted_effects"]:
        names = ", ".join(found["omitted_effects"])
        output.print(f"Effects that do not act in the loop: {names}", soft_wrap=True)
    output.print(_table(found))
    for entry in found["controllers"]:
        output.print(f"{entry['statement']}.", soft_wrap=True)
    if found["recommended"]:
        output.print(f"Recommended: {found['recommended']}", style="bold")


def _table(found: Mapping[str, Any]) -> Table:
    """Probability and range of each metric over the temperatures, a column for each controller."""
    from app.commands.console import table_with
    from identification.result.numbers import unit_prefix, unit_text
    from identification.tuning import METRICS

    entries = found["controllers"]
    table = table_with("Controllers", "metric", right=[entry["controller"] for entry in entries])
    table.add_row("probability", *(f"{entry['probability']:.3f}" for entry in entries))
    for name in (*METRICS, "peak_current"):
        quantities = [[at[name] for at in entry["temperatures"]] for entry in entries]
        ranges = [
            [q[k] for q in of for k in ("q05", "q95") if q[k] is not None] for of in quantities
        ]
        factor, unit = unit_prefix(quantities[0][0]["unit"], itertools.chain(*ranges))
        label = f"{name.replace('_', ' ')} [{unit_text(unit)}]"
        table.add_row(label, *(_range(factor, ends) for ends in ranges))
    return table


def _range(factor: float, ends: Sequence[float]) -> str:
    """Smallest and largest value of a metric."""
    from identification.result.numbers import UNKNOWN, number_text

    if not ends:
        return UNKNOWN
    return " .. ".join(number_text(factor * end, 3) for end in (min(ends), max(ends)))
