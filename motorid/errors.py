"""Errors of the client, as one tree.

    ClientError
    ├── Unreachable        no response, in spite of retries
    ├── WaitedTooLong      the fit or batch did not end within the time limit
    ├── FitFailed          the fit ended without a result
    └── Problem            the service refused: status, code, detail, file, row, column
        ├── BadKey         missing or invalid key
        ├── NotFound       no such item in the workspace of the key
        ├── Refused        request, field or run file not accepted
        └── Busy           temporary: too many calls, or the service starts, stops or is full

A `Problem` holds the members of the RFC 9457 body; its message is the `detail` of the service.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = [
    "BadKey",
    "Busy",
    "ClientError",
    "FitFailed",
    "NotFound",
    "Problem",
    "Refused",
    "Unreachable",
    "WaitedTooLong",
    "problem_from",
]


class ClientError(Exception):
    """Base class."""


class Unreachable(ClientError):
    """No response of the service within the time over which calls are repeated."""


class WaitedTooLong(ClientError):
    """Fit or batch that did not end within the time limit; it continues at the service."""


class FitFailed(ClientError):
    """Fit that ended without a result.

    Args:
        fit_id: ID of the fit.
        status: ``failed`` or ``cancelled``.
        error: Member `error` of the fit with the reason; empty if the fit was cancelled.
    """

    def __init__(self, fit_id: str, status: str, error: Mapping[str, Any] | None) -> None:
        error = error or {}
        self.fit_id = fit_id
        self.status = status
        self.code: str | None = error.get("code")
        self.detail: str | None = error.get("detail")
        self.file: str | None = error.get("file")
        self.row: int | None = error.get("row")
        self.column: str | None = error.get("column")
        reason = f": {self.detail}" if self.detail else ""
        super().__init__(f"{fit_id} {'was cancelled' if status == 'cancelled' else status}{reason}")


class Problem(ClientError):
    """Refusal of a call by the service.

    Args:
        status: HTTP status.
        body: Problem details from the service.
    """

    def __init__(self, status: int, body: Mapping[str, Any]) -> None:
        self.status = status
        self.body = dict(body)
        self.title = str(body.get("title") or f"HTTP status {status}")
        self.code: str | None = body.get("code")
        self.detail: str = str(body.get("detail") or self.title)
        self.file: str | None = body.get("file")
        self.row: int | None = body.get("row")
        self.column: str | None = body.get("column")
        self.errors: Sequence[Mapping[str, Any]] = body.get("errors") or ()
        self.request_id: str | None = body.get("request_id")
        super().__init__(self.detail)


class BadKey(Problem):
    """Missing or invalid key."""


class NotFound(Problem):
    """Item missing in the workspace of the key."""


class Refused(Problem):
    """Fault of the request; the same request would be refused again."""


class Busy(Problem):
    """Temporary refusal; a later retry may succeed."""


_KINDS: dict[int, type[Problem]] = {401: BadKey, 404: NotFound, 429: Busy, 503: Busy, 507: Busy}


def problem_from(status: int, body: object) -> Problem:
    """Error of a response.

    Args:
        status: HTTP status.
        body: Body of the response if it is JSON, else None.
    """
    kind = _KINDS.get(status, Refused if 400 <= status < 500 else Problem)
    return kind(status, body if isinstance(body, Mapping) else {})
