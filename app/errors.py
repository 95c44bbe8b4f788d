"""Error classes of the service.

    ServiceError
    ├── NotFound               no such run, fit, batch or page in the client's workspace
    │   └── NotReady           the fit has no such output, or not yet
    ├── RequestRefused         the request is at fault
    │   ├── BadRequest         malformed request
    │   ├── BadKey             missing or invalid API key
    │   ├── CrossSite          request sent by a page of another site
    │   ├── BodyTooLarge       body larger than the limit
    │   ├── BodyTooSlow        body stalled, or incomplete at its deadline
    │   ├── WrongMediaType     body of a media type that the call does not take
    │   ├── NotAcceptable      no representation that the Accept header allows
    │   ├── RangeOutside       requested byte range outside the file
    │   ├── FieldRefused       value of a field not accepted
    │   ├── KeyReused          Idempotency-Key repeated with a different request
    │   └── RunRefused         upload not readable as a run: file, row, column
    ├── TooManyRequests        rate limit of the key exceeded
    │   ├── TooManyStreams     too many open event streams of the key
    │   └── TooManyUploads     queue of uploads to be read is full
    ├── QuotaExceeded          quota of the workspace reached
    │   ├── BytesQuota         bytes of run files
    │   ├── RunsQuota          number of runs
    │   ├── WaitingQuota       number of waiting fits
    │   └── BatchQuota         one batch larger than the quota of waiting fits
    ├── RunInUse               run needed by an unfinished fit; it cannot be deleted
    └── Unavailable            temporarily unavailable: shutdown, or storage not responding
        ├── StorageFull        no space left
        ├── FileLost           stored file missing or damaged
        └── DatabaseDamaged    database file damaged

The messages are defined here, the HTTP statuses in `app.http.problems`.
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
    """Base class; `code` is a stable identifier for scripts.

    Args:
        message: What was wrong, what was expected, what to do next.
    """

    code: ClassVar[str] = "service"

    def __init__(self, message: str) -> None:
        self.message = message
        super().__init__(message)


class NotFound(ServiceError):
    """Item missing in the client's workspace."""

    code: ClassVar[str] = "not_found"


class NotReady(NotFound):
    """Output that the fit does not have, or not yet."""

    code: ClassVar[str] = "not_ready"


class RequestRefused(ServiceError):
    """Fault of the request."""

    code: ClassVar[str] = "request"


class BadRequest(RequestRefused):
    """Malformed request."""

    code: ClassVar[str] = "bad_request"


class BadKey(RequestRefused):
    """Missing or invalid API key."""

    code: ClassVar[str] = "unauthorized"


class CrossSite(RequestRefused):
    """Request sent by a page of another site."""

    code: ClassVar[str] = "cross_site"


class BodyTooLarge(RequestRefused):
    """Body larger than the limit."""

    code: ClassVar[str] = "too_large"


class BodyTooSlow(RequestRefused):
    """Body stalled, or incomplete at its deadline."""

    code: ClassVar[str] = "too_slow"


class WrongMediaType(RequestRefused):
    """Body of a media type that the call does not take."""

    code: ClassVar[str] = "media_type"


class NotAcceptable(RequestRefused):
    """No representation that the Accept header allows."""

    code: ClassVar[str] = "not_acceptable"


class RangeOutside(RequestRefused):
    """Range header that asks for bytes outside the file.

    Args:
        content_range: Value of the Content-Range header, with the size of the file.
    """

    code: ClassVar[str] = "range"

    def __init__(self, content_range: str) -> None:
        self.content_range = content_range
        size = content_range.rpartition("/")[2]
        super().__init__(
            f"the Range header is outside the file; expected a range within its {size} bytes"
        )


class FieldRefused(RequestRefused):
    """Value of a request field that is not accepted.

    Args:
        message: What was wrong, what was expected, what to do next.
        field: Name of the field.
    """

    code: ClassVar[str] = "field"

    def __init__(self, message: str, field: str) -> None:
        self.field = field
        super().__init__(message)


class KeyReused(RequestRefused):
    """Idempotency-Key repeated with a different request."""

    code: ClassVar[str] = "idempotency_key_reused"


class RunRefused(RequestRefused):
    """Upload not readable as a run.

    Args:
        message: What was wrong, what was expected, what to do next.
        reason: Error code of the reader, such as ``missing_column``.
        file: Name of the file as given by the client.
        row: Line number in the file, counted from 1.
        column: Name of the column as written in the file.
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
    """Rate limit of a key exceeded.

    Args:
        message: What was wrong, what was expected, what to do next.
        retry_after_s: Time until the next call is accepted [s].
    """

    code: ClassVar[str] = "rate_limited"

    def __init__(self, message: str, retry_after_s: float) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(message)


class TooManyStreams(TooManyRequests):
    """Too many open event streams of a key."""

    code: ClassVar[str] = "too_many_streams"

    def __init__(self, message: str) -> None:
        super().__init__(message, retry_after_s=10.0)


class TooManyUploads(TooManyRequests):
    """Queue of uploads to be read, shared by all keys, is full."""

    code: ClassVar[str] = "too_many_uploads"


class QuotaExceeded(ServiceError):
    """Quota of the workspace reached."""

    code: ClassVar[str] = "quota"


class BytesQuota(QuotaExceeded):
    """Quota of bytes of the workspace's run files."""

    code: ClassVar[str] = "quota_bytes"


class RunsQuota(QuotaExceeded):
    """Quota of runs of the workspace."""

    code: ClassVar[str] = "quota_runs"


class WaitingQuota(QuotaExceeded):
    """Quota of waiting fits of the workspace."""

    code: ClassVar[str] = "quota_waiting_fits"
    retry_after_s: ClassVar[float] = 60.0


class BatchQuota(QuotaExceeded):
    """Batch that alone exceeds the quota of waiting fits; a retry would fail, too."""

    code: ClassVar[str] = "quota_batch"


class RunInUse(ServiceError):
    """Run that cannot be deleted because an unfinished fit needs it."""

    code: ClassVar[str] = "run_in_use"


class Unavailable(ServiceError):
    """Service temporarily unavailable; a later retry may succeed."""

    code: ClassVar[str] = "unavailable"


class StorageFull(Unavailable):
    """No space left for the data of the request."""

    code: ClassVar[str] = "storage_full"


class FileLost(Unavailable):
    """Stored file missing, or different from what was written."""

    code: ClassVar[str] = "file_lost"


class DatabaseDamaged(Unavailable):
    """Damaged database file."""

    code: ClassVar[str] = "database_damaged"
