"""RFC 9457 problem responses: the table from error class to HTTP status, and the error handlers."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import Field
from sqlalchemy.exc import DatabaseError, SQLAlchemyError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from app import errors
from app.damage import is_damaged
from app.database import NO_ANSWER
from app.disk import is_full
from app.logging import request_id
from app.texts import Documented, with_example
from identification.errors import InputError

__all__ = [
    "MEDIA_TYPE",
    "STATUS",
    "Problem",
    "add_problem_handlers",
    "database_error",
    "problem_of",
    "responses",
    "unexpected_problem",
]

MEDIA_TYPE = "application/problem+json"

STATUS: dict[type[Exception], HTTPStatus] = {
    errors.NotFound: HTTPStatus.NOT_FOUND,
    errors.BadRequest: HTTPStatus.BAD_REQUEST,
    errors.BadKey: HTTPStatus.UNAUTHORIZED,
    errors.CrossSite: HTTPStatus.FORBIDDEN,
    errors.NotOwner: HTTPStatus.FORBIDDEN,
    errors.BodyTooLarge: HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    errors.BodyTooSlow: HTTPStatus.REQUEST_TIMEOUT,
    errors.WrongMediaType: HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    errors.NotAcceptable: HTTPStatus.NOT_ACCEPTABLE,
    errors.RangeOutside: HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE,
    errors.FieldRefused: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.KeyReused: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.RunRefused: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.RunInUse: HTTPStatus.CONFLICT,
    errors.TooManyRequests: HTTPStatus.TOO_MANY_REQUESTS,
    errors.QuotaExceeded: HTTPStatus.FORBIDDEN,
    errors.BytesQuota: HTTPStatus.INSUFFICIENT_STORAGE,
    errors.WaitingQuota: HTTPStatus.TOO_MANY_REQUESTS,
    errors.StorageFull: HTTPStatus.INSUFFICIENT_STORAGE,
    errors.Unavailable: HTTPStatus.SERVICE_UNAVAILABLE,
    InputError: HTTPStatus.UNPROCESSABLE_ENTITY,
}
"""HTTP status of each error class; an unlisted class has the status of its nearest base class."""

_WORDS = {
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "too_large",
    HTTPStatus.UNSUPPORTED_MEDIA_TYPE: "media_type",
}
_MOST_ERRORS = 20
_NOT_KNOWN = "not known; /docs lists the members of the request"
_log = logging.getLogger(__name__)


class FieldProblem(Documented):
    """One field of the request that was not accepted."""

    field: str = Field(examples=["body.training.0"])
    """Position of the field in the request."""
    detail: str
    """Fault of the field and expected value."""


class Problem(Documented):
    """Problem details (RFC 9457)."""

    model_config = with_example(
        {
            "type": "urn:motorid:problem:not_a_number",
            "title": "Unprocessable Entity",
            "status": 422,
            "detail": "run3.csv, row 412, column current_A: 'n/a' is not a number; "
            "expected amperes",
            "code": "not_a_number",
            "file": "run3.csv",
            "row": 412,
            "column": "current_A",
            "request_id": "4be1f2d0c5a94b6e",
        }
    )

    type: str
    """URN of the problem type."""
    title: str
    """Standard phrase of the HTTP status."""
    status: int
    """HTTP status."""
    detail: str
    """Fault, expected value and remedy."""
    code: str
    """Stable identifier for scripts."""
    file: str | None = None
    """File at fault, as the caller named it."""
    row: int | None = None
    """Line of that file, counted from 1."""
    column: str | None = None
    """Column of that file."""
    errors: list[FieldProblem] | None = None
    """Fields that were not accepted."""
    request_id: str | None = None
    """ID of the request in the log."""


def responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """OpenAPI entries for the given error statuses and for those that any call can return."""
    return {
        status: {
            "model": Problem,
            "description": HTTPStatus(status).phrase,
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        }
        for status in (*statuses, 401, 429, 503)
    }


def problem_of(error: errors.ServiceError | InputError) -> JSONResponse:
    """Problem response for an error."""
    status = next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)
    place: dict[str, Any] = {name: getattr(error, name, None) for name in ("file", "row", "column")}
    fields = None
    if isinstance(error, errors.FieldRefused):
        fields = [FieldProblem(field=error.field, detail=str(error))]
    code = str(getattr(error, "reason", None) or getattr(error, "code", "input"))
    headers = {}
    if status == HTTPStatus.UNAUTHORIZED:
        headers["WWW-Authenticate"] = 'Bearer realm="motorid"'
    if status == HTTPStatus.REQUEST_TIMEOUT:
        # The remaining body would be parsed as the next request.
        headers["Connection"] = "close"
    is_lasting = isinstance(error, errors.FileLost | errors.DatabaseDamaged)
    if status == HTTPStatus.SERVICE_UNAVAILABLE and not is_lasting:
        headers["Retry-After"] = "5"
    if status == HTTPStatus.TOO_MANY_REQUESTS:
        headers["Retry-After"] = str(math.ceil(getattr(error, "retry_after_s", 1.0)))
    if isinstance(error, errors.RangeOutside):
        headers["Content-Range"] = error.content_range
    return _response(status, str(error), code, headers=headers, errors=fields, **place)


def add_problem_handlers(application: FastAPI) -> None:
    """Register handlers that answer every error with a problem response."""
    application.add_exception_handler(errors.ServiceError, _service)
    application.add_exception_handler(InputError, _service)
    application.add_exception_handler(RequestValidationError, _validation)
    application.add_exception_handler(HTTPException, _http)
    for kind in (*NO_ANSWER, DatabaseError):
        application.add_exception_handler(kind, _database)
    application.add_exception_handler(OSError, _system)
    application.add_exception_handler(ClientDisconnect, _gone)
    application.add_exception_handler(Exception, _unexpected)


def database_error(error: SQLAlchemyError) -> errors.Unavailable | None:
    """Error to report to the client for a database error; None for a fault of the service."""
    if is_damaged(error):
        return errors.DatabaseDamaged(
            "the database is damaged; the operator must restore it from a backup"
        )
    if is_full(error):
        return errors.StorageFull(
            "the disk of the database is full; ask the operator to free space, then try again"
        )
    if isinstance(error, NO_ANSWER):
        return errors.Unavailable("the database does not respond; try again in a few seconds")
    return None


def unexpected_problem() -> JSONResponse:
    """Problem response for a fault of the service, whose log has the exception."""
    return _response(
        HTTPStatus.INTERNAL_SERVER_ERROR,
        "internal error of the service; report the request ID to its operator, who finds the cause "
        "in the log",
        "internal",
    )


def _response(
    status: HTTPStatus,
    detail: str,
    code: str,
    *,
    headers: Mapping[str, str] | None = None,
    **more: Any,
) -> JSONResponse:
    body = Problem(
        type=f"urn:motorid:problem:{code}",
        title=status.phrase,
        status=status,
        detail=detail,
        code=code,
        request_id=request_id.get(),
        **more,
    )
    return JSONResponse(
        body.model_dump(mode="json", exclude_none=True),
        status_code=status,
        headers=dict(headers or {}),
        media_type=MEDIA_TYPE,
    )


async def _service(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, errors.ServiceError | InputError)
    if isinstance(error, errors.QuotaExceeded | errors.TooManyStreams | errors.TooManyUploads):
        request.app.state.services.metrics.refused.labels(error.code).inc()
    return problem_of(error)


async def _validation(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    found = error.errors()
    if any(entry["type"] == "json_invalid" for entry in found):
        return _response(HTTPStatus.BAD_REQUEST, "the body is not valid JSON", "bad_json")
    fields = [
        FieldProblem(
            field=".".join(str(part) for part in entry["loc"]),
            detail=_NOT_KNOWN
            if entry["type"] == "extra_forbidden"
            else entry["msg"].removeprefix("Value error, "),
        )
        for entry in found[:_MOST_ERRORS]
    ]
    first = fields[0]
    return _response(
        HTTPStatus.UNPROCESSABLE_ENTITY,
        f"{first.field}: {first.detail}",
        "validation",
        errors=fields,
    )


async def _http(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    detail = {
        HTTPStatus.NOT_FOUND: "this URL does not exist; /docs lists the calls",
        HTTPStatus.METHOD_NOT_ALLOWED: "this URL does not support the method of the request",
        HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "the request is larger than the limit",
    }.get(status, str(error.detail))
    code = _WORDS.get(status, status.name.lower())
    return _response(status, detail, code, headers=error.headers)


async def _database(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, SQLAlchemyError)
    found = database_error(error)
    if found is None:
        raise error
    if isinstance(found, errors.DatabaseDamaged):
        _log.critical("the database is damaged", exc_info=error)
    return problem_of(found)


async def _system(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, OSError)
    if is_full(error):
        return problem_of(
            errors.StorageFull("the disk is full; ask the operator to free space, then try again")
        )
    _log.error("operating system error", exc_info=error)
    return problem_of(
        errors.Unavailable(f"the data directory is not accessible ({error.strerror}); try again")
    )


async def _gone(request: Request, error: Exception) -> JSONResponse:
    return problem_of(errors.BadRequest("the client disconnected before the request was complete"))


async def _unexpected(request: Request, error: Exception) -> JSONResponse:
    return unexpected_problem()
