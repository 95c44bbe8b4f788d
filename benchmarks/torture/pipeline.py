"""Pipeline for failure tests: the seed selects load, exhausted memory or a large result.

Served with MOTORID_PIPELINE=benchmarks.torture.pipeline:identify.
"""

from __future__ import annotations

import json
import resource
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from identification.ingest import Run
from identification.options import FitOptions

__all__ = ["BURNS", "BURN_S", "HUNGRY", "HUNGRY_ONCE", "LARGE", "QUICK", "identify"]

QUICK, BURNS, HUNGRY, HUNGRY_ONCE, LARGE = range(5)
"""Seeds.  QUICK succeeds at once; BURNS computes for some seconds; HUNGRY requests memory until
none is left, HUNGRY_ONCE only in its first attempt; LARGE writes a result of 8 MB."""

BURN_S = 6.0
"""Duration of BURNS [s]."""

_MEMORY = 600_000_000


class _Result:
    def __init__(self, result: dict[str, Any], size: int) -> None:
        self.result = result
        self._size = size

    def write(self, directory: Path) -> None:
        (directory / "report.html").write_text("<!doctype html><title>x</title>" + "x" * self._size)
        (directory / "result.json").write_text(json.dumps(self.result))


def identify(
    training: Sequence[Run],
    validation: Sequence[Run],
    options: FitOptions,
    progress: Callable[[str, float], None],
) -> _Result:
    """Behave as the seed selects."""
    progress("fit", 0.0)
    if options.seed == BURNS:
        _burn(progress)
    if options.seed == HUNGRY or (options.seed == HUNGRY_ONCE and _attempt() == 1):
        _fill_memory()
    result = {"schema_version": 1, "runs": [run.sha256 for run in (*training, *validation)]}
    return _Result(result, 8_000_000 if options.seed == LARGE else 100)


def _attempt() -> int:
    import tempfile

    # Temporary files are in the directory of the attempt, whose name is its number.
    return int(Path(tempfile.gettempdir()).name)


def _burn(progress: Callable[[str, float], None]) -> None:
    began, number = time.monotonic(), 1
    while (passed := time.monotonic() - began) < BURN_S:
        for _ in range(100_000):
            number = number * 1103515245 % 2147483647
        progress("posterior", passed / BURN_S)


def _fill_memory() -> None:
    """Request more memory than available, as under a kernel with strict accounting."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    blocks: list[bytearray] = []
    while True:
        blocks.append(bytearray(10_000_000))
