"""Parts of the start page that show pending runs and take corrections of their mapping."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse

from app.access.service import Caller
from app.composition import Services
from app.http import PENDING_PATH
from app.http.dependencies import CallerDep, ServicesDep
from app.pages.mapping_form import mapping_from
from app.pages.pending_views import pending_list_view, pending_view
from app.pages.rendering import help_prefix, page
from app.runs.endpoints import receive

__all__ = ["router"]

router = APIRouter(prefix=PENDING_PATH, include_in_schema=False)

_FIELDS = {"motor": 1_000, "bench": 1_000}

Label = Annotated[str, Form(max_length=1_000)]


@router.get("")
def show_all(services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """All pending runs."""
    return _section(services, caller)


@router.post("")
async def add(request: Request, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Receive and examine one file."""
    services.reading.check()
    upload = await receive(request, services, _FIELDS)
    try:
        row = await services.reading.run(services.pending.add, caller, upload)
    finally:
        upload.path.unlink(missing_ok=True)
    return page("pending_run", run=pending_view(row), help=help_prefix(services))


@router.post("/labels")
async def relabel(
    services: ServicesDep, caller: CallerDep, motor: Label = "", bench: Label = ""
) -> HTMLResponse:
    """Set motor and bench of all pending runs."""
    services.reading.check()
    await services.reading.run(services.pending.relabel, caller, motor, bench)
    return await to_thread.run_sync(_section, services, caller)


@router.post("/confirm")
def confirm(services: ServicesDep, caller: CallerDep) -> Response:
    """Make runs of all pending runs that can be read, and show them."""
    services.pending.confirm(caller)
    return Response(status_code=204, headers={"HX-Refresh": "true"})


@router.post("/{run_id}/reopen")
async def reopen(run_id: str, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Make a pending run of a stored run, to correct its mapping."""
    services.reading.check()
    await services.reading.run(services.pending.reopen, caller, run_id)
    return await to_thread.run_sync(_section, services, caller)


@router.post("/{run_id}/mapping")
async def correct(
    run_id: str, request: Request, services: ServicesDep, caller: CallerDep
) -> HTMLResponse:
    """Examine a pending run with the mapping selected in its form."""
    row = await to_thread.run_sync(services.pending.get, caller, run_id)
    async with request.form(max_files=0, max_fields=100) as form:
        texts = {name: value for name, value in form.items() if isinstance(value, str)}
    mapping = mapping_from(texts, row.mapping or {})
    services.reading.check()
    row = await services.reading.run(services.pending.correct, caller, run_id, mapping)
    rows = await to_thread.run_sync(services.pending.all, caller)
    # The button above the list counts the runs that can be added now.
    return page(
        "pending_corrected",
        run=pending_view(row),
        pending=pending_list_view(rows),
        help=help_prefix(services),
    )


@router.delete("/{run_id}")
def discard(run_id: str, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Discard a pending run."""
    services.pending.discard(caller, run_id)
    return _section(services, caller)


@router.get("/{run_id}/samples")
def samples(run_id: str, services: ServicesDep, caller: CallerDep) -> JSONResponse:
    """Samples to plot, in SI units."""
    return JSONResponse(services.pending.get(caller, run_id).found["samples"])


def _section(services: Services, caller: Caller) -> HTMLResponse:
    return page(
        "pending",
        pending=pending_list_view(services.pending.all(caller)),
        help=help_prefix(services),
    )
