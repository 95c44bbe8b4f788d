"""Output files of a fit with SHA-256 checksums, which every read verifies.

The checksums reveal bytes that the disk has corrupted and files that were truncated.  They are
stored in the directory of the outputs, in the format of ``sha256sum --check``.
"""

from __future__ import annotations

import errno
import json
import os
import re
from io import BufferedReader
from pathlib import Path
from typing import Any

from app.disk import open_regular, sha256_of
from app.fits.job import OUTPUT_SUMS, OUTPUTS
from identification.result.atomic import write_text

__all__ = ["expected_outputs", "open_output", "read_result", "seal", "sums_of"]

_ALWAYS = ("result.json", "report.html")
_LINE = re.compile(r"([0-9a-f]{64})  ([a-z.]+)")
_LONGEST_SUMS = 10_000


def seal(directory: Path) -> None:
    """Flush the outputs of an attempt to disk and write their checksums."""
    lines = []
    for name in OUTPUTS:
        if (directory / name).exists():
            with (directory / name).open("rb") as file:
                os.fsync(file.fileno())
                lines.append(f"{sha256_of(file)}  {name}\n")
    write_text(directory / OUTPUT_SUMS, "".join(lines))


def sums_of(directory: Path) -> dict[str, str]:
    """SHA-256 of the outputs of an attempt by name; empty without a readable checksum file."""
    try:
        with open_regular(directory / OUTPUT_SUMS) as file:
            text = file.read(_LONGEST_SUMS).decode("ascii", "replace")
    except OSError:
        return {}
    found = [_LINE.fullmatch(line) for line in text.splitlines()]
    return {match.group(2): match.group(1) for match in found if match}


def expected_outputs(directory: Path) -> set[str]:
    """Names of the outputs of a succeeded attempt."""
    return {*_ALWAYS, *sums_of(directory)}


def open_output(directory: Path, name: str) -> BufferedReader:
    """Open an output for reading after verifying its checksum, if one is stored.

    Raises:
        OSError: The file is missing, unreadable, or differs from its checksum.
    """
    file = open_regular(directory / name)
    try:
        expected = sums_of(directory).get(name)
        if expected not in (None, sha256_of(file)):
            raise _damaged("SHA-256 differs from that of the file that was written", file)
    except OSError:
        file.close()
        raise
    return file


def read_result(directory: Path) -> dict[str, Any]:
    """Content of the result.json of an attempt.

    Raises:
        OSError: The file is missing, unreadable, or differs from what was written.
    """
    with open_output(directory, "result.json") as file:
        try:
            content = json.load(file)
        except (ValueError, RecursionError) as error:
            raise _damaged("Not JSON", file) from error
        if not isinstance(content, dict):
            raise _damaged("No result of a fit", file)
    return content


def _damaged(reason: str, file: BufferedReader) -> OSError:
    return OSError(errno.EBADMSG, reason, file.name)
