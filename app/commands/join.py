"""The command `join`: one run file from files of one channel each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.arguments import check_mapped_files, mapping_of

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
    check_mapped_files(chosen, [out])
    with writable_file(out, inputs=files):
        run = join_files(files, out.name, chosen)
        write_run(run, out)
    for warning in run.warnings:
        remark(str(warning))
