"""Pages of analyses: the speed loop with other controllers and temperatures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from app.analyses.service import LoopAnalysis
from app.fits.schemas import FitSummary
from app.http.dependencies import CallerDep, ServicesDep
from app.pages.loop_form import LoopForm
from app.pages.rendering import page
from app.pages.views import fit_view
from identification.errors import InputError

__all__ = ["router"]

router = APIRouter(include_in_schema=False)

_DRAWS = 400
"""Draws of the page, which shall answer while the gains are typed."""


@router.get("/fits/{fit_id}/loop")
def loop_page(
    fit_id: str, request: Request, services: ServicesDep, caller: CallerDep
) -> HTMLResponse:
    """Step response and metrics of the speed loop, with a form for controller and temperatures."""
    fit = services.analyses.succeeded(caller, fit_id)
    form = LoopForm.of(request.query_params, fit.result or {})
    problem, shown = "", None
    try:
        loop = services.analyses.loop(
            caller, fit_id, [form.controller], form.temperatures, draws=_DRAWS
        )
        shown = _loop_view(loop, fit.result or {})
    except InputError as error:
        message = str(error)
        problem = f"{message[0].upper()}{message[1:]}."
    is_part = "hx-request" in request.headers
    return page(
        "loop",
        # htmx shows the refusal in the place of the step response only if the answer is a success.
        status=422 if problem and not is_part else 200,
        caller=caller,
        fit=fit_view(FitSummary.of(fit), {}),
        form=form,
        problem=problem,
        loop=shown,
    )


def _loop_view(loop: LoopAnalysis, result: Mapping[str, Any]) -> dict[str, Any]:
    """View of a speed loop: the figure and the table of the report."""
    from identification.report.figures.curves import step_figure
    from identification.report.tables import feedback_tables
    from identification.result.attempts import figure
    from identification.result.numbers import listed

    return {
        "figure": figure("step response", step_figure, loop.steps),
        "tables": feedback_tables(loop.feedback),
        "effects": listed([str(e["name"]).replace("_", " ") for e in result.get("effects") or ()]),
        "remarks": loop.remarks,
    }
