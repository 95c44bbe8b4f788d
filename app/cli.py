"""Command-line interface: definition of commands and options, and exit statuses.

    motorid fit run1.csv run2.csv --validation run3.csv --out out/motor
    motorid feedback --result out/motor/result.json --temperature 25 125 --controller PI:2,0.5

The work is done in `app.commands` and `app.serving`, which are imported when a command needs them.
So ``motorid --help`` responds immediately and ``motorid fit`` never loads the web framework.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core

from app.arguments import SeveralWords
from app.exits import Signals, Stopped, failed, prepare_streams, raised_signals
from app.logging import warnings_logged
from app.option_types import (
    ApiKey,
    AsJson,
    Controllers,
    DataDir,
    Effort,
    Force,
    Jobs,
    Known,
    MappingFile,
    MapWords,
    NoAuth,
    NoEffects,
    NoPosterior,
    OutDir,
    Plate,
    Quiet,
    Runs,
    Seed,
    Server,
    SetAside,
    Temperatures,
    TimeLimit,
)

__all__ = ["app", "main"]


class _Commands(typer.core.TyperGroup):
    """Command group that leaves interruptions to `main`."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command; click would map Ctrl-C and a closed pipe to its own exit statuses."""
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, BrokenPipeError) as error:
            raise Stopped(error) from error


app = typer.Typer(
    cls=_Commands,
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
keys = typer.Typer(help="API keys of the HTTP service.", rich_markup_mode=None)
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
    runs: Runs,
    out: OutDir,
    validation: Annotated[
        list[Path] | None,
        typer.Option(metavar="RUN...", help="Files of the validation runs, which are not fitted."),
    ] = None,
    seed: Seed = 0,
    no_posterior: NoPosterior = False,
    no_effects: NoEffects = False,
    set_aside: SetAside = False,
    force: Force = False,
    known: Known = None,
    nameplate: Plate = None,
    hold: Annotated[
        str,
        typer.Option(help="Inter-sample behaviour of the voltage: auto (estimated), zoh or foh."),
    ] = "auto",
    effort: Effort = "normal",
    time_limit: TimeLimit = None,
    temperature: Temperatures = None,
    controller: Controllers = None,
    mapping: MappingFile = None,
    map: MapWords = None,  # noqa: A002  the option's name
    json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Identify a motor: write DIR/result.json, DIR/report.html and DIR/posterior.nc.

    List the runs in recording order.  All words after --validation up to the next option are
    validation runs, so put the training runs before it or after another option.
    """
    from app import commands

    commands.fit(
        runs,
        validation or [],
        out,
        commands.fit_options(
            seed=seed,
            no_posterior=no_posterior,
            no_effects=no_effects,
            hold=hold,
            effort=effort,
            time_limit=time_limit,
            temperature=temperature,
            controller=controller,
            set_aside=set_aside,
            force=force,
            known=known,
            nameplate=nameplate,
        ),
        mapping=commands.mapping_of(mapping, map or []),
        show=commands.Show(as_json=json, quiet=quiet),
    )


@app.command(cls=SeveralWords)
def predict(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="result.json of a fit.")],
    run: Annotated[Path, typer.Argument(metavar="RUN", help="File of the run to simulate.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="CSV file to write.")],
    declared: Annotated[
        bool, typer.Option("--declared", help="Simulate the nominal model, not the final one.")
    ] = False,
    mapping: MappingFile = None,
    map: MapWords = None,  # noqa: A002  the option's name
) -> None:
    """Simulate the sensor readings of a run from its voltage and temperature.

    Writes columns time_s,current_A,speed_rad_s with one row per sample.  The measured current and
    speed are used for the initial state only.
    """
    from app import commands

    commands.predict(result, run, out, declared, commands.mapping_of(mapping, map or []))


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
    set: Annotated[  # noqa: A002  the option's name
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE...", help="Parameter values in SI units, instead of a result."
        ),
    ] = None,
    temperature: Temperatures = None,
    controller: Controllers = None,
    json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compute step response metrics and stability margins of the speed loop at each temperature."""
    from app import commands

    commands.feedback(
        commands.motor_of(result, set or []),
        temperature or [25.0, 125.0],
        controller or ["P:1"],
        out,
        show=commands.Show(as_json=json, quiet=quiet),
    )


@app.command(cls=SeveralWords)
def batch(
    manifest: Annotated[
        Path, typer.Argument(metavar="MANIFEST", help="CSV or YAML file: motors, runs, options.")
    ],
    out: OutDir,
    jobs: Jobs = None,
    server: Server = None,
    key: ApiKey = None,
    seed: Seed = 0,
    no_posterior: NoPosterior = False,
    no_effects: NoEffects = False,
    effort: Effort = "normal",
    time_limit: TimeLimit = None,
    set_aside: SetAside = False,
    force: Force = False,
    known: Known = None,
    nameplate: Plate = None,
    json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fit many motors: write DIR/MOTOR/ for each, DIR/results.csv and DIR/fleet.html for all.

    Paths in the manifest are relative to it; in CSV, separate several paths by semicolons.  Options
    given here are defaults that the manifest overrides.  A motor whose result is up to date is not
    fitted again, and a motor that fails does not stop the others.
    """
    from app import commands
    from app.batch.command import run_batch
    from identification.threads import cores

    run_batch(
        manifest,
        out,
        commands.fit_options(
            seed=seed,
            no_posterior=no_posterior,
            no_effects=no_effects,
            effort=effort,
            time_limit=time_limit,
            set_aside=set_aside,
            force=force,
            known=known,
            nameplate=nameplate,
        ),
        at_once=jobs or cores(),
        server=server,
        key=key,
        show=commands.Show(as_json=json, quiet=quiet),
    )


@app.command()
def demo(
    campaign: Annotated[str, typer.Argument(help="Name of a directory in data/.")] = "paper_motor",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Output directory.  [default: out/NAME]")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Directory of the campaigns.  [default: data/]"),
    ] = None,
    seed: Seed = 0,
    no_posterior: NoPosterior = False,
    effort: Effort = "normal",
    time_limit: TimeLimit = None,
    json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Identify a motor from the runs of a campaign in data/."""
    from app import commands

    training, validation = commands.campaign_runs(campaign, data)
    commands.fit(
        training,
        validation,
        out or Path("out") / campaign,
        commands.fit_options(
            seed=seed, no_posterior=no_posterior, effort=effort, time_limit=time_limit
        ),
        show=commands.Show(as_json=json, quiet=quiet),
    )


@app.command()
def serve(
    host: Annotated[
        str | None, typer.Option(help="Address to listen on.  [default: 127.0.0.1]")
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(help="Port to listen on; 0 selects a free port.  [default: 8000]"),
    ] = None,
    data_dir: DataDir = None,
    no_auth: NoAuth = False,
) -> None:
    """Run the HTTP service.  MOTORID_ environment variables supply all other settings."""
    from app import serving

    serving.serve(host=host, port=port, data_dir=data_dir, no_auth=no_auth or None)


@app.command()
def backup(
    archive: Annotated[
        Path,
        typer.Argument(
            metavar="BACKUP", help="New directory, or new file with a name that ends with .tar."
        ),
    ],
    data_dir: DataDir = None,
) -> None:
    """Back up the service's database, runs and results, even while the service runs."""
    from app import serving

    serving.back_up(archive, data_dir)


@app.command()
def restore(
    archive: Annotated[
        Path, typer.Argument(metavar="BACKUP", help="Backup made by 'motorid backup'.")
    ],
    data_dir: DataDir = None,
) -> None:
    """Create a data directory from a backup after checking every file; nothing is overwritten."""
    from app import serving

    serving.restore(archive, data_dir)


@keys.command("create")
def create_key(
    name: Annotated[str, typer.Argument(help="Display name, such as the name of the test bench.")],
    workspace: Annotated[
        str, typer.Option(help="Workspace whose runs and fits the key gives access to.")
    ] = "default",
    days: Annotated[
        float | None, typer.Option(help="Lifetime in days.  [default: unlimited]")
    ] = None,
    data_dir: DataDir = None,
) -> None:
    """Create an API key.  It is printed once and cannot be shown again."""
    from app import serving

    serving.create_key(name, workspace, days, data_dir)


@keys.command("list")
def list_keys(data_dir: DataDir = None) -> None:
    """List all keys with workspace, expiry and last use, but not their secrets."""
    from app import serving

    serving.list_keys(data_dir)


@keys.command("revoke")
def revoke_key(
    key: Annotated[str, typer.Argument(help="Id of the key, from 'motorid keys list'.")],
    data_dir: DataDir = None,
) -> None:
    """Revoke a key and end its sessions."""
    from app import serving

    serving.revoke_key(key, data_dir)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        words: Arguments after ``motorid``; default: those of the process.

    Returns:
        Exit status.
    """
    prepare_streams()
    came = Signals()
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
