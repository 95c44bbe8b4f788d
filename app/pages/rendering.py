"""Rendering of the page templates, the static files that the pages load, and error pages.

Every error of the service is an RFC 9457 problem in JSON.  A browser that opens an address gets a
page instead, and a page that exchanges one of its parts gets the sentence to show.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlsplit

from fastapi import Depends, Request
from fastapi.responses import HTMLResponse
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http import HELP_PREFIX
from app.http.gate import login_address, wants_page
from app.http.problems import MEDIA_TYPE
from identification.reporting.page import page_environment

__all__ = ["PLOT_FILES", "STATIC_FILES", "ErrorPages", "Page", "refusal"]

STATIC_FILES = Path(__file__).parent / "static"
"""Style sheets and scripts of the pages."""

PLOT_FILES = Path(str(files("identification"))) / "reporting" / "templates" / "vendor"
"""uPlot, as bundled with the report."""


def _pages_for(request: Request) -> Callable[..., HTMLResponse]:
    """Renderer of templates that shows the client of a request and links to the documentation."""
    has_help = request.app.state.services.settings.help_dir is not None
    caller = getattr(request.state, "caller", None)
    return partial(_page, caller=caller, help=HELP_PREFIX if has_help else "")


Page = Annotated[Callable[..., HTMLResponse], Depends(_pages_for)]
"""Renderer of the templates for a request: ``page(TEMPLATE, status=200, **variables)``."""


def _page(
    template: str, *, status: int = 200, headers: dict[str, str] | None = None, **values: Any
) -> HTMLResponse:
    """Render a template, whose name has no ending, with these variables."""
    text = page_environment("app.pages").get_template(f"{template}.html.j2").render(values)
    return HTMLResponse(text, status_code=status, headers=headers)


def refusal(problem: str, part: str) -> dict[str, Any]:
    """Status and headers of a page with a problem, for htmx; empty if there is no problem."""
    if not problem:
        return {}
    headers = {"HX-Retarget": part, "HX-Reselect": part, "HX-Reswap": "outerHTML"}
    return {"status": 422, "headers": headers}


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


def _shown(problem: Mapping[str, Any], scope: Scope, given: Headers, is_part: bool) -> HTMLResponse:
    """Page or part of a page for a problem, with the headers of the problem."""
    replaced = ("content-type", "content-length")
    headers = {name: value for name, value in given.items() if name not in replaced}
    status = int(problem["status"])
    if is_part and status == 401:
        # The browser opens the login page; it would show a redirect inside of the page.
        opened = urlsplit(Headers(scope=scope).get("hx-current-url", "/"))
        page = f"{opened.path}?{opened.query}" if opened.query else opened.path
        headers["HX-Redirect"] = login_address(page, has_ended=True)
    return _pages_for(Request(scope))(
        "problem" if is_part else "error",
        status=status,
        headers=headers,
        problem=problem,
        # After a refused sign-in or from another site, the start page is not accessible.
        has_home=status not in (401, 403),
    )
