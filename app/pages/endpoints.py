"""Web pages, rendered on the server from the same services as the HTTP interface."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from app.access.service import Caller
from app.batches.schemas import BatchSummary
from app.composition import Services
from app.errors import BadKey, FileLost, NotFound, NotReady
from app.fits.exports import EXPORTS
from app.fits.schemas import FitOut, FitSummary
from app.http import API_PREFIX, LOGIN_PATH
from app.http.dependencies import CallerDep, ServicesDep
from app.http.gate import COOKIE, LONGEST_ADDRESS, own_address, session_of
from app.pages.analyses import router as analyses
from app.pages.choice import MotorFilter, choice_of
from app.pages.pending import finding_view, pending_list_view
from app.pages.rendering import Page
from app.pages.results import result_view
from app.pages.views import batch_view, fit_view
from app.texts import sentence

__all__ = ["router"]

router = APIRouter(include_in_schema=False)
router.include_router(analyses)

_MOST_BATCHES = 50
_MOST_FITS = 100
_ENDED = (
    "The session has ended, or its key was revoked or has expired, so the last action was not "
    "carried out; sign in again."
)
Back = Annotated[str, Query(alias="next", max_length=LONGEST_ADDRESS)]


@router.get("/")
def home(
    page: Page,
    services: ServicesDep,
    caller: CallerDep,
    motor: MotorFilter = None,
    after: Annotated[str | None, Query(max_length=200)] = None,
) -> HTMLResponse:
    """Start page with runs, batches and the newest fits, or the fits after a cursor."""
    fits, older = services.fits.page(caller, after=after, limit=_MOST_FITS)
    batches, earlier = services.batches.page(caller, after=None, limit=_MOST_BATCHES)
    return page(
        "home",
        pending=pending_list_view(services, caller),
        benches=services.pending.benches(caller),
        choice=choice_of(services, caller, motor),
        fits=[fit_view(FitSummary.of(fit), {}) for fit in fits],
        after=after,
        older=older,
        has_more_batches=earlier is not None,
        batches=[batch_view(BatchSummary.of(batch)) for batch in batches],
    )


@router.get("/docs")
def docs(page: Page) -> HTMLResponse:
    """Interactive documentation of the HTTP interface."""
    return page("docs", description=f"{API_PREFIX}/openapi.json")


@router.get(LOGIN_PATH)
def login(page: Page, request: Request, services: ServicesDep, back: Back = "/") -> Response:
    """Login page, which asks for a key; with ``?ended`` it says why a page led here."""
    if services.settings.no_auth:
        return RedirectResponse("/", status_code=303)
    problem = _ENDED if "ended" in request.query_params else None
    return page("login", problem=problem, back=own_address(back))


@router.post(LOGIN_PATH)
def sign_in(
    page: Page,
    request: Request,
    services: ServicesDep,
    key: Annotated[str, Form(max_length=200)],
    back: Annotated[str, Form(alias="next", max_length=LONGEST_ADDRESS)] = "/",
) -> Response:
    """Check a key, set a session cookie, and go back to the page that led to the login."""
    lifetime_s = services.settings.session_s
    try:
        token = services.access.open_session(key.strip(), lifetime_s)
    except BadKey as error:
        return page("login", status=401, problem=sentence(str(error)), back=own_address(back))
    answer = RedirectResponse(own_address(back), status_code=303)
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


@router.get("/fits/{fit_id}")
def fit_page(fit_id: str, page: Page, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Page of one fit: its progress, then its result."""
    fit = FitOut.of(services.fits.get(caller, fit_id))
    outcome = None
    if fit.result is not None:
        outcome = result_view(fit.result, _report(services, caller, fit_id))
    files = _files(services, caller, (*fit.training, *fit.validation))
    return page(
        "fit",
        fit=fit_view(fit, files),
        outcome=outcome,
        contradictions=[finding_view(one) for one in (fit.error and fit.error.findings) or ()],
        first_run=next(iter((*fit.validation, *fit.training)), ""),
        exports={form: name for form, (_, _, name) in EXPORTS.items()},
    )


def _files(services: Services, caller: Caller, run_ids: Iterable[str]) -> dict[str, str]:
    """File names of runs by ID."""
    files = {}
    for run_id in run_ids:
        try:
            files[run_id] = services.runs.get(caller, run_id).file
        except NotFound:
            files[run_id] = "deleted run"
    return files


def _report(services: Services, caller: Caller, fit_id: str) -> str:
    """Text of a report; empty if it cannot be read, because the page has more than its figures."""
    try:
        with services.fits.output(caller, fit_id, "report.html") as file:
            return file.read().decode("utf-8", "replace")
    except (FileLost, NotReady):
        return ""


@router.get("/fits/{fit_id}/report")
def report_page(fit_id: str, page: Page, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Report of a fit below the bar of the pages, with the way back."""
    # Closed at once; a fit without a report is an error of this page and not of its frame.
    services.fits.output(caller, fit_id, "report.html").close()
    motor = services.fits.row(caller, fit_id).motor
    return page(
        "framed",
        title=f"Report: {motor or 'motor without name'}",
        address=f"{API_PREFIX}/fits/{fit_id}/report{'?help' * bool(services.settings.help_dir)}",
        back=f"/fits/{fit_id}",
        back_text=motor or "Fit",
    )
