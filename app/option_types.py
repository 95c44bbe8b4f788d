"""Typer types of the options and arguments that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.arguments import decimal, whole

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
    "Plate",
    "Quiet",
    "Runs",
    "Seed",
    "SetAside",
    "Temperatures",
    "TimeLimit",
]

Runs = Annotated[
    list[Path], typer.Argument(metavar="RUN...", help="Run files, as they were recorded.")
]
MappingFile = Annotated[
    Path | None,
    typer.Option("--mapping", metavar="FILE", help="JSON file: which column is which channel."),
]
MapWords = Annotated[
    list[str] | None,
    typer.Option(
        "--map",
        metavar="[FILE:]CHANNEL=HEADER",
        help="The same for one channel, such as 'current_A=CH2 * 2.5 + 0.1 in mA', or of one file, "
        "such as 'run3.csv:current_A=CH2 * -1'; may be repeated.",
    ),
]
Temperatures = Annotated[
    list[float] | None,
    typer.Option(
        "--temperature",
        parser=decimal,
        metavar="DEGC...",
        help="Temperatures of the speed loop.  [default: 25 125]",
    ),
]
Controllers = Annotated[
    list[str] | None,
    typer.Option(
        "--controller",
        metavar="C...",
        help="Controllers: P:kp, PI:kp,ki or PID:kp,ki,kd.  [default: P:1]",
    ),
]
Seed = Annotated[
    int,
    typer.Option(
        parser=whole,
        metavar="<int>",
        help="Seed of the sampler; the same seed, the same result.",
    ),
]
Effort = Annotated[
    str,
    typer.Option(
        metavar="LEVEL",
        help="How much is computed at most: quick, normal or thorough; the same on any machine.",
    ),
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        parser=decimal,
        metavar="SECONDS",
        help="Stop with the best found so far; the result then depends on the machine.",
    ),
]
NoPosterior = Annotated[
    bool,
    typer.Option("--no-posterior", help="Intervals from the fit's covariance; no posterior.nc."),
]
NoEffects = Annotated[
    bool, typer.Option("--no-effects", help="Stop at the declared model; look for no effect.")
]
SetAside = Annotated[
    bool,
    typer.Option(
        "--set-aside", help="Leave out runs that contradict physics or the other runs, and say so."
    ),
]
Force = Annotated[
    bool,
    typer.Option("--force", help="Fit although runs contradict; the result is marked."),
]
Known = Annotated[
    list[str] | None,
    typer.Option(
        "--known",
        metavar="NAME=VALUE[+-SD|+-N%]...",
        help="What is known of a parameter, in SI units, such as Kt25=0.048+-5%; without a spread "
        "1 % (a winding's resistance changes by that in 2.5 K).",
    ),
]
Plate = Annotated[
    list[str] | None,
    typer.Option(
        "--nameplate",
        metavar="KEY=VALUE,...",
        help="Nameplate data in SI units or with V, A, mA, rpm, Nm or mNm behind the number: "
        "voltage, no_load_speed, no_load_current, stall_current, stall_torque, rated_speed, "
        "rated_current, rated_torque.",
    ),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="A summary for scripts on standard output, as JSON.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
DataDir = Annotated[
    Path | None, typer.Option(help="Directory of the service's database, runs and results.")
]
