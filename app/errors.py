"""What the service refuses on its own account, as one tree.

    ServiceError
    ├── NotFound               no such run, fit, batch or page, or not in this workspace
    │   └── NotReady           the fit has no such output, not yet or not at all
    ├── RequestRefused         the request itself is at fault
    │   ├── BadRequest         it cannot be understood
    │   ├── BadKey             no key, or one that is not valid
    │   ├── CrossSite          a page of another site sent it
    │   ├── BodyTooLarge       more bytes than the limit
    │   ├── BodyTooSlow        no byte came for too long, or not all in time
    │   ├── WrongMediaType     another kind of body than the call takes
    │   ├── NotAcceptable      the answer is wanted in a form that there is none in
    │   ├── RangeOutside       bytes are asked for that the file does not have
    │   ├── FieldRefused       a field has a value that is not accepted
    │   ├── KeyReused          an Idempotency-Key came with another request than before
    │   └── RunRefused         an upload could not be read as a run: file, row, column
    ├── TooManyRequests        a key calls more often than it may
    │   ├── TooManyStreams     or has as many event streams open as it may
    │   └── TooManyUploads     as many uploads wait to be read as may
    ├── QuotaExceeded          the workspace has as much as it may have
    │   ├── BytesQuota         of bytes of run files
    │   ├── RunsQuota          of runs
    │   ├── WaitingQuota       of fits that wait
    │   └── BatchQuota         the batch alone has more fits than may wait
    ├── RunInUse               a run of a fit that has not ended cannot be deleted
    └── Unavailable            not now: the service stops or its storage does not answer
        ├── StorageFull        no space is left
        ├── FileLost           a stored file is missing or damaged
        └── DatabaseDamaged    the database file is

The words for the caller stand here, the HTTP statuses in `app.problems`.
"""

from __future__ import annotations

from typing import ClassVar

__all__ = [
    "BadKey",
    "BadRequest",
    "BatchQuota",
    "BodyTooLarge",
    "BodyTooSlow",
    "BytesQuota",
    "CrossSite",
    "DatabaseDamaged",
    "FieldRefused",
    "FileLost",
    "KeyReused",
    "NotAcceptable",
    "NotFound",
    "NotReady",
    "QuotaExceeded",
    "RangeOutside",
    "RequestRefused",
    "RunInUse",
    "RunRefused",
    "RunsQuota",
    "ServiceError",
    "StorageFull",
    "TooManyRequests",
    "TooManyStreams",
    "TooManyUploads",
    "Unavailable",
    "WaitingQuota",
    "WrongMediaType",
]


class ServiceError(Exception):
    """Base of what the service refuses; `code` is a stable word for scripts.

    Args:
        message: What was wrong, what was expected, what to do next.
    """

    code: ClassVar[str] = "service"

    def __init__(self, message: str) -> None:
        self.message = message
        super().__init__(message)


class NotFound(ServiceError):
    """There is no such thing in the caller's workspace."""

    code: ClassVar[str] = "not_found"


class NotReady(NotFound):
    """The fit has no such output."""

    code: ClassVar[str] = "not_ready"


class RequestRefused(ServiceError):
    """The request is at fault."""

    code: ClassVar[str] = "request"


class BadRequest(RequestRefused):
    """The request cannot be understood."""

    code: ClassVar[str] = "bad_request"


class BadKey(RequestRefused):
    """No key was given, or one that is not valid."""

    code: ClassVar[str] = "unauthorized"


class CrossSite(RequestRefused):
    """A page of another site sent the request."""

    code: ClassVar[str] = "cross_site"


class BodyTooLarge(RequestRefused):
    """The body has more bytes than the limit."""

    code: ClassVar[str] = "too_large"


class BodyTooSlow(RequestRefused):
    """The body stopped coming, or was not whole in time."""

    code: ClassVar[str] = "too_slow"


class WrongMediaType(RequestRefused):
    """The body is of another kind than the call takes."""

    code: ClassVar[str] = "media_type"


class NotAcceptable(RequestRefused):
    """The answer is wanted in a form that there is none in."""

    code: ClassVar[str] = "not_acceptable"


class RangeOutside(RequestRefused):
    """The Range header asks for bytes that the file does not have.

    Args:
        content_range: What the file has, as the header Content-Range says it.
    """

    code: ClassVar[str] = "range"

    def __init__(self, content_range: str) -> None:
        self.content_range = content_range
        size = content_range.rpartition("/")[2]
        super().__init__(f"the Range header asks for other bytes than the {size} that there are")


class FieldRefused(RequestRefused):
    """A field of the request has a value that is not accepted.

    Args:
        message: What was wrong, what was expected, what to do next.
        field: Name of the field.
    """

    code: ClassVar[str] = "field"

    def __init__(self, message: str, field: str) -> None:
        self.field = field
        super().__init__(message)


class KeyReused(RequestRefused):
    """An Idempotency-Key came back with another request."""

    code: ClassVar[str] = "idempotency_key_reused"


class RunRefused(RequestRefused):
    """An upload could not be read as a run.

    Args:
        message: What was wrong, what was expected, what to do next.
        reason: Stable word of the reader, such as ``missing_column``.
        file: Name of the file as the caller gave it.
        row: Line of that file, counted from 1.
        column: Name of the column as it stands in the file.
    """

    code: ClassVar[str] = "run_file"

    def __init__(
        self,
        message: str,
        *,
        reason: str,
        file: str | None = None,
        row: int | None = None,
        column: str | None = None,
    ) -> None:
        self.reason = reason
        self.file = file
        self.row = row
        self.column = column
        super().__init__(message)


class TooManyRequests(ServiceError):
    """A key calls more often than it may.

    Args:
        message: What was wrong, what was expected, what to do next.
        retry_after_s: Time after which the next call is let through [s].
    """

    code: ClassVar[str] = "rate_limited"

    def __init__(self, message: str, retry_after_s: float) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(message)


class TooManyStreams(TooManyRequests):
    """A key has as many event streams open as it may."""

    code: ClassVar[str] = "too_many_streams"

    def __init__(self, message: str) -> None:
        super().__init__(message, retry_after_s=10.0)


class TooManyUploads(TooManyRequests):
    """As many uploads, of all keys, wait to be read as may."""

    code: ClassVar[str] = "too_many_uploads"


class QuotaExceeded(ServiceError):
    """The workspace has as much of something as it may have."""

    code: ClassVar[str] = "quota"


class BytesQuota(QuotaExceeded):
    """The run files of the workspace would have more bytes than it may keep."""

    code: ClassVar[str] = "quota_bytes"


class RunsQuota(QuotaExceeded):
    """The workspace has as many runs as it may."""

    code: ClassVar[str] = "quota_runs"


class WaitingQuota(QuotaExceeded):
    """More fits of the workspace would wait than may."""

    code: ClassVar[str] = "quota_waiting_fits"
    retry_after_s: ClassVar[float] = 60.0


class BatchQuota(QuotaExceeded):
    """A batch has more fits than may wait, so that waiting would not help it."""

    code: ClassVar[str] = "quota_batch"


class RunInUse(ServiceError):
    """A run cannot be deleted while a fit needs it."""

    code: ClassVar[str] = "run_in_use"


class Unavailable(ServiceError):
    """The service cannot answer now and may be able to later."""

    code: ClassVar[str] = "unavailable"


class StorageFull(Unavailable):
    """No space is left for what was sent."""

    code: ClassVar[str] = "storage_full"


class FileLost(Unavailable):
    """A file that the service stored is missing, or is not what was written."""

    code: ClassVar[str] = "file_lost"


class DatabaseDamaged(Unavailable):
    """The file of the database is damaged."""

    code: ClassVar[str] = "database_damaged"
