"""What can go wrong between a script and the service, as one tree.

    ClientError
    ├── Unreachable        no answer, however often it was tried
    ├── WaitedTooLong      the fit or the batch did not end in the time that was given
    ├── FitFailed          the fit ended without a result
    └── Problem            the service refused: status, code, detail, file, row, column
        ├── BadKey         no key, or one that is not valid
        ├── NotFound       no such thing, or it is another workspace's
        ├── Refused        the request, a field or a run file is not accepted
        └── Busy           not now: too many calls, or the service starts, stops or is full

A `Problem` holds what RFC 9457 puts into the body, and the words of the service are its message.
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
    """Base of all errors of the client."""


class Unreachable(ClientError):
    """The service gave no answer in the time over which calls are repeated."""


class WaitedTooLong(ClientError):
    """Something did not end in the time that was given; it goes on at the service."""


class FitFailed(ClientError):
    """A fit ended without a result.

    Args:
        fit_id: The fit.
        status: ``failed`` or ``cancelled``.
        error: The member `error` of the fit: why it failed; empty where it was cancelled.
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
    """The service refused a call.

    Args:
        status: HTTP status.
        body: The problem as the service told it.
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
    """The call carried no key, or one that is not valid."""


class NotFound(Problem):
    """There is no such thing in the workspace of the key."""


class Refused(Problem):
    """The request is at fault, and the same request would be refused again."""


class Busy(Problem):
    """The service cannot answer now and may be able to later."""


_KINDS: dict[int, type[Problem]] = {401: BadKey, 404: NotFound, 429: Busy, 503: Busy, 507: Busy}


def problem_from(status: int, body: object) -> Problem:
    """The error of an answer.

    Args:
        status: HTTP status.
        body: Content of the answer, where it was JSON.
    """
    kind = _KINDS.get(status, Refused if 400 <= status < 500 else Problem)
    return kind(status, body if isinstance(body, Mapping) else {})
