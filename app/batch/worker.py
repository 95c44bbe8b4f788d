"""Fit of one motor of a batch in a child process of the fork server.

Messages to the parent process, one JSON object per line:

    {"progress": ["posterior", 0.42]}
    {"done": true}                the result and its record are on disk
    {"failed": "..."}             invalid input or failed computation

A child that exits without `done` or `failed` has crashed.
"""

from __future__ import annotations

import importlib
import os
import time
from pathlib import Path
from typing import Any

from app.batch.record import finish, make_way, now_text
from app.exits import TRACEBACK
from app.logging import warnings_logged
from app.nursery.answers import tell
from identification.errors import ComputationError, InputError
from identification.ingest import read_run
from identification.options import FitOptions
from identification.threads import use_threads

__all__ = ["handle"]

_INTERVAL_S = 0.2


def handle(task: dict[str, Any], answer: int) -> None:
    """Fit one motor and report its progress and outcome on the pipe.

    Args:
        task: `out`, `training`, `validation`, `mapping`, `options`, `record`, `pipeline`
            and `threads`.
        answer: Write end of the pipe to the command.
    """
    try:
        with warnings_logged():
            _fit(task, _Progress(answer))
    except (InputError, ComputationError) as error:
        tell(answer, {"failed": str(error)})
    except OSError as error:
        tell(answer, {"failed": f"{error.filename or 'files'}: {error.strerror or error}"})
    except MemoryError:
        tell(answer, {"failed": "not enough memory; fit fewer motors in parallel (smaller --jobs)"})
    except Exception as error:  # noqa: BLE001  a failed motor must not stop the batch
        tell(answer, {"failed": f"internal error, {type(error).__name__}: {error}"})
        if os.environ.get(TRACEBACK):
            raise
    else:
        tell(answer, {"done": True})


def _fit(task: dict[str, Any], progress: _Progress) -> None:
    out = Path(task["out"])
    use_threads(task["threads"])
    module, _, function = task["pipeline"].partition(":")
    identify = getattr(importlib.import_module(module), function)
    mapping = task["mapping"]
    files = [*task["training"], *task["validation"]]
    progress("read", 0.0)
    runs = [read_run(Path(file), mapping=mapping) for file in files]
    options: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in task["options"].items()
    }
    training = runs[: len(task["training"])]
    identification = identify(training, runs[len(training) :], FitOptions(**options), progress)
    out.mkdir(parents=True, exist_ok=True)
    # The previous result is kept until the new fit has succeeded.
    make_way(out)
    identification.write(out)
    finish(out, task["record"], now_text())


class _Progress:
    """Rate-limited progress messages."""

    def __init__(self, answer: int) -> None:
        self._answer = answer
        self._stage = ""
        self._sent = 0.0

    def __call__(self, stage: str, fraction: float) -> None:
        now = time.monotonic()
        if stage != self._stage or now - self._sent >= _INTERVAL_S:
            self._stage, self._sent = stage, now
            tell(self._answer, {"progress": [stage, min(max(fraction, 0.0), 1.0)]})
