"""Authentication middleware: every path needs a key unless it is listed as public here.

The check is outside the router, so that a new route is protected by default, and it runs before any
byte of a body is read.

API calls send the key as ``Authorization: Bearer KEY``.  The web page sends the key once and then
uses a session cookie.  Because browsers send cookies automatically, requests that change data must
come from a page of this service (CSRF protection); browsers report the origin in headers that no
page can forge.
"""

from __future__ import annotations

from urllib.parse import quote, urlsplit

from anyio import to_thread
from sqlalchemy.exc import SQLAlchemyError
from starlette.datastructures import Headers
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from app.access.service import DEFAULT_WORKSPACE, AccessService, Caller
from app.errors import BadKey, CrossSite
from app.http import API_PREFIX, HEALTH_PATHS, HELP_PREFIX, LOGIN_PATH, STATIC_PREFIX
from app.http.problems import database_error, problem_of

__all__ = [
    "COOKIE",
    "LONGEST_ADDRESS",
    "PUBLIC_PATHS",
    "PUBLIC_PREFIXES",
    "Gate",
    "login_address",
    "own_address",
    "session_of",
    "wants_page",
]

COOKIE = "motorid_session"
LONGEST_ADDRESS = 2000
"""Longest address to which a sign-in leads back [characters]."""
PUBLIC_PATHS = frozenset({LOGIN_PATH, *HEALTH_PATHS})
"""Paths that need no key: health, metrics and the login page."""
PUBLIC_PREFIXES = (STATIC_PREFIX, HELP_PREFIX)
"""Prefixes of files that need no key: those of the pages, and the documentation."""

_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


class Gate:
    """Middleware that admits requests with a valid key or session and records the client.

    With `no_auth` it admits everyone to the default workspace.
    """

    def __init__(self, app: ASGIApp, access: AccessService, *, no_auth: bool) -> None:
        self.app = app
        self.access = access
        self.no_auth = no_auth

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            # WebSockets are not supported; closing before accepting answers 403.
            await send({"type": "websocket.close", "code": 1008})
            return
        headers = Headers(scope=scope)
        path = scope["path"]
        try:
            _refuse_other_sites(scope["method"], headers)
            if path not in PUBLIC_PATHS and not path.startswith(PUBLIC_PREFIXES):
                scope.setdefault("state", {})["caller"] = await self._caller(headers)
        except (BadKey, CrossSite, SQLAlchemyError) as error:
            refusal = database_error(error) if isinstance(error, SQLAlchemyError) else error
            if refusal is None:
                raise
            if isinstance(error, BadKey) and scope["method"] == "GET" and wants_page(scope):
                query = scope["query_string"].decode("latin-1")
                address = login_address(f"{path}?{query}" if query else path)
                await RedirectResponse(address, status_code=303)(scope, receive, send)
            else:
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


def login_address(page: str, *, has_ended: bool = False) -> str:
    """Address of the login page, which then leads back to this page of the service."""
    back = f"next={quote(page, safe='/')}" if own_address(page) != "/" else ""
    query = "&".join(filter(None, ("ended" if has_ended else "", back)))
    return f"{LOGIN_PATH}?{query}" if query else LOGIN_PATH


def own_address(address: str) -> str:
    """The path and query of a page of this service; the start page for anything else.

    Browsers read ``//HOST`` as another site, treat a backslash as a slash and skip control
    characters.
    """
    is_path = address.startswith("/") and not address.startswith(("//", LOGIN_PATH))
    is_plain = address.isprintable() and "\\" not in address and len(address) <= LONGEST_ADDRESS
    return address if is_path and is_plain else "/"


def session_of(headers: Headers) -> str | None:
    """Value of the session cookie, or None if there is none.

    The cookie parser of the standard library takes quadratic time in the number of backslashes of a
    quoted value, before any authentication (CVE-2024-7592).
    """
    for part in headers.get("cookie", "").split(";"):
        name, _, value = part.strip().partition("=")
        if name == COOKIE:
            return value
    return None


def _refuse_other_sites(method: str, headers: Headers) -> None:
    """Reject requests that a page of another site sent, even if authenticated.

    Browsers report the origin of a request.  Other programs send neither header, and no page can
    make them send a request.
    """
    if method in _SAFE_METHODS:
        return
    site = headers.get("sec-fetch-site")
    origin = headers.get("origin")
    if site is not None:
        # All current browsers send it; Origin may be missing even on same-origin requests.
        is_foreign = site not in ("same-origin", "none")
    else:
        own = headers.get("host", "").lower()
        is_foreign = origin is not None and urlsplit(origin).netloc.lower() != own
    if is_foreign:
        raise CrossSite("a page of another site sent this request; use the page of this service")


def wants_page(scope: Scope) -> bool:
    """Return True if a browser opens the address and expects a page, such as a report."""
    path = scope["path"]
    is_call = path.startswith(f"{API_PREFIX}/") and not path.endswith("/report")
    return not is_call and "text/html" in Headers(scope=scope).get("accept", "")
