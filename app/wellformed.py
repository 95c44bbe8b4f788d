"""Middleware for malformed requests, rejected before authentication, and for HEAD requests.

A request with both ``Content-Length`` and ``Transfer-Encoding`` can smuggle a second request past a
proxy that evaluates the other header (RFC 9112, section 6.3).
"""

from __future__ import annotations

from urllib.parse import parse_qsl

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import BadRequest, FieldRefused
from app.problems import problem_of
from app.texts import check_text

__all__ = ["HeadCheck", "WellFormed"]


class WellFormed:
    """Middleware that rejects two body lengths, and invalid characters in query or headers.

    Args:
        app: Inner ASGI application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request if it is well formed."""
        if scope["type"] == "http":
            try:
                _check(scope)
            except (BadRequest, FieldRefused) as error:
                problem = problem_of(error)
                if isinstance(error, BadRequest):
                    # The message boundary is ambiguous, so the connection cannot be reused.
                    problem.headers["Connection"] = "close"
                await problem(scope, receive, send)
                return
        await self.app(scope, receive, send)


class HeadCheck:
    """Middleware that answers HEAD like GET, without a body.

    The response ends after its headers, so that an event stream is not followed.

    Args:
        app: Inner ASGI application.
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


def _check(scope: Scope) -> None:
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
