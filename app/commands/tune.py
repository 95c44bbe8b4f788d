"""The command `tune` and its options; `app.commands.tuning` does the work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.arguments import decimal

__all__ = ["tune"]

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
        "--temperature",
        metavar="LOW:HIGH|DEGC...",
        help="Range of temperatures, or single ones.  [default: 25:125]",
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
        "--controller",
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
    from app.commands import motor, tuning

    tuning.tune(
        result,
        set or [],
        spec,
        temperature or ["25:125"],
        out,
        motor.Show(as_json=json, quiet=quiet),
        kinds=[one.upper() for one in kind or []],
        controllers=controller or [],
        probability=probability,
        step=step,
    )
