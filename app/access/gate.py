"""The gate: no route answers without a key unless it is named here.

The gate stands in front of the router and not in the routes, so that a route that someone adds, or
forgets, is closed.  It also stands before any byte of a body is read.

A call shows its key as ``Authorization: Bearer KEY``.  The web page shows it once and then carries
a cookie; since a browser sends cookies on its own, whatever changes something must come from the
page's own site, which the browser says in headers that no page can forge.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from anyio import to_thread
from sqlalchemy.exc import SQLAlchemyError
from starlette.datastructures import Headers
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from app.access.service import DEFAULT_WORKSPACE, AccessService, Caller
from app.errors import BadKey, CrossSite
from app.paths import HEALTH_PATHS, LOGIN_PATH, STATIC_PREFIX
from app.problems import database_error, problem_of

__all__ = ["COOKIE", "PUBLIC_PATHS", "Gate", "session_of"]

COOKIE = "motorid_session"
PUBLIC_PATHS = frozenset({LOGIN_PATH, *HEALTH_PATHS})
"""Paths that answer without a key: health, metrics, and the page that asks for one."""

_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


class Gate:
    """Lets through who shows a valid key, and tells the layers below who calls.

    Args:
        app: The layer below.
        access: Keys and sessions.
        no_auth: Let everyone through, into the default workspace.
    """

    def __init__(self, app: ASGIApp, access: AccessService, *, no_auth: bool) -> None:
        self.app = app
        self.access = access
        self.no_auth = no_auth

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            # There are no web sockets; closing before accepting answers 403.
            await send({"type": "websocket.close", "code": 1008})
            return
        headers = Headers(scope=scope)
        try:
            _refuse_other_sites(scope["method"], headers)
            path = scope["path"]
            if path not in PUBLIC_PATHS and not path.startswith(STATIC_PREFIX):
                scope.setdefault("state", {})["caller"] = await self._caller(headers)
        except BadKey as error:
            if _is_page(scope, headers):
                await RedirectResponse(LOGIN_PATH, status_code=303)(scope, receive, send)
                return
            await problem_of(error)(scope, receive, send)
            return
        except CrossSite as error:
            await problem_of(error)(scope, receive, send)
            return
        except SQLAlchemyError as error:
            refusal = database_error(error)
            if refusal is None:
                raise
            await problem_of(refusal)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    async def _caller(self, headers: Headers) -> Caller:
        if self.no_auth:
            return Caller(DEFAULT_WORKSPACE)
        authorization = headers.get("authorization")
        if authorization is not None:
            scheme, _, secret = authorization.partition(" ")
            if scheme.lower() != "bearer" or not secret.strip():
                raise BadKey("expected the header `Authorization: Bearer KEY`")
            return await to_thread.run_sync(self.access.caller_of_key, secret.strip())
        token = session_of(headers)
        if token is None:
            raise BadKey("no key was given; expected the header `Authorization: Bearer KEY`")
        return await to_thread.run_sync(self.access.caller_of_session, token)


def session_of(headers: Headers) -> str | None:
    """What the session's cookie holds, or None without one.

    The standard library's reader of cookies takes a time that grows with the square of the
    backslashes in a quoted value, before any key is asked for (CVE-2024-7592).
    """
    for part in headers.get("cookie", "").split(";"):
        name, _, value = part.strip().partition("=")
        if name == COOKIE:
            return value
    return None


def _refuse_other_sites(method: str, headers: Headers) -> None:
    """Refuse what a page of another site sends, however it is authorised.

    Browsers say where a request comes from; other programs send neither header and cannot be
    talked into a request by a page.
    """
    if method in _SAFE_METHODS:
        return
    site = headers.get("sec-fetch-site")
    origin = headers.get("origin")
    if site is not None:
        # Said by all browsers of today; the origin may be withheld even from one's own site.
        is_foreign = site not in ("same-origin", "none")
    else:
        own = headers.get("host", "").lower()
        is_foreign = origin is not None and urlsplit(origin).netloc.lower() != own
    if is_foreign:
        raise CrossSite("a page of another site sent this request; use the page of this service")


def _is_page(scope: Scope, headers: Headers) -> bool:
    return (
        scope["method"] == "GET"
        and not scope["path"].startswith("/api/")
        and "text/html" in headers.get("accept", "")
    )
