"""Command ``motorid design``: write the voltage of the next run and its expected gain."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.arguments import decimal

__all__ = ["design"]

_Out = Annotated[
    Path, typer.Option(metavar="FILE", help="CSV file to write; FILE.json describes it.")
]
_Result = Annotated[Path | None, typer.Argument(metavar="RESULT", help="result.json of a fit.")]
_Plate = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=VALUE...",
        help="Nameplate of a motor without runs, in place of RESULT: voltage, no_load_speed, "
        "no_load_current, stall_current, rated_speed, rated_current; SI units, or append rpm, mA.",
    ),
]
_Narrow = Annotated[
    str | None,
    typer.Option(
        metavar="QUANTITY",
        help="Quantity to narrow: a parameter such as Ra25, or a metric of the speed loop such as "
        "rise_time_s@125.  [default: all parameters]",
    ),
]
_Limits = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE...",
        help="Largest voltage [V], current [A], speed [rad/s], slew [V/s], position [rad], "
        "and load torque [N m] of the bench.  "
        "[default: largest voltage, current and speed of the earlier runs, no load]",
    ),
]
_Duration = Annotated[
    float | None,
    typer.Option(
        parser=decimal, metavar="SECONDS", help="Duration.  [default: as the earlier runs]"
    ),
]
_Rate = Annotated[
    float | None,
    typer.Option(parser=decimal, metavar="HZ", help="Sample rate.  [default: as the earlier runs]"),
]
_Temperatures = Annotated[
    list[float] | None,
    typer.Option(
        parser=decimal,
        metavar="DEGC...",
        help="Temperatures that the bench can hold; the best one is proposed.  [default: the "
        "lowest and the highest of the earlier runs]",
    ),
]


def design(
    out: _Out,
    result: _Result = None,
    nameplate: _Plate = None,
    narrow: _Narrow = None,
    limit: _Limits = None,
    duration: _Duration = None,
    rate: _Rate = None,
    temperature: _Temperatures = None,
    seed: options.Seed = 0,
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Design the next run: the voltage that separates alternatives and narrows parameters.

    Writes columns time_s,voltage_V,temperature_degC with one row per sample, which end at zero
    voltage, and FILE.json with the expected gain.  Every draw of the parameters holds the limits.
    """
    # Imported here: other commands need none of these.
    from app.commands import console
    from app.commands.files import read_result, writable_file
    from identification.design import (
        DesignOptions,
        profile_csv,
        proposal_entry,
        propose,
        task_of_nameplate,
        task_of_result,
    )
    from identification.errors import OptionError
    from identification.result.atomic import write_text
    from identification.result.entries import result_text

    chosen = DesignOptions(
        tuple(limit or ()), duration, rate, tuple(temperature or ()), narrow or "", seed
    )
    if (result is None) == (not nameplate):
        raise OptionError(
            "expected either the result.json of a fit, or --nameplate KEY=VALUE,... of a motor "
            "without runs"
        )
    about = Path(f"{out}.json")
    inputs = () if result is None else (result, result.parent)
    with writable_file(out, inputs=inputs), writable_file(about, inputs=inputs):
        if result is None:
            task = task_of_nameplate(",".join(nameplate or ()), chosen)
        else:
            task = task_of_result(read_result(result), chosen)
        proposal = propose(task)
        entry = proposal_entry(proposal)
        write_text(out, profile_csv(proposal))
        write_text(about, result_text(entry))
    lines = "\n".join(map(str, (*entry["summary"], out, about)))
    console.Output(json, quiet).show(
        entry, lambda: console.results_console().print(lines, soft_wrap=True)
    )
