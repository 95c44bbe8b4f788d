"""Pipeline of short duration, set by the seed, for tests with hundreds of fits.

The computing processes import it by name; see `MOTORID_PIPELINE`.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identification.ingest import Run
from identification.options import FitOptions

__all__ = ["identify"]

_STEP_S = 0.05


@dataclass(frozen=True)
class _Pretended:
    result: dict[str, Any]

    def write(self, directory: Path) -> None:
        (directory / "report.html").write_text("<!doctype html><title>Report</title>")
        (directory / "result.json").write_text(json.dumps(self.result))


def identify(
    training: Sequence[Run],
    validation: Sequence[Run],
    options: FitOptions,
    progress: Callable[[str, float], None],
) -> _Pretended:
    """Take up to 1.5 s and return a result with the seed, which identifies it.

    Args:
        training: Runs that the result names.
        validation: As above.
        options: The last digit of the seed determines the duration.
        progress: Receives the stage and the fraction done.
    """
    steps = 1 + 3 * (options.seed % 10)
    for step in range(steps):
        progress("posterior", step / steps)
        time.sleep(_STEP_S)
    return _Pretended({"seed": options.seed, "runs": [r.sha256 for r in (*training, *validation)]})
