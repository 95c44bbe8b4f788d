"""Requests that contradict themselves or hold texts that are no texts: refused before the gate.

Both ``Content-Length`` and ``Transfer-Encoding`` in one request is how requests are smuggled past
a proxy that believes the other one (RFC 9112, section 6.3).
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
    """Refuses requests with two lengths, or with control characters in the query or a header.

    Args:
        app: The layer below.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on if it is well formed."""
        if scope["type"] == "http":
            try:
                _check(scope)
            except (BadRequest, FieldRefused) as error:
                problem = problem_of(error)
                if isinstance(error, BadRequest):
                    # What follows on the connection may be another request, or not.
                    problem.headers["Connection"] = "close"
                await problem(scope, receive, send)
                return
        await self.app(scope, receive, send)


class HeadCheck:
    """Answers HEAD as GET without its body, which the server leaves out.

    The answer ends behind its headers, so that no stream of events is followed.

    Args:
        app: The layer below.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, a HEAD request as GET."""
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
            # By which the request is logged and counted.
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
