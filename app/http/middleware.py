"""ASGI middleware: request id, log, metrics, security headers, host check and size limit.

    request -> RequestLog -> ErrorPages -> UnexpectedErrors -> check_crowd -> check_form
            -> host_check -> Gate -> RateLimit -> size_check -> BodyDeadline -> HeadCheck
            -> endpoint

`ErrorPages` is in `app.pages.rendering`, `Gate` in `app.http.gate`, `RateLimit` in `app.http.rate`,
`check_crowd` and `BodyDeadline` in `app.http.connections`.

A request with both ``Content-Length`` and ``Transfer-Encoding`` can smuggle a second request past a
proxy that evaluates the other header (RFC 9112, section 6.3).

These are plain ASGI layers that forward each message as it arrives, so that event streams and large
files are not buffered.
"""

from __future__ import annotations

import logging
import re
import secrets
import time
from collections.abc import Callable, Collection, Mapping
from urllib.parse import parse_qsl

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import BadRequest, BodyTooLarge, FieldRefused, ServiceError, WrongMediaType
from app.http import API_PREFIX, HEALTH_PATHS, STATIC_PREFIX
from app.http.headers import SECURITY_HEADERS, STATIC_CACHE
from app.http.problems import problem_of, unexpected_problem
from app.logging import request_id
from app.metrics import Metrics
from app.texts import check_text

__all__ = [
    "HeadCheck",
    "RequestCheck",
    "RequestLog",
    "UnexpectedErrors",
    "check_form",
    "host_check",
    "size_check",
]

_GIVEN_ID = re.compile(r"[A-Za-z0-9_-]{8,64}")
_log = logging.getLogger("app.requests")


class RequestLog:
    """Middleware for request ids, log, metrics and security headers."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        current = given if _GIVEN_ID.fullmatch(given) else secrets.token_hex(8)
        request_id.set(current)
        status = 500
        began = time.perf_counter()

        async def answer(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = current
                if scope["path"].startswith(STATIC_PREFIX):
                    headers["Cache-Control"] = STATIC_CACHE
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        try:
            await self.app(scope, receive, answer)
        finally:
            self._record(scope, status, time.perf_counter() - began)

    def _record(self, scope: Scope, status: int, seconds: float) -> None:
        route = _template(scope)
        method = scope["method"] if scope["method"] in _METHODS else "other"
        self.metrics.requests.labels(method, route, str(status)).inc()
        self.metrics.request_seconds.labels(method, route).observe(seconds)
        _log.log(
            logging.DEBUG if route in HEALTH_PATHS else logging.INFO,
            "request",
            extra={
                "method": method,
                "path": scope["path"][:200],
                "status": status,
                "milliseconds": round(1000 * seconds, 1),
                "workspace": getattr(scope.get("state", {}).get("caller"), "workspace", None),
            },
        )


_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


def _template(scope: Scope) -> str:
    """Route path with parameter names in place of ids, which must not become metric labels."""
    path = getattr(scope.get("route"), "path", None)
    if not isinstance(path, str):
        return "none"
    # A route's path is relative to its router.
    is_call = scope["path"].startswith(f"{API_PREFIX}/") and not path.startswith(API_PREFIX)
    return API_PREFIX + path if is_call else path


class UnexpectedErrors:
    """Middleware that logs an unexpected exception and answers with a problem response.

    The handler of the framework is outside of all middleware, so its answer has neither the headers
    of the service nor a page for browsers.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; an exception after the first byte of the answer aborts it."""
        has_begun = False

        async def answer(message: Message) -> None:
            nonlocal has_begun
            has_begun = True
            await send(message)

        try:
            await self.app(scope, receive, answer)
        except Exception:  # any exception is a fault of the service
            if scope["type"] != "http" or has_begun:
                raise
            _log.exception("unexpected error")
            await unexpected_problem()(scope, receive, send)


class RequestCheck:
    """Middleware that answers a request with the error that a check of its scope raises.

    After an error of the classes `closing`, the connection cannot be reused.
    """

    def __init__(
        self,
        app: ASGIApp,
        check: Callable[[Scope], None],
        closing: tuple[type[ServiceError], ...] = (),
    ) -> None:
        self.app = app
        self.check = check
        self.closing = closing

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            if scope["type"] == "http":
                self.check(scope)
        except ServiceError as error:
            problem = problem_of(error)
            if isinstance(error, self.closing):
                problem.headers["Connection"] = "close"
            await problem(scope, receive, send)
            return
        await self.app(scope, receive, send)


def host_check(hosts: Collection[str]) -> Callable[[Scope], None]:
    """Check that rejects requests whose Host header is not a name of this service.

    This prevents DNS rebinding: otherwise a page of another site could resolve its own name to this
    machine and read, in a local user's browser, the responses of a service without keys.

    The names have no port; ``*`` accepts any.
    """
    accepted = {host.lower() for host in hosts}

    def check(scope: Scope) -> None:
        host = _without_port(Headers(scope=scope).get("host", ""))
        if not accepted & {"*", host}:
            raise BadRequest("the Host header names another service; see MOTORID_ALLOWED_HOSTS")

    return check


def size_check(most: int, limits: Mapping[str, int]) -> Callable[[Scope], None]:
    """Check that rejects compressed bodies and excessive Content-Length before reading.

    The framework counts the bytes of bodies without Content-Length as they arrive.

    The limits are in bytes, `limits` those of single paths.
    """

    def check(scope: Scope) -> None:
        headers = Headers(scope=scope)
        coding = headers.get("content-encoding", "identity").strip().lower()
        if coding not in ("", "identity"):
            # Decompression is not supported: it would turn a small body into a large one.
            raise WrongMediaType(f"the body is encoded as {coding[:40]!r}; send it plain")
        announced = headers.get("content-length", "")
        limit = limits.get(scope["path"], most)
        if announced.isascii() and announced.isdigit() and int(announced) > limit:
            raise BodyTooLarge(f"the body has {announced} bytes; at most {limit} are taken")

    return check


def check_form(scope: Scope) -> None:
    """Reject two body lengths, and invalid characters in query or headers.

    Raises:
        BadRequest: The request has two lengths, so the message boundary is ambiguous.
        FieldRefused: A character is invalid.
    """
    headers = Headers(scope=scope)
    if "content-length" in headers and "transfer-encoding" in headers:
        raise BadRequest("Content-Length and Transfer-Encoding contradict each other; send one")
    for name, value in headers.items():
        if any(letter < " " and letter != "\t" or letter == "\x7f" for letter in value):
            raise FieldRefused(f"{name}: expected no control characters", name)
    query = scope["query_string"].decode("latin-1")
    for name, value in parse_qsl(query, keep_blank_values=True):
        check_text("query", name)
        check_text(f"query.{name}", value)


class HeadCheck:
    """Middleware that answers HEAD like GET, without a body.

    The response ends after its headers, so that an event stream is not followed.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; HEAD becomes GET."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                await send(message)
                await send({"type": "http.response.body", "body": b"", "more_body": False})

        as_get = {**scope, "method": "GET"}
        try:
            await self.app(as_get, receive, answer)
        finally:
            # The log and the metrics use the route.
            if "route" in as_get:
                scope["route"] = as_get["route"]


def _without_port(host: str) -> str:
    name, colon, port = host.lower().rpartition(":")
    # An IPv6 address with a port is in brackets.
    has_port = colon and port.isdigit() and (":" not in name or name.endswith("]"))
    return name if has_port else host.lower()
