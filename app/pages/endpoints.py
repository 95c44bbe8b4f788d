"""Web pages, rendered on the server from the same services as the HTTP interface."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from app.batches.schemas import BatchSummary
from app.errors import BadKey
from app.fits.schemas import FitSummary
from app.http import API_PREFIX, LOGIN_PATH
from app.http.dependencies import CallerDep, ServicesDep
from app.http.gate import COOKIE, session_of
from app.pages.analyses import router as analyses
from app.pages.choice import MotorFilter, choice_of
from app.pages.fits import router as fits
from app.pages.pending_views import pending_list_view
from app.pages.rendering import help_prefix, page
from app.pages.views import batch_view, fit_view
from app.texts import sentence

__all__ = ["router"]

router = APIRouter(include_in_schema=False)
router.include_router(fits)
router.include_router(analyses)

_MOST_BATCHES = 50


@router.get("/")
def home(services: ServicesDep, caller: CallerDep, motor: MotorFilter = None) -> HTMLResponse:
    """Start page with runs, fits and batches."""
    fits, _ = services.fits.page(caller, after=None, limit=100, status=None, motor=None)
    batches, _ = services.batches.page(caller, after=None, limit=_MOST_BATCHES)
    return page(
        "home",
        caller=caller,
        help=help_prefix(services),
        pending=pending_list_view(services.pending.all(caller)),
        benches=services.pending.benches(caller),
        choice=choice_of(services, caller, motor),
        fits=[fit_view(FitSummary.of(fit), {}) for fit in fits],
        batches=[batch_view(BatchSummary.of(batch)) for batch in batches],
    )


@router.get("/docs")
def docs(services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Interactive documentation of the HTTP interface."""
    return page(
        "docs", caller=caller, help=help_prefix(services), description=f"{API_PREFIX}/openapi.json"
    )


@router.get(LOGIN_PATH)
def login(services: ServicesDep) -> Response:
    """Login page, which asks for a key."""
    if services.settings.no_auth:
        return RedirectResponse("/", status_code=303)
    return page("login", problem=None)


@router.post(LOGIN_PATH)
def sign_in(
    request: Request, services: ServicesDep, key: Annotated[str, Form(max_length=200)]
) -> Response:
    """Check a key and set a session cookie."""
    lifetime_s = services.settings.session_s
    try:
        token = services.access.open_session(key.strip(), lifetime_s)
    except BadKey as error:
        return page("login", status=401, problem=sentence(error.message))
    answer = RedirectResponse("/", status_code=303)
    answer.set_cookie(
        COOKIE,
        token,
        max_age=int(lifetime_s),
        httponly=True,
        samesite="strict",
        secure=services.settings.secure_cookies or request.url.scheme == "https",
    )
    return answer


@router.post("/logout")
def sign_out(request: Request, services: ServicesDep, caller: CallerDep) -> Response:
    """End the session of this browser."""
    token = session_of(request.headers)
    if token is not None:
        services.access.close_session(token)
    answer = RedirectResponse(LOGIN_PATH, status_code=303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="strict")
    return answer
