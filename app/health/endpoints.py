"""Calls about health, which need no key."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel

from app.dependencies import ServicesDep
from app.metrics import MEDIA_TYPE

__all__ = ["router"]

router = APIRouter(tags=["health"])


class Health(BaseModel):
    """That the service lives."""

    status: Literal["ok"] = "ok"


class Readiness(BaseModel):
    """Whether the service can do its work, and what of it."""

    status: Literal["ready", "not ready"]
    checks: dict[str, bool]


@router.get("/healthz", summary="Does it live?")
async def healthz() -> Health:
    """Answers as long as the service answers anything."""
    return Health()


@router.get(
    "/readyz",
    summary="Can it work?",
    responses={503: {"model": Readiness, "description": "Something that it needs is not there."}},
)
def readyz(services: ServicesDep, response: Response) -> Readiness:
    """Whether database, storage and supervisor are there; 503 where one is not."""
    checks = services.health.checks()
    is_ready = all(checks.values())
    response.status_code = 200 if is_ready else 503
    return Readiness(status="ready" if is_ready else "not ready", checks=checks)


@router.get(
    "/metrics",
    summary="Metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
def metrics(services: ServicesDep) -> Response:
    """Requests, uploads, the queue and the ends of fits, in Prometheus' text format."""
    return Response(services.health.metrics(), media_type=MEDIA_TYPE)
