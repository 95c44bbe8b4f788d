"""Implementation of ``motorid tune``: tune or judge controllers, write and show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from app.commands import console
from app.commands.files import draws_of, read_result, write_json
from app.commands.motor import Show, motor_of
from identification.errors import OptionError
from identification.numerals import decimal_of

__all__ = ["temperatures_of", "tune"]

_MOST_DRAWS = 400
_OF_A_RANGE = 5


def tune(
    result: Path | None,
    settings: Sequence[str],
    specification: str,
    temperatures: Sequence[str],
    out: Path | None,
    show: Show,
    *,
    kinds: Sequence[str],
    **options: Any,
) -> None:
    """Tune or judge controllers, write the file and show it.

    The motor is a result or `settings`; `options` are further ones of `identification.tuning.tune`.
    """
    from identification.tuning import KINDS, parse_specification
    from identification.tuning import motor_of as uncertain
    from identification.tuning import tune as tuned

    spec = parse_specification(specification)
    asked = temperatures_of(temperatures)
    if result is not None and not settings:
        content = read_result(result)
        draws, remark = draws_of(content, result, _MOST_DRAWS)
        if remark:
            console.remark(remark)
        motor = uncertain(draws, content)
    else:
        motor = uncertain(motor_of(result, settings))
    found = tuned(motor, spec, temperatures=asked, kinds=kinds or KINDS, **options)
    write_json(out, found, result)
    if show.as_json:
        console.print_json(found)
    elif not show.quiet:
        _print(found)


def temperatures_of(words: Sequence[str]) -> list[float]:
    """Temperatures of numbers and ranges ``LOW:HIGH``, which give five temperatures each [degC].

    Raises:
        OptionError: A word is neither.
    """
    temperatures: list[float] = []
    for word in words:
        try:
            ends = [decimal_of(part) for part in word.split(":")]
        except ValueError:
            ends = []
        if len(ends) not in (1, 2) or ends[0] > ends[-1]:
            raise OptionError(
                f"--temperature {word!r}: expected a temperature or LOW:HIGH in degC, such as "
                "0:120",
                value=word,
            )
        low, high = ends[0], ends[-1]
        count = 1 if low == high else _OF_A_RANGE
        temperatures += [low + k * (high - low) / max(count - 1, 1) for k in range(count)]
    return temperatures


def _print(found: Mapping[str, Any]) -> None:
    output = console.results_console()
    spec = found["specification"]
    required = ", ".join(f"{name} {value:g}" for name, value in spec.items() if value is not None)
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
    """Probability and, for each required metric, its worst quantile over the temperatures."""
    table = console.table_with("Controllers", "controller")
    names = [name for name in found["controllers"][0]["temperatures"][0] if name in _LABELS]
    for label in ("probability", *(_LABELS[name] for name in names)):
        table.add_column(label, justify="right")
    for entry in found["controllers"]:
        cells = []
        for name in names:
            quantities = [at[name] for at in entry["temperatures"]]
            ends = [q[key] for q in quantities for key in ("q05", "q95") if q[key] is not None]
            cells.append(f"{min(ends):.3g} .. {max(ends):.3g} {quantities[0]['unit']}"
                         if ends else "-")  # fmt: skip
        table.add_row(entry["controller"], f"{entry['probability']:.3f}", *cells)
    return table


_LABELS = {
    "rise_time": "rise time",
    "settling_time": "settling time",
    "overshoot": "overshoot",
    "steady_error": "steady error",
    "gain_margin": "gain margin",
    "phase_margin": "phase margin",
    "peak_current": "peak current",
}
