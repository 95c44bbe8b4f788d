"""Implementation of ``motorid export``: write a result in the format of another program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from app.commands import console
from app.commands.files import draws_of, read_result, writable_file

__all__ = ["export"]

_MOST_DRAWS = 1000


def export(result: Path, form: str, out: Path, temperatures: Sequence[float]) -> None:
    """Write a result in another format, and show what the file does not hold.

    Raises:
        OptionError: The format, a temperature or the output file is not accepted.
        InputError: The result is not accepted.
    """
    from identification.export import export as exported
    from identification.result.atomic import replacing

    content = read_result(result)
    with writable_file(out, inputs=(result, result.parent)):
        made = exported(content, form, lambda: draws_of(content, result, _MOST_DRAWS), temperatures)
        with replacing(out) as file:
            file.write_bytes(made.content)
    for line in made.remarks:
        console.remark(line)
