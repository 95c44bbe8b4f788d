"""JSON log on standard error: one object per line, with the request id and without secrets.

    {"time": "2026-11-21T12:00:00.123Z", "level": "info", "logger": "app.fits.supervisor",
     "message": "fit succeeded", "request_id": "4be1...", "fit": "fit_5xk2...", "attempt": 1}

Of the client's data, only the path is logged: no headers, query or body.  Anything that looks like
a key is masked.
"""

from __future__ import annotations

import json
import logging
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

__all__ = ["configure_logging", "request_id", "warnings_logged"]

request_id: ContextVar[str | None] = ContextVar("request_id", default=None)

_SECRET = re.compile(r"motorid_[A-Za-z0-9_-]{40,}")
"""Pattern of a key or session cookie, which a client may misplace, as in a path."""

_STANDARD = frozenset(logging.makeLogRecord({}).__dict__) | {"message", "asctime", "color_message"}


class _JsonFormatter(logging.Formatter):
    """Formatter of a record as one line of JSON, with the values of `extra` as fields."""

    def format(self, record: logging.LogRecord) -> str:
        moment = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        entry: dict[str, Any] = {
            "time": f"{moment}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if (current := request_id.get()) is not None:
            entry["request_id"] = current
        entry |= {name: value for name, value in vars(record).items() if name not in _STANDARD}
        if record.exc_info:
            entry["exception"] = self.formatException(record.exc_info)
        return _SECRET.sub("motorid_...", json.dumps(entry, default=str))


def configure_logging(level: str) -> None:
    """Send the logs of the service and its libraries, from a level on, to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_JsonFormatter())
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(level.upper())
    for name in ("alembic", "multipart", "python_multipart", "asyncio"):
        logging.getLogger(name).setLevel(logging.WARNING)


@contextmanager
def warnings_logged() -> Iterator[None]:
    """Redirect Python warnings to the log while the block runs.

    Warnings refer to source files and do not help users.  A command has no log and shows none; the
    service logs them.  Warnings that are configured as errors, as in tests, remain errors.
    """
    logging.captureWarnings(True)
    try:
        yield
    finally:
        logging.captureWarnings(False)
