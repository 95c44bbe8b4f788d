"""Command-line interface: definition of commands and options, and exit statuses.

    motorid fit run1.csv run2.csv --validation run3.csv --out out/motor
    motorid feedback --result out/motor/result.json --temperature 25 125 --controller PI:2,0.5

The work is done in `app.commands`, whose modules are imported when a command needs them.
So ``motorid --help`` responds immediately and ``motorid fit`` never loads the web framework.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.arguments import SeveralWords, mapping_of
from app.commands.design import design
from app.commands.exits import (
    CaughtSignals,
    CommandGroup,
    Stopped,
    failed,
    prepare_streams,
    raised_signals,
)
from app.commands.export import export
from app.commands.join import join
from app.commands.service import backup, keys, restore, serve
from app.commands.tune import tune
from app.logging import warnings_logged

__all__ = ["app", "main"]

app = typer.Typer(
    cls=CommandGroup,
    help="Identify the parameters of a brushed DC motor from recorded runs, and predict its closed "
    "speed loop at several temperatures.",
    epilog="Exit status: 0 success, 1 the computation failed, 2 the input is invalid, 130 "
    "interrupted, 143 terminated by SIGTERM, 129 terminated by SIGHUP. Error messages are one line "
    "on standard error.",
    add_completion=False,
    no_args_is_help=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(keys, name="keys")


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"motorid {version('motorid')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _without_command(
    ctx: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


@app.command(cls=SeveralWords)
def fit(
    ctx: typer.Context,
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Files of the training runs.")
    ],
    out: options.OutDir,
    validation: Annotated[
        list[Path] | None,
        typer.Option(metavar="RUN...", help="Files of the validation runs, which are not fitted."),
    ] = None,
    motor_name: Annotated[
        str,
        typer.Option("--motor", metavar="NAME", help="Name of the motor, for report and result."),
    ] = "",
    bench: Annotated[
        str, typer.Option(metavar="NAME", help="Name of the test bench, for report and result.")
    ] = "",
    seed: options.Seed = 0,
    no_posterior: options.NoPosterior = False,
    no_effects: options.NoEffects = False,
    set_aside: options.SetAside = False,
    force: options.Force = False,
    known: options.Known = None,
    nameplate: options.Plate = None,
    hold: Annotated[
        str,
        typer.Option(help="Inter-sample behaviour of the voltage: auto (estimated), zoh or foh."),
    ] = "auto",
    effort: options.Effort = "normal",
    time_limit: options.TimeLimit = None,
    temperature: options.Temperatures = None,
    controller: options.Controllers = None,
    mapping: options.MappingFile = None,
    map: options.MapWords = None,  # noqa: A002  the option's name
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Identify a motor: write DIR/result.json, DIR/report.html and DIR/posterior.nc.

    List the runs in recording order.  All words after --validation up to the next option are
    validation runs, so put the training runs before it or after another option.
    """
    from app.commands import console, motor

    motor.fit(
        runs,
        validation or [],
        out,
        motor.fit_options(ctx.params),
        mapping=mapping_of(mapping, map or []),
        label=motor.Label(motor_name, bench),
        output=console.Output(json, quiet),
    )


@app.command(cls=SeveralWords)
def check(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Files of runs of one motor.")
    ],
    mapping: options.MappingFile = None,
    map: options.MapWords = None,  # noqa: A002  the option's name
    save_mapping: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON file to write with the mapping as understood."),
    ] = None,
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Examine runs before a fit: columns, excitation, contradictions, precision to expect.

    Nothing is stored.  The exit status is 2 if `motorid fit` would refuse the runs.
    """
    from app.commands.check import check
    from app.commands.console import Output

    given = [] if mapping is None else ["--mapping", str(mapping)]
    given += [word for text in map or [] for word in ("--map", text)]
    understood = mapping_of(mapping, map or [])
    check(runs, understood, save_mapping, given=given, output=Output(json, quiet))


app.command(cls=SeveralWords)(join)


@app.command(cls=SeveralWords)
def predict(
    result: options.ResultFile,
    run: Annotated[Path, typer.Argument(metavar="RUN", help="File of the run to simulate.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="CSV file to write.")],
    declared: Annotated[
        bool, typer.Option("--declared", help="Simulate the nominal model, not the final one.")
    ] = False,
    mapping: options.MappingFile = None,
    map: options.MapWords = None,  # noqa: A002  the option's name
) -> None:
    """Simulate the sensor readings of a run from its voltage and temperature.

    Writes columns time_s,current_A,speed_rad_s with one row per sample.  The measured current and
    speed are used for the initial state only.  A run that a fit would refuse, that contradicts the
    prediction as one of another motor, or that leaves the range of the fitted runs has a remark on
    standard error.
    """
    from app.commands.console import remark
    from app.commands.files import read_result, writable_file
    from identification.ingest import read_run
    from identification.remarks import remarks_on
    from identification.result.atomic import write_text

    chosen = mapping_of(mapping, map or [])
    content, measured = read_result(result), read_run(run, mapping=chosen)
    with writable_file(out, inputs=(run, result, result.parent)):
        from identification.prediction import predict as simulate

        table = simulate(content, measured, declared)
        write_text(out, table.to_csv(index=False, lineterminator="\n"))
    for text in remarks_on(content, measured, table):
        remark(text)


@app.command(cls=SeveralWords)
def feedback(
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="JSON file to write.")] = None,
    result: Annotated[
        Path | None,
        typer.Option(
            metavar="RESULT",
            help="result.json of a fit; posterior.nc in the same directory is used if present.",
        ),
    ] = None,
    set: options.Parameters = None,  # noqa: A002  the option's name
    temperature: options.Temperatures = None,
    controller: options.Controllers = None,
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute step response metrics and stability margins of the speed loop at each temperature.

    The loop is that of the linear motor; a remark on standard error names the effects of the result
    that are not in it.
    """
    from app.commands import console, motor
    from app.commands.files import write_json
    from identification.speed_loop import feedback_metrics

    draws, content = motor.motor_of(result, set or [])
    motor.remark_on_effects(content)
    entries = feedback_metrics(draws, temperature or [25.0, 125.0], controller or ["P:1"])
    write_json(out, entries, result)
    console.Output(json, quiet).show(entries, lambda: console.print_feedback(entries))


app.command(cls=SeveralWords)(tune)
app.command(cls=SeveralWords)(export)
app.command(cls=SeveralWords)(design)


@app.command(cls=SeveralWords)
def batch(
    ctx: typer.Context,
    manifest: Annotated[
        Path, typer.Argument(metavar="MANIFEST", help="CSV or YAML file: motors, runs, options.")
    ],
    out: options.OutDir,
    jobs: Annotated[
        int | None,
        typer.Option(
            min=1, metavar="N", help="Motors fitted in parallel.  [default: number of cores]"
        ),
    ] = None,
    server: Annotated[
        str | None, typer.Option(metavar="URL", help="URL of a service that computes the fits.")
    ] = None,
    key: Annotated[
        str | None,
        typer.Option(
            metavar="KEY",
            envvar="MOTORID_KEY",
            show_envvar=False,
            help="API key of the service.  The variable MOTORID_KEY keeps it out of process lists.",
        ),
    ] = None,
    seed: options.Seed = 0,
    no_posterior: options.NoPosterior = False,
    no_effects: options.NoEffects = False,
    effort: options.Effort = "normal",
    time_limit: options.TimeLimit = None,
    set_aside: options.SetAside = False,
    force: options.Force = False,
    known: options.Known = None,
    nameplate: options.Plate = None,
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Fit many motors: write DIR/MOTOR/ for each, DIR/results.csv and DIR/fleet.html for all.

    Paths in the manifest are relative to it; in CSV, separate several paths by semicolons.  Options
    given here are defaults that the manifest overrides.  A motor whose result is up to date is not
    fitted again, and a motor that fails does not stop the others.
    """
    from app.commands import console, motor
    from app.commands.batch.command import run_batch
    from identification.threads import cores

    run_batch(
        manifest,
        out,
        motor.fit_options(ctx.params),
        at_once=jobs or cores(),
        server=server,
        key=key,
        output=console.Output(json, quiet),
    )


@app.command()
def demo(
    ctx: typer.Context,
    campaign: Annotated[str, typer.Argument(help="Name of a directory in data/.")] = "paper_motor",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Output directory.  [default: out/NAME]")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Directory of the campaigns.  [default: data/]"),
    ] = None,
    seed: options.Seed = 0,
    no_posterior: options.NoPosterior = False,
    effort: options.Effort = "normal",
    time_limit: options.TimeLimit = None,
    json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Identify a motor from the runs of a campaign in data/."""
    from app.commands import console, motor

    training, validation = motor.campaign_runs(campaign, data)
    motor.fit(
        training,
        validation,
        out or Path("out") / campaign,
        motor.fit_options(ctx.params),
        output=console.Output(json, quiet),
    )


app.command()(serve)
app.command()(backup)
app.command()(restore)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line on these words or those of the process; return the exit status."""
    prepare_streams()
    came = CaughtSignals()
    try:
        with warnings_logged(), raised_signals() as came:
            status = app(args=words, prog_name="motorid", standalone_mode=False)
            sys.stdout.flush()
    except Stopped as stopped:
        return failed(came.raised or stopped.reason)
    except SystemExit as left:
        return left.code if isinstance(left.code, int) else 1
    except BaseException as error:  # noqa: BLE001  last resort: no traceback for users
        return failed(came.raised or error)
    return status if isinstance(status, int) else 0


if __name__ == "__main__":
    sys.exit(main())
