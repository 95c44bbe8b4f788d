"""HTTP endpoints of batches."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Response
from fastapi.responses import HTMLResponse

from app.access.service import Caller
from app.batches.schemas import BatchCreate, BatchList, BatchOut, BatchResults, BatchSummary
from app.composition import Services
from app.errors import NotAcceptable
from app.http.dependencies import (
    JSON_CALL,
    After,
    CallerDep,
    Limit,
    Remove,
    RequestKey,
    ServicesDep,
)
from app.http.headers import FLEET_POLICY
from app.http.problems import responses

__all__ = ["router"]

router = APIRouter(prefix="/batches", tags=["batches"])

Form = Literal["json", "csv", "parquet"]

_TYPES: dict[str, Form] = {
    "application/json": "json",
    "text/csv": "csv",
    "application/vnd.apache.parquet": "parquet",
}
_RANGES: dict[str, Form] = {"*/*": "json", "application/*": "json", "text/*": "csv"}
_MEDIA_TYPE: dict[Form, str] = {form: kind for kind, form in _TYPES.items()}
_TABLE: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "One row for each motor.",
        "content": {
            "text/csv": {"schema": {"type": "string"}},
            "application/vnd.apache.parquet": {"schema": {"type": "string", "format": "binary"}},
        },
    }
}


@router.post("", status_code=202, summary="Submit a batch", **JSON_CALL)
def create_batch(
    body: BatchCreate,
    response: Response,
    services: ServicesDep,
    caller: CallerDep,
    idempotency_key: RequestKey = None,
) -> BatchOut:
    """Submit one fit per motor. The batch is accepted or rejected as a whole.

    A failed fit does not stop the others.
    """
    batch = services.batches.create(caller, body.requests(), body.name, idempotency_key)
    response.headers["Location"] = f"/api/v1/batches/{batch.row.id}"
    return BatchOut.of(batch)


@router.get("", summary="List batches", responses=responses(422))
def list_batches(
    services: ServicesDep, caller: CallerDep, limit: Limit = 100, after: After = None
) -> BatchList:
    """List batches, newest first."""
    batches, following = services.batches.page(caller, after=after, limit=limit)
    return BatchList(items=[BatchSummary.of(batch) for batch in batches], next=following)


@router.get("/{batch_id}", summary="Show a batch", responses=responses(404))
def show_batch(batch_id: str, services: ServicesDep, caller: CallerDep) -> BatchOut:
    """Show the number of fits in each state and the state of each motor's fit."""
    return BatchOut.of(services.batches.get(caller, batch_id))


@router.delete(
    "/{batch_id}",
    summary="Cancel or remove a batch",
    response_model=BatchOut,
    responses={
        204: {"description": "The batch had ended and was removed."},
        **responses(403, 404, 422),
    },
)
def delete_batch(
    batch_id: str, services: ServicesDep, caller: CallerDep, remove: Remove = True
) -> BatchOut | Response:
    """Cancel the unfinished fits of a batch; if all have ended, delete the batch with its fits."""
    batch = services.batches.delete(caller, batch_id, remove=remove)
    return Response(status_code=204) if batch is None else BatchOut.of(batch)


@router.get(
    "/{batch_id}/results",
    summary="Fetch the results of a batch",
    response_model=BatchResults,
    responses=_TABLE | responses(404, 406),
)
def fetch_results(
    batch_id: str,
    services: ServicesDep,
    caller: CallerDep,
    accept: Annotated[
        str | None,
        Header(description="application/json, text/csv or application/vnd.apache.parquet."),
    ] = None,
) -> BatchResults | Response:
    """Fetch the table of parameters, intervals, effects and drift as JSON, CSV or Parquet."""
    return _results(services, caller, batch_id, _wanted(accept))


@router.get(
    "/{batch_id}/results.{form}",
    summary="Fetch the results of a batch in one format",
    response_model=BatchResults,
    responses=_TABLE | responses(404, 406, 422),
)
def fetch_results_as(
    batch_id: str, form: Form, services: ServicesDep, caller: CallerDep
) -> BatchResults | Response:
    """Fetch the same table in the format given by the suffix of the URL."""
    return _results(services, caller, batch_id, form)


@router.get(
    "/{batch_id}/report",
    summary="Fetch the fleet page",
    response_class=HTMLResponse,
    responses={
        200: {"description": "One self-contained page.", "content": {"text/html": {}}},
        **responses(404),
    },
)
def fetch_fleet(batch_id: str, services: ServicesDep, caller: CallerDep) -> HTMLResponse:
    """Fetch one page of all motors: parameter values in order, outliers and drift."""
    page = services.batches.report(caller, batch_id)
    return HTMLResponse(page, headers={"Content-Security-Policy": FLEET_POLICY})


def _results(
    services: Services, caller: Caller, batch_id: str, form: Form
) -> BatchResults | Response:
    if form == "json":
        batch, rows = services.batches.rows(caller, batch_id)
        return BatchResults(id=batch.row.id, status=batch.status, rows=rows)
    return Response(
        services.batches.table(caller, batch_id, form),
        media_type=f"{_MEDIA_TYPE[form]}{'; charset=utf-8' if form == 'csv' else ''}",
        headers={"Content-Disposition": f'attachment; filename="results.{form}"'},
    )


def _wanted(accept: str | None) -> Form:
    """Format that an Accept header prefers; JSON without a header."""
    best, wanted = 0.0, None
    for part in (accept or "*/*").split(","):
        kind, *words = (word.strip().lower() for word in part.split(";"))
        weight = next((_weight(word[2:]) for word in words if word.startswith("q=")), 1.0)
        form = _TYPES.get(kind) or _RANGES.get(kind)
        if form is not None and weight > best:
            best, wanted = weight, form
    if wanted is None:
        raise NotAcceptable(
            f"the table is not available as {(accept or '')[:100]!r}; expected {', '.join(_TYPES)}"
        )
    return wanted


def _weight(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return 0.0
