"""HTTP endpoints of fits."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Depends, Header, Query, Response
from fastapi import Path as FormPath
from fastapi.responses import FileResponse, StreamingResponse

from app.fits.events import has_heard_the_end, last_version, stream
from app.fits.exports import EXPORTS
from app.fits.schemas import FitCreate, FitList, FitOut, FitSummary, Status
from app.fits.watcher import Listener
from app.http.dependencies import (
    JSON_CALL,
    After,
    CallerDep,
    Limit,
    OnlyMotor,
    Remove,
    RequestKey,
    ServicesDep,
)
from app.http.files import OpenFileResponse
from app.http.headers import FRAMED
from app.http.problems import responses

__all__ = ["router"]

router = APIRouter(prefix="/fits", tags=["fits"])

_EVENTS: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "Events until the fit ends.",
        "content": {
            "text/event-stream": {
                "example": "event: progress\nid: 7\n"
                'data: {"id": "fit_k5x2qv7wr3m4hd6ytnobczs5fi", "status": "running", '
                '"progress": {"stage": "posterior", "fraction": 0.42}, "attempt": 1, '
                '"error": null}\n\n'
            }
        },
    },
    204: {"description": "The client has received the end event."},
}


@router.post("", status_code=202, summary="Submit a fit", **JSON_CALL)
def create_fit(
    body: FitCreate,
    response: Response,
    services: ServicesDep,
    caller: CallerDep,
    idempotency_key: RequestKey = None,
) -> FitOut:
    """Submit a fit, which is computed in the background.

    `Location` is the URL of its status, its progress and finally its result.
    """
    fit = services.fits.create(caller, body.request(body.options), idempotency_key)
    response.headers["Location"] = f"/api/v1/fits/{fit.row.id}"
    return FitOut.of(fit)


@router.get("", summary="List fits", responses=responses(422))
def list_fits(
    services: ServicesDep,
    caller: CallerDep,
    limit: Limit = 100,
    after: After = None,
    status: Annotated[Status | None, Query(description="Only fits in this state.")] = None,
    motor: OnlyMotor = None,
) -> FitList:
    """List fits, newest first, without their results."""
    fits, following = services.fits.page(
        caller, after=after, limit=limit, status=status, motor=motor
    )
    return FitList(items=[FitSummary.of(fit) for fit in fits], next=following)


@router.get("/{fit_id}", summary="Show a fit", responses=responses(404))
def show_fit(fit_id: str, services: ServicesDep, caller: CallerDep) -> FitOut:
    """Show the status and progress of a fit, and its result once it has succeeded."""
    return FitOut.of(services.fits.get(caller, fit_id))


LastEvent = Annotated[
    str | None, Header(description="Version of the last event received; browsers send it.")
]


async def _listener(
    fit_id: str, services: ServicesDep, caller: CallerDep, last_event_id: LastEvent = None
) -> AsyncIterator[Listener | None]:
    """Subscription to a fit, which counts as open until the response has been sent.

    A client that has received the end needs none, so the limit of streams never refuses it.
    """
    row = await to_thread.run_sync(services.fits.row, caller, fit_id)
    if has_heard_the_end(row, last_version(last_event_id)):
        yield None
        return
    with services.watcher.listen(row, caller.key_id) as listener:
        yield listener


@router.get(
    "/{fit_id}/events",
    summary="Follow a fit",
    response_class=StreamingResponse,
    responses=_EVENTS | responses(404),
)
async def follow_fit(
    listener: Annotated[Listener | None, Depends(_listener)],
    services: ServicesDep,
    last_event_id: LastEvent = None,
) -> Response:
    """Stream status and progress as Server-Sent Events; the stream closes when the fit ends."""
    if listener is None:
        return Response(status_code=204)
    events = stream(
        listener,
        version=last_version(last_event_id),
        keep_alive_s=services.settings.keep_alive_s,
        is_stopping=services.stopping.is_set,
    )
    headers = {"X-Accel-Buffering": "no"}
    return StreamingResponse(events, media_type="text/event-stream", headers=headers)


@router.delete(
    "/{fit_id}",
    summary="Cancel or remove a fit",
    response_model=FitOut,
    responses={
        204: {"description": "The fit had ended and was removed."},
        **responses(403, 404, 422),
    },
)
def delete_fit(
    fit_id: str, services: ServicesDep, caller: CallerDep, remove: Remove = True
) -> FitOut | Response:
    """Cancel an unfinished fit; delete an ended one with its report and posterior."""
    fit = services.fits.delete(caller, fit_id, remove=remove)
    return Response(status_code=204) if fit is None else FitOut.of(fit)


@router.get(
    "/{fit_id}/report",
    summary="Fetch the report",
    response_class=FileResponse,
    responses={
        200: {"description": "One self-contained page.", "content": {"text/html": {}}},
        **responses(400, 404, 416),
    },
)
def fetch_report(fit_id: str, services: ServicesDep, caller: CallerDep) -> OpenFileResponse:
    """Fetch the HTML report of a succeeded fit."""
    return OpenFileResponse(
        services.fits.output(caller, fit_id, "report.html"),
        media_type="text/html; charset=utf-8",
        headers=FRAMED,
    )


@router.get(
    "/{fit_id}/posterior",
    summary="Fetch the posterior",
    response_class=FileResponse,
    responses={
        200: {"description": "Draws as NetCDF.", "content": {"application/x-netcdf": {}}},
        **responses(400, 404, 416),
    },
)
def fetch_posterior(fit_id: str, services: ServicesDep, caller: CallerDep) -> OpenFileResponse:
    """Fetch the posterior of a succeeded fit that was sampled, as NetCDF for ArviZ."""
    return OpenFileResponse(
        services.fits.output(caller, fit_id, "posterior.nc"),
        media_type="application/x-netcdf",
        filename=f"{fit_id}.nc",
    )


@router.get(
    "/{fit_id}/exports/{form}",
    summary="Export the motor",
    response_class=Response,
    responses={
        200: {
            "description": "A file in the format of another program.",
            "content": {
                kind: {} for kind in dict.fromkeys(kind for _, kind, _ in EXPORTS.values())
            },
        },
        **responses(404, 422, 503),
    },
)
def fetch_export(
    fit_id: str,
    form: Annotated[str, FormPath(description=f"Format: {', '.join(EXPORTS)}.")],
    services: ServicesDep,
    caller: CallerDep,
    temperature: Annotated[
        list[float] | None,
        Query(max_length=20, description="Temperatures of linear models [degC]; may be repeated."),
    ] = None,
) -> Response:
    """Fetch the motor of a succeeded fit as `motorid export` writes it."""
    content = services.fits.export(caller, fit_id, form, temperature or [])
    suffix, kind, _ = EXPORTS[form]
    return Response(
        content,
        media_type=kind,
        headers={"Content-Disposition": f'attachment; filename="{fit_id}{suffix}"'},
    )
