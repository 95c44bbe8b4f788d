"""HTTP endpoints of health and metrics; they require no key."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel

from app.http.dependencies import ServicesDep
from app.metrics import MEDIA_TYPE

__all__ = ["router"]

router = APIRouter(tags=["health"])


class Health(BaseModel):
    """Liveness of the service."""

    status: Literal["ok"] = "ok"


class Readiness(BaseModel):
    """Readiness of the service, with the outcome of each check."""

    status: Literal["ready", "not ready"]
    checks: dict[str, bool]


@router.get("/healthz", summary="Does it live?")
async def healthz() -> Health:
    """Confirm that the service answers requests."""
    return Health()


@router.get(
    "/readyz",
    summary="Can it work?",
    responses={503: {"model": Readiness, "description": "Something that it needs is not there."}},
)
def readyz(services: ServicesDep, response: Response) -> Readiness:
    """Check the database, the storage and the supervisor; the status is 503 if a check fails."""
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
    """Metrics of requests, uploads, the queue and ended fits, in the text format of Prometheus."""
    return Response(services.health.metrics(), media_type=MEDIA_TYPE)
