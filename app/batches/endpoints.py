"""Calls about batches."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header, Query, Response

from app.batches.schemas import BatchCreate, BatchList, BatchOut
from app.dependencies import CallerDep, JsonBody, ServicesDep
from app.problems import responses

__all__ = ["router"]

router = APIRouter(prefix="/batches", tags=["batches"])


@router.post(
    "",
    status_code=202,
    summary="Begin a batch",
    dependencies=[JsonBody],
    responses=responses(400, 403, 404, 413, 415, 422),
)
def create_batch(
    body: BatchCreate,
    response: Response,
    services: ServicesDep,
    caller: CallerDep,
    idempotency_key: Annotated[
        str | None,
        Header(description="A word of your own: the same word and request are the same batch."),
    ] = None,
) -> BatchOut:
    """Accept a fit for each motor, all of them or none; one that fails stops no other."""
    batch = services.batches.create(caller, body.requests(), body.name, idempotency_key)
    response.headers["Location"] = f"/api/v1/batches/{batch.row.id}"
    return BatchOut.of(batch)


@router.get("", summary="List batches", responses=responses(422))
def list_batches(
    services: ServicesDep,
    caller: CallerDep,
    limit: Annotated[int, Query(ge=1, le=1000, description="Most batches of a page.")] = 100,
    after: Annotated[
        str | None, Query(max_length=200, description="`next` of the page before.")
    ] = None,
) -> BatchList:
    """Batches, newest first."""
    return BatchList.of(*services.batches.page(caller, after=after, limit=limit))


@router.get("/{batch_id}", summary="Show a batch", responses=responses(404))
def show_batch(batch_id: str, services: ServicesDep, caller: CallerDep) -> BatchOut:
    """How many fits are in each state, and each motor's fit."""
    return BatchOut.of(services.batches.get(caller, batch_id))


@router.delete(
    "/{batch_id}",
    summary="Cancel or remove a batch",
    response_model=BatchOut,
    responses={204: {"description": "It had ended and was removed."}, **responses(403, 404)},
)
def delete_batch(batch_id: str, services: ServicesDep, caller: CallerDep) -> BatchOut | Response:
    """Cancel the fits that have not ended; where all have, remove the batch and its fits."""
    batch = services.batches.delete(caller, batch_id)
    return Response(status_code=204) if batch is None else BatchOut.of(batch)
