"""Pages of analyses: speed loop, tuning, predicted and next run, a motor over time, two fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import HTMLResponse

from app.access.service import Caller
from app.composition import Services
from app.errors import FieldRefused, RunRefused
from app.fits.schemas import FitSummary
from app.fits.service import StoredFit
from app.http.dependencies import CallerDep, IsWanted, ServicesDep
from app.pages.analysis_views import (
    by_motor,
    design_view,
    history_view,
    loop_view,
    prediction_view,
    tuning_view,
)
from app.pages.forms import FIELDS, DesignForm, LoopForm, PredictionForm, TuningForm
from app.pages.rendering import Page, refusal
from app.pages.results import comparison_view
from app.pages.views import fit_view
from app.texts import sentence
from identification.errors import InputError

if TYPE_CHECKING:
    from identification.speed_loop import StepCurve

__all__ = ["router"]

router = APIRouter(include_in_schema=False)

_MOST_FITS = 100
_MOST_RUNS = 200
_TUNING_DRAWS = 200
_DRAWS = 400
"""Draws of the page, which shall answer while the gains are typed."""


@router.get("/fits/{fit_id}/loop")
def loop_page(
    fit_id: str, page: Page, request: Request, services: ServicesDep, caller: CallerDep
) -> HTMLResponse:
    """Step response and metrics of the speed loop, with a form for controller and temperatures."""
    fit = services.analyses.succeeded(caller, fit_id)
    form = LoopForm.of(request.query_params, fit.result or {})
    problem, shown = "", None
    try:
        loop = services.analyses.loop(
            caller, fit_id, [form.controller], form.temperatures, draws=_DRAWS
        )
        shown = loop_view(loop, fit.result or {})
    except InputError as error:
        problem = sentence(str(error))
    return _answered(page, "loop", "#loop-result", problem, fit, form=form, loop=shown)


@router.get("/fits/{fit_id}/tuning")
def tuning_page(
    fit_id: str,
    page: Page,
    request: Request,
    services: ServicesDep,
    caller: CallerDep,
    is_wanted: IsWanted,
) -> HTMLResponse:
    """Form of a specification and, once it is sent, the controller that suits it."""
    fit = services.analyses.succeeded(caller, fit_id)
    form = TuningForm.of(request.query_params, fit.result or {})
    problem, shown = "", None
    try:
        if request.query_params:
            found, remarks = services.analyses.tuning(
                caller, fit_id, draws=_TUNING_DRAWS, is_wanted=is_wanted, **form.options()
            )
            shown = tuning_view(found, remarks)
    except (InputError, RunRefused) as error:
        problem = sentence(str(error))
    return _answered(
        page, "tuning", "#answer", problem, fit, form=form, fields=FIELDS, tuning=shown
    )


@router.get("/fits/{fit_id}/prediction")
def prediction_page(
    fit_id: str,
    page: Page,
    services: ServicesDep,
    caller: CallerDep,
    form: Annotated[PredictionForm, Query()],
    is_wanted: IsWanted,
) -> HTMLResponse:
    """A stored run, measured and simulated with the model of a fit, and a form to select it."""
    fit = services.analyses.succeeded(caller, fit_id)
    run, after = form.run, form.after or None
    listed, older = services.runs.page(caller, after=after, limit=_MOST_RUNS, motor=None)
    runs = {one.id: one for one in listed}
    if not after and fit.row.motor:
        # The runs of the motor, however many others are newer.
        own, _ = services.runs.page(caller, after=None, limit=_MOST_RUNS, motor=fit.row.motor)
        runs |= {one.id: one for one in own}
    problem, shown, file = "", None, ""
    if run:
        # A selected run may be older than all that the list holds.
        runs.setdefault(run, services.runs.get(caller, run))
    if run and not after:
        try:
            row, found = services.analyses.prediction(
                caller, fit_id, run, declared=form.declared, is_wanted=is_wanted
            )
            file, shown = row.file, prediction_view(row.file, found)
        except RunRefused as error:
            problem = f"{error}."
    return page(
        "prediction",
        status=422 if problem else 200,
        fit=fit_view(FitSummary.of(fit), {}),
        training=fit.training,
        runs=by_motor(list(runs.values()), fit.row.motor),
        listed=len(listed),
        after=after,
        older=older,
        chosen=run,
        declared=form.declared,
        file=file,
        problem=problem,
        prediction=shown,
    )


@router.get("/fits/{fit_id}/design")
def design_page(
    fit_id: str,
    page: Page,
    request: Request,
    services: ServicesDep,
    caller: CallerDep,
    is_wanted: IsWanted,
) -> HTMLResponse:
    """Form of the next run, and the expected gain once it was submitted."""
    fit = services.analyses.succeeded(caller, fit_id)
    form, problem, shown = DesignForm.of(request.query_params), "", None
    if request.query_params:
        try:
            found = services.analyses.design(caller, fit_id, form.options, is_wanted=is_wanted)
            shown = design_view(found)
        except (InputError, FieldRefused, RunRefused) as error:
            problem = sentence(str(error))
    effects = (fit.result or {}).get("effects") or ()
    query = urlencode(request.query_params)
    tied = [effect["name"] for effect in effects if effect.get("alternatives")]
    return _answered(
        page, "design", "#answer", problem, fit, form=form, query=query, tied=tied, design=shown
    )


@router.get("/fits/{fit_id}/design.csv")
def design_file(
    fit_id: str, request: Request, services: ServicesDep, caller: CallerDep, is_wanted: IsWanted
) -> Response:
    """Profile of the next run as a file; the query is that of the page."""
    form = DesignForm.of(request.query_params)
    design = services.analyses.design(caller, fit_id, form.options, is_wanted=is_wanted)
    return Response(
        design.table,
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{fit_id}-next.csv"'},
    )


def _answered(
    page: Page, template: str, part: str, problem: str, fit: StoredFit, **values: Any
) -> HTMLResponse:
    """Page of a form of a fit with its answer; with a problem, htmx shows only this part."""
    view = fit_view(FitSummary.of(fit), {})
    return page(template, **refusal(problem, part), fit=view, problem=problem, **values)


@router.get("/motor")
def motor_page(
    page: Page,
    services: ServicesDep,
    caller: CallerDep,
    name: Annotated[str, Query(max_length=200)],
    after: Annotated[str, Query(max_length=200)] = "",
) -> HTMLResponse:
    """Page of a motor: its newest fits or those after a cursor, and its parameters over them."""
    fits, refits, older = services.analyses.history(
        caller, name, after=after or None, limit=_MOST_FITS
    )
    shown = [fit_view(FitSummary.of(fit), {}) for fit in fits]
    return page(
        "motor",
        motor=name,
        fits=shown,
        after=after,
        older=older,
        history=history_view(refits, {fit["id"]: fit["created_at"] for fit in shown}),
    )


@router.get("/compare")
def compare_page(
    page: Page,
    services: ServicesDep,
    caller: CallerDep,
    fit: Annotated[list[str] | None, Query(max_length=20)] = None,
    after: Annotated[str, Query(max_length=200)] = "",
) -> HTMLResponse:
    """Two fits side by side, the older one first, and a form to select others."""
    chosen = [one for one in dict.fromkeys(fit or ()) if one]
    choices, older = services.fits.page(
        caller, after=after or None, limit=_MOST_FITS, status="succeeded"
    )
    listed = [fit_view(FitSummary.of(one), {}) for one in choices]
    both = [services.analyses.succeeded(caller, fit_id) for fit_id in chosen[:2]]
    problem, comparison = "", None
    if len(chosen) == 2 and not after:
        both.sort(key=lambda one: one.row.created_at)
        steps, problem = _compared_steps(services, caller, both)
        comparison = comparison_view([one.result or {} for one in both], steps)
    elif len(fit or ()) > 1 and not after:
        problem = f"Select two different fits (selected: {len(chosen)})."
    selected = [fit_view(FitSummary.of(one), {}) for one in both]
    return page(
        "compare",
        fits=selected,
        chosen=[*(one["id"] for one in selected), "", ""][:2],
        # A selected fit may be older than all that the list holds.
        choices=[*selected, *(one for one in listed if one not in selected)],
        listed=len(listed),
        after=after,
        older=older,
        problem=problem,
        comparison=comparison,
    )


def _compared_steps(
    services: Services, caller: Caller, fits: Sequence[StoredFit]
) -> tuple[list[Sequence[StepCurve]], str]:
    """Step responses of two fits with the first controller of the first one, or why there are none.

    The coldest and the hottest temperature of the first fit are shown.
    """
    form = LoopForm.of({}, fits[0].result or {})
    try:
        asked = sorted(form.temperatures)
        ends = list(dict.fromkeys((asked[0], asked[-1])))
        loops = [
            services.analyses.loop(caller, one.row.id, [form.controller], ends, draws=_DRAWS)
            for one in fits
        ]
    except InputError as error:
        return [(), ()], f"The step responses cannot be computed: {error}."
    return [loop.steps for loop in loops], ""
