"""Typer types of the options and arguments that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands.arguments import decimal, whole

__all__ = [
    "AsJson",
    "Controllers",
    "DataDir",
    "Effort",
    "Force",
    "Known",
    "MapWords",
    "MappingFile",
    "NoEffects",
    "NoPosterior",
    "OutDir",
    "Parameters",
    "Plate",
    "Quiet",
    "ResultFile",
    "Seed",
    "SetAside",
    "Temperatures",
    "TimeLimit",
]

OutDir = Annotated[Path, typer.Option(metavar="DIR", help="Output directory.")]
ResultFile = Annotated[Path, typer.Argument(metavar="RESULT", help="result.json of a fit.")]
MappingFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="JSON file that assigns columns to channels.")
]
MapWords = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[FILE:]CHANNEL=HEADER",
        help="Column of one channel, such as 'current_A=CH2 * 2.5 + 0.1 in mA', in all files or in "
        "one, such as 'run3.csv:current_A=CH2 * -1'; may be repeated.",
    ),
]
Temperatures = Annotated[
    list[float] | None,
    typer.Option(
        parser=decimal,
        metavar="DEGC...",
        help="Temperatures of the speed loop metrics.  [default: 25 125]",
    ),
]
Controllers = Annotated[
    list[str] | None,
    typer.Option(
        metavar="C...",
        help="Controllers of the speed loop: P:kp, PI:kp,ki, PI+FF:kp,ki,kff or PID:kp,ki,kd.  "
        "[default: P:1]",
    ),
]
Seed = Annotated[
    int,
    typer.Option(
        parser=whole,
        metavar="<int>",
        help="Seed of the random numbers; equal seeds give equal results.",
    ),
]
Effort = Annotated[
    str,
    typer.Option(
        metavar="LEVEL",
        help="Limit on the number of operations: quick, normal or thorough; the result does not "
        "depend on the machine.",
    ),
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        parser=decimal,
        metavar="SECONDS",
        help="Stop after this time with the best model found; the result then depends on the "
        "machine.",
    ),
]
NoPosterior = Annotated[
    bool,
    typer.Option(
        "--no-posterior",
        help="Compute the intervals from the fit's covariance and write no posterior.nc.",
    ),
]
NoEffects = Annotated[
    bool,
    typer.Option("--no-effects", help="Fit only the nominal model; do not search for effects."),
]
SetAside = Annotated[
    bool,
    typer.Option(
        "--set-aside",
        help="Exclude runs that contradict the motor equations or the other runs, and report them.",
    ),
]
Force = Annotated[
    bool, typer.Option("--force", help="Fit in spite of contradictory runs, and mark the result.")
]
Known = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE[+-SD|+-N%]...",
        help="Known value of a parameter with its standard deviation, in SI units, such as "
        "Kt25=0.048+-5%; default standard deviation: 1 %.",
    ),
]
Plate = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY=VALUE,...",
        help="Nameplate data, in SI units or with the unit V, mV, A, mA, rpm, Nm or mNm appended: "
        "voltage, no_load_speed, no_load_current, stall_current, stall_torque, rated_speed, "
        "rated_current, rated_torque.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print a summary as JSON on standard output.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors.")]
DataDir = Annotated[
    Path | None,
    typer.Option(help="Directory of the database, the runs and the results of the service."),
]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE...", help="Parameter values in SI units, instead of a result."
    ),
]
