"""The command `join`: one run file from files of one channel each."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.arguments import check_mapped_files, map_arguments, mapping_of
from identification.errors import InputError

__all__ = ["join"]


def join(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Files of the channels of one run.")
    ],
    out: Annotated[Path, typer.Option(metavar="RUN", help="CSV file of the run to write.")],
    mapping: options.MappingFile = None,
    map: options.MapWords = None,  # noqa: A002  the option's name
) -> None:
    """Join files of one channel each, as some oscilloscopes write them, to one run file.

    Writes canonical columns in SI units on one clock: that of the voltage, or of a channel that is
    logged faster.  Between samples, a voltage keeps its value, and other channels are linear.
    """
    from app.commands.console import remark
    from app.commands.files import writable_file
    from identification.ingest import write_run
    from identification.ingest.several_files import join_files

    chosen = mapping_of(mapping, map or [])
    check_mapped_files(chosen, files)
    with writable_file(out, inputs=files):
        try:
            run = join_files(files, out.name, chosen)
        except InputError as error:
            given = [*(("--mapping", str(mapping)) if mapping else ())]
            given += [word for one in map or [] for word in ("--map", one)]
            _complete(
                error, ["motorid", "join", *(str(f) for f in files), "--out", str(out), *given]
            )
            raise
        write_run(run, out)
    for warning in run.warnings:
        remark(str(warning))


def _complete(error: InputError, words: list[str]) -> None:
    """Replace the mappings of an error and its further ones by one command with all of them."""
    every: list[InputError] = [error, *error.further]
    missing = {k: entry for one in every for each in one.examples[:1] for k, entry in each.items()}
    if not missing:
        return
    for one in every:
        one.examples = ()
    every[-1].message += (
        "; the command with all of it, in which capitals stand for what only you know: "
        f"{shlex.join(words)} {map_arguments([missing])}"
    )
