"""Command ``motorid export``: write a result in the format of another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.arguments import decimal

__all__ = ["export"]

_MOST_DRAWS = 1000


def export(
    result: options.ResultFile,
    to: Annotated[
        str,
        typer.Option(
            metavar="FORMAT",
            help="Format of the file: python-control, matlab, simulink-m, modelica, fmu, fmu3, c, "
            "csv.",
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="File to write.")],
    temperature: Annotated[
        list[float] | None,
        typer.Option(
            parser=decimal,
            metavar="DEGC...",
            help="Temperatures of linear models.  [default: those of the result]",
        ),
    ] = None,
) -> None:
    """Write the identified motor in the format of another program.

    The file holds the final model with its effects as far as the format can hold them; standard
    error and the top of the file say what it does not hold.
    """
    from app.commands import console
    from app.commands.files import draws_of, read_result, writable_file
    from identification.export import export as exported
    from identification.result.atomic import replacing

    content = read_result(result)
    with writable_file(out, inputs=(result, result.parent)):
        made = exported(
            content, to, lambda: draws_of(content, result, _MOST_DRAWS), temperature or []
        )
        with replacing(out) as file:
            file.write_bytes(made.content)
    for line in made.remarks:
        console.remark(line)
