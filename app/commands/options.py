"""Typer types of the options and arguments that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands.arguments import decimal, whole

__all__ = [
    "ApiKey",
    "AsJson",
    "BenchName",
    "Controllers",
    "DataDir",
    "DesignLimits",
    "DesignPlate",
    "DesignTemperatures",
    "Duration",
    "Effort",
    "Force",
    "Hold",
    "Known",
    "MapWords",
    "MappingFile",
    "Narrow",
    "MotorName",
    "NoEffects",
    "NoPosterior",
    "OptionalResult",
    "OutDir",
    "Parameters",
    "Plate",
    "ProfileOut",
    "Quiet",
    "Rate",
    "Result",
    "ResultFile",
    "Runs",
    "Seed",
    "SetAside",
    "Temperatures",
    "TimeLimit",
    "Validation",
]

Runs = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Files of the training runs.")]
OutDir = Annotated[Path, typer.Option(metavar="DIR", help="Output directory.")]
ResultFile = Annotated[Path, typer.Argument(metavar="RESULT", help="result.json of a fit.")]
OptionalResult = Annotated[
    Path | None, typer.Argument(metavar="RESULT", help="result.json of a fit.")
]
ProfileOut = Annotated[
    Path, typer.Option(metavar="FILE", help="CSV file to write; FILE.json describes it.")
]
DesignPlate = Annotated[
    list[str] | None,
    typer.Option(
        "--nameplate",
        metavar="KEY=VALUE...",
        help="Nameplate of a motor without runs, in place of RESULT: voltage, no_load_speed, "
        "no_load_current, stall_current, rated_speed, rated_current; SI units, or append rpm, mA.",
    ),
]
Narrow = Annotated[
    str | None,
    typer.Option(
        metavar="QUANTITY",
        help="Quantity to narrow: a parameter such as Ra25, or a metric of the speed loop such as "
        "rise_time_s@125.  [default: all parameters]",
    ),
]
DesignLimits = Annotated[
    list[str] | None,
    typer.Option(
        "--limit",
        metavar="NAME=VALUE...",
        help="Largest voltage [V], current [A], speed [rad/s], slew [V/s], position [rad], "
        "and load torque [N m] of the bench.  "
        "[default: largest voltage, current and speed of the earlier runs, no load]",
    ),
]
Duration = Annotated[
    float | None,
    typer.Option(
        parser=decimal, metavar="SECONDS", help="Duration.  [default: as the earlier runs]"
    ),
]
Rate = Annotated[
    float | None,
    typer.Option(parser=decimal, metavar="HZ", help="Sample rate.  [default: as the earlier runs]"),
]
DesignTemperatures = Annotated[
    list[float] | None,
    typer.Option(
        "--temperature",
        parser=decimal,
        metavar="DEGC...",
        help="Temperatures that the bench can hold; the best one is proposed.  [default: the "
        "lowest and the highest of the earlier runs]",
    ),
]
Validation = Annotated[
    list[Path] | None,
    typer.Option(metavar="RUN...", help="Files of the validation runs, which are not fitted."),
]
MappingFile = Annotated[
    Path | None,
    typer.Option("--mapping", metavar="FILE", help="JSON file that assigns columns to channels."),
]
MapWords = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="[FILE:]CHANNEL=HEADER",
        help="Column of one channel, such as 'current_A=CH2 * 2.5 + 0.1 in mA', in all files or in "
        "one, such as 'run3.csv:current_A=CH2 * -1'; may be repeated.",
    ),
]
Temperatures = Annotated[
    list[float] | None,
    typer.Option(
        "--temperature",
        parser=decimal,
        metavar="DEGC...",
        help="Temperatures of the speed loop metrics.  [default: 25 125]",
    ),
]
Controllers = Annotated[
    list[str] | None,
    typer.Option(
        "--controller",
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
MotorName = Annotated[
    str,
    typer.Option("--motor", metavar="NAME", help="Name of the motor, for report and result."),
]
BenchName = Annotated[
    str,
    typer.Option("--bench", metavar="NAME", help="Name of the test bench, for report and result."),
]
Known = Annotated[
    list[str] | None,
    typer.Option(
        "--known",
        metavar="NAME=VALUE[+-SD|+-N%]...",
        help="Known value of a parameter with its standard deviation, in SI units, such as "
        "Kt25=0.048+-5%; default standard deviation: 1 %.",
    ),
]
Plate = Annotated[
    list[str] | None,
    typer.Option(
        "--nameplate",
        metavar="KEY=VALUE,...",
        help="Nameplate data, in SI units or with the unit V, mV, A, mA, rpm, Nm or mNm appended: "
        "voltage, no_load_speed, no_load_current, stall_current, stall_torque, rated_speed, "
        "rated_current, rated_torque.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print a summary as JSON on standard output.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors.")]
ApiKey = Annotated[
    str | None,
    typer.Option(
        metavar="KEY",
        envvar="MOTORID_KEY",
        show_envvar=False,
        help="API key of the service.  The variable MOTORID_KEY keeps it out of process lists.",
    ),
]
DataDir = Annotated[
    Path | None,
    typer.Option(help="Directory of the database, the runs and the results of the service."),
]
Hold = Annotated[
    str, typer.Option(help="Inter-sample behaviour of the voltage: auto (estimated), zoh or foh.")
]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE...", help="Parameter values in SI units, instead of a result."
    ),
]
Result = Annotated[
    Path | None,
    typer.Option(
        metavar="RESULT",
        help="result.json of a fit; posterior.nc in the same directory is used if present.",
    ),
]
