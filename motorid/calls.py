"""Calls of the service by their kind: get, begin, list, cancel, delete, fetch."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from motorid.errors import NotFound
from motorid.files import Source, opened, replacing
from motorid.transport import Transport, content_of

__all__ = ["Calls"]

_MOMENT_S = 0.1
_PAGE = 100


class Calls:
    """Calls of one service, each of which has the same effect if it is repeated.

    Args:
        transport: Connection to the service.
    """

    def __init__(self, transport: Transport) -> None:
        self.transport = transport

    def get(self, path: str, **parameters: Any) -> dict[str, Any]:
        """JSON object at a path; parameters without a value are not sent."""
        given = {name: value for name, value in parameters.items() if value is not None}
        return content_of(self.transport.call("GET", path, params=given))

    def upload(
        self, path: str, source: Source, name: str | None, fields: Mapping[str, str]
    ) -> dict[str, Any]:
        """Send a form with a file, which is opened anew for each attempt."""
        called, open_source = opened(source, name)

        @contextmanager
        def form() -> Iterator[dict[str, Any]]:
            with open_source() as file:
                yield {"files": {"file": (called, file)}, "data": fields}

        return content_of(self.transport.call("POST", path, content=form))

    def begin(self, path: str, body: Mapping[str, Any], key: str | None) -> dict[str, Any]:
        """Submit a job once, under an Idempotency-Key; a new key if it is None."""
        headers = {"Idempotency-Key": key or uuid.uuid4().hex}
        return content_of(self.transport.call("POST", path, json=body, headers=headers))

    def listed(self, path: str, **parameters: Any) -> Iterator[dict[str, Any]]:
        """Items of all pages of a list; the next page is requested on demand."""
        page = self.get(path, limit=_PAGE, **parameters)
        yield from page["items"]
        while page["next"] is not None:
            page = self.get(path, limit=_PAGE, after=page["next"], **parameters)
            yield from page["items"]

    def cancelled(self, path: str) -> dict[str, Any]:
        """Cancel a job without removing it."""
        return content_of(self.transport.call("DELETE", path, params={"remove": "false"}))

    def deleted(self, path: str) -> None:
        """Remove something; if it is missing already, that is no error."""
        try:
            while self.transport.call("DELETE", path).status_code != 204:
                time.sleep(_MOMENT_S)
        except NotFound:
            return

    def fetched(self, path: str, target: Path, kind: str = "*/*") -> Path:
        """Write the content at a path to a file, as this media type; return the file."""
        with replacing(target) as file:
            self.transport.copy(path, {"Accept": kind}, file)
        return target
