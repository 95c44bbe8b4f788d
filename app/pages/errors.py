"""Error pages: problem responses of the service as pages for people.

Every error of the service is an RFC 9457 problem in JSON.  A browser that opens an address gets a
page instead, and a page that exchanges one of its parts gets the sentence to show.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http import LOGIN_PATH
from app.http.gate import wants_page
from app.http.problems import MEDIA_TYPE
from app.pages.rendering import help_prefix, page

__all__ = ["ErrorPages"]


class ErrorPages:
    """Middleware that replaces problem responses to browsers."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; hold back a problem until it is complete."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        is_part = "hx-request" in Headers(scope=scope)
        if not is_part and not wants_page(scope):
            await self.app(scope, receive, send)
            return
        start: Message | None = None
        body = bytearray()

        async def answer(message: Message) -> None:
            nonlocal start
            if message["type"] == "http.response.start":
                kind = Headers(raw=message["headers"]).get("content-type", "")
                if kind.startswith(MEDIA_TYPE):
                    start = message
                    return
            if start is None:
                await send(message)
                return
            body.extend(message.get("body", b""))
            if not message.get("more_body", False):
                shown = _shown(json.loads(body), scope, Headers(raw=start["headers"]), is_part)
                await shown(scope, receive, send)

        await self.app(scope, receive, answer)


def _shown(problem: Mapping[str, Any], scope: Scope, given: Headers, is_part: bool) -> Response:
    """Page or part of a page for a problem, with the headers of the problem."""
    replaced = ("content-type", "content-length")
    headers = {name: value for name, value in given.items() if name not in replaced}
    status = int(problem["status"])
    if is_part and status == 401:
        # The browser opens the login page; it would show a redirect inside of the page.
        headers["HX-Redirect"] = LOGIN_PATH
    return page(
        "problem" if is_part else "error",
        status=status,
        headers=headers,
        caller=scope.get("state", {}).get("caller"),
        help=help_prefix(scope["app"].state.services),
        problem=problem,
        # After a refused sign-in or from another site, the start page is not accessible.
        has_home=status not in (401, 403),
    )
