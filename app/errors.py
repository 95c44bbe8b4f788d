"""Error classes of the service.

    ServiceError
    ├── NotFound               no such run, fit, batch or page in the client's workspace
    │   └── NotReady           the fit has no such output, or not yet
    ├── RequestRefused         the request is at fault
    │   ├── BadRequest         malformed request
    │   ├── BadKey             missing or invalid API key
    │   ├── NotOwner           key that may not manage keys
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
    "NotOwner",
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
    """Base class; each class names its `code`, a stable identifier for scripts.

    The message says what was wrong, what was expected and what to do next.
    """

    code: ClassVar[str]

    def __init_subclass__(cls, *, code: str) -> None:
        super().__init_subclass__()
        cls.code = code


class NotFound(ServiceError, code="not_found"):
    """Item missing in the client's workspace."""


class NotReady(NotFound, code="not_ready"):
    """Output that the fit does not have, or not yet."""


class RequestRefused(ServiceError, code="request"):
    """Fault of the request."""


class BadRequest(RequestRefused, code="bad_request"):
    """Malformed request."""


class BadKey(RequestRefused, code="unauthorized"):
    """Missing or invalid API key."""


class NotOwner(RequestRefused, code="not_owner"):
    """Keys requested with a key that may not manage them."""


class CrossSite(RequestRefused, code="cross_site"):
    """Request sent by a page of another site."""


class BodyTooLarge(RequestRefused, code="too_large"):
    """Body larger than the limit."""


class BodyTooSlow(RequestRefused, code="too_slow"):
    """Body stalled, or incomplete at its deadline."""


class WrongMediaType(RequestRefused, code="media_type"):
    """Body of a media type that the call does not take."""


class NotAcceptable(RequestRefused, code="not_acceptable"):
    """No representation that the Accept header allows."""


class RangeOutside(RequestRefused, code="range"):
    """Range header that asks for bytes outside the file, whose size is in `content_range`."""

    def __init__(self, content_range: str) -> None:
        self.content_range = content_range
        size = content_range.rpartition("/")[2]
        super().__init__(
            f"the Range header is outside the file; expected a range within its {size} bytes"
        )


class FieldRefused(RequestRefused, code="field"):
    """Value of a request field that is not accepted."""

    def __init__(self, message: str, field: str) -> None:
        self.field = field
        super().__init__(message)


class KeyReused(RequestRefused, code="idempotency_key_reused"):
    """Idempotency-Key repeated with a different request."""


class RunRefused(RequestRefused, code="run_file"):
    """Upload not readable as a run; `reason` is the reader's code, such as ``missing_column``."""

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


class TooManyRequests(ServiceError, code="rate_limited"):
    """Rate limit of a key exceeded; the next call is accepted after `retry_after_s` [s]."""

    def __init__(self, message: str, retry_after_s: float = 10.0) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(message)


class TooManyStreams(TooManyRequests, code="too_many_streams"):
    """Too many open event streams of a key."""


class TooManyUploads(TooManyRequests, code="too_many_uploads"):
    """Queue of uploads to be read, shared by all keys, is full."""


class QuotaExceeded(ServiceError, code="quota"):
    """Quota of the workspace reached."""


class BytesQuota(QuotaExceeded, code="quota_bytes"):
    """Quota of bytes of the workspace's run files."""


class RunsQuota(QuotaExceeded, code="quota_runs"):
    """Quota of runs of the workspace."""


class WaitingQuota(QuotaExceeded, code="quota_waiting_fits"):
    """Quota of waiting fits of the workspace."""

    retry_after_s: ClassVar[float] = 60.0


class BatchQuota(QuotaExceeded, code="quota_batch"):
    """Batch that alone exceeds the quota of waiting fits; a retry would fail, too."""


class RunInUse(ServiceError, code="run_in_use"):
    """Run that cannot be deleted because an unfinished fit needs it."""


class Unavailable(ServiceError, code="unavailable"):
    """Service temporarily unavailable; a later retry may succeed."""


class StorageFull(Unavailable, code="storage_full"):
    """No space left for the data of the request."""


class FileLost(Unavailable, code="file_lost"):
    """Stored file missing, or different from what was written."""


class DatabaseDamaged(Unavailable, code="database_damaged"):
    """Damaged database file."""
