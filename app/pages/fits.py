"""Pages of a fit."""

from __future__ import annotations

from collections.abc import Iterable

from fastapi import APIRouter
from fastapi.responses import HTMLResponse

from app.access.service import Caller
from app.composition import Services
from app.errors import FileLost, NotFound, NotReady
from app.fits.schemas import FitOut
from app.http import API_PREFIX
from app.http.dependencies import CallerDep, ServicesDep
from app.pages.pending_views import finding_view
from app.pages.rendering import help_prefix, page
from app.pages.results import result_view
from app.pages.views import fit_view

__all__ = ["router"]

router = APIRouter(include_in_schema=False)


@router.get("/fits/{fit_id}")
def fit_page(fit_id: str, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Page of one fit: its progress, then its result."""
    fit = FitOut.of(services.fits.get(caller, fit_id))
    outcome = None
    if fit.result is not None:
        outcome = result_view(fit.result, _report(services, caller, fit_id))
    files = _files(services, caller, (*fit.training, *fit.validation))
    return page(
        "fit",
        caller=caller,
        help=help_prefix(services),
        fit=fit_view(fit, files),
        outcome=outcome,
        contradictions=[finding_view(one) for one in (fit.error and fit.error.findings) or ()],
        first_run=next(iter((*fit.validation, *fit.training)), ""),
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
        with services.fits.report(caller, fit_id) as file:
            return file.read().decode("utf-8", "replace")
    except (FileLost, NotReady):
        return ""


@router.get("/fits/{fit_id}/report")
def report_page(fit_id: str, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Report of a fit below the bar of the pages, with the way back."""
    # Closed at once; a fit without a report is an error of this page and not of its frame.
    services.fits.report(caller, fit_id).close()
    motor = services.fits.row(caller, fit_id).motor
    return page(
        "framed",
        caller=caller,
        help=help_prefix(services),
        title=f"Report: {motor or 'motor without name'}",
        address=f"{API_PREFIX}/fits/{fit_id}/report{'?help' * bool(services.settings.help_dir)}",
        back=f"/fits/{fit_id}",
        back_text=motor or "Fit",
    )
