"""Implementation of the commands: read files, call the library, write files and tables.

All input is checked before the first long computation: first the options, then the runs, then the
output directory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.commands import console
from app.commands.arguments import check_mapped_files, run_names, values_by_name
from app.commands.files import draws_of, read_result, writable_directory
from app.commands.loading import loading
from identification.arrays import Array
from identification.errors import InputError, OptionError
from identification.label import Label
from identification.options import FitOptions
from identification.speed_loop import parse_controllers

__all__ = ["Label", "campaign_runs", "fit", "fit_options", "motor_of"]

_MOST_DRAWS = 2000


def fit_options(given: Mapping[str, Any]) -> FitOptions:
    """Fit options from the parameters of a command by name, validated; others are ignored."""
    chosen = {name: given[name] for name in FitOptions.__dataclass_fields__ if name in given}
    for several, one in (("temperatures", "temperature"), ("controllers", "controller")):
        if given.get(one):
            chosen[several] = tuple(given[one])
    options = FitOptions(
        **chosen
        | {
            "posterior": not given.get("no_posterior"),
            "effects": not given.get("no_effects"),
            "known": tuple(given.get("known") or ()),
            "nameplate": ",".join(given.get("nameplate") or ()),
        }
    )
    parse_controllers(options.controllers)
    return options


def fit(
    training: Sequence[Path],
    validation: Sequence[Path],
    out: Path,
    options: FitOptions,
    *,
    mapping: Mapping[str, object] | None = None,
    label: Label = Label(),  # noqa: B008  frozen
    output: console.Output,
) -> None:
    """Fit a motor, write its results and show them."""
    # Local imports, here and below: reading, fitting and plotting modules take a second to load.
    with loading():
        from identification.ingest import read_run

    files = [*training, *validation]
    check_mapped_files(mapping, files)
    with console.progress_bar(output.quiet) as progress:
        runs = []
        for number, (file, name) in enumerate(zip(files, run_names(files), strict=True)):
            progress("read", 0.05 * number / len(files))
            runs.append(read_run(file, name=name, mapping=mapping))
        _refuse_checks_on_fitted(files, [run.sha256 for run in runs], len(training))
        with writable_directory(out):
            with loading():
                from identification.pipeline import identify

            identification = identify(
                runs[: len(training)],
                runs[len(training) :],
                options,
                lambda stage, done: progress(stage, 0.05 + 0.9 * done),
            )
            progress("write", 0.95)
            result = identification.result
            result.update(label.member())
            identification.write(out)
        progress("done", 1.0)
    output.show(console.fit_summary(result, out), lambda: console.print_fit(result, out))


def _refuse_checks_on_fitted(files: Sequence[Path], hashes: Sequence[str], training: int) -> None:
    """Reject validation runs identical to a training run, which would validate nothing."""
    fitted = dict(zip(hashes[:training], files, strict=False))
    for file, found in zip(files[training:], hashes[training:], strict=True):
        if found in fitted:
            raise InputError(
                f"has the same content as the training run {fitted[found]}; expected --validation "
                "runs that are not fitted",
                file=str(file),
            )


def motor_of(
    path: Path | None, settings: Sequence[str], most: int = _MOST_DRAWS
) -> tuple[Mapping[str, Array], dict[str, Any] | None]:
    """Draws of the nominal model's parameters, and the result that they come from.

    With ``--set`` values there is one draw and no result.

    Raises:
        OptionError: Both or neither were given, or a ``--set`` value is not accepted.
        InputError: The result is not accepted.
    """
    if (path is None) == (not settings):
        raise OptionError(
            "expected either --result DIR/result.json, or --set NAME=VALUE for each parameter"
        )
    if path is None:
        return {name: np.array([value]) for name, value in values_by_name(settings).items()}, None
    result = read_result(path)
    draws, remark = draws_of(result, path, most)
    if remark:
        console.remark(remark)
    return draws, result


def remark_on_effects(result: Mapping[str, Any] | None) -> None:
    """Print a remark if effects of a result act in a speed loop, which the linear one lacks.

    Raises:
        InputError: An effect of the result is unknown.
    """
    from identification.prediction import model_of
    from identification.speed_loop.closed_loop import acting_terms

    if result is None or not result.get("effects"):
        return
    names = [term.name for term in acting_terms(model_of(result)[0])]
    if names:
        console.remark(
            f"the loop is that of the linear motor, without {', '.join(names)}; the report has the "
            "loop of the fit with them, and motorid tune --controller simulates any other"
        )


def campaign_runs(name: str, data: Path | None) -> tuple[list[Path], list[Path]]:
    """Training and validation runs of a campaign in data/.

    The default folder is data/ of the working directory, then of the checkout.

    Raises:
        OptionError: There is no such campaign.
    """
    places = [data] if data else [Path("data"), Path(__file__).parents[2] / "data"]
    for place in places:
        training = sorted((place / name).glob("training_*.csv"))
        if training:
            return training, sorted((place / name).glob("validation_*.csv"))
    known = sorted({found.parent.name for p in places for found in p.glob("*/training_1.csv")})
    hint = (
        f"expected one of {', '.join(known)}"
        if known
        else "no campaign found; run the command in a checkout of the project, or add --data DIR"
    )
    raise OptionError(f"campaign {name!r} is not in data/: {hint}")
