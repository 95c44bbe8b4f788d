"""HTTP endpoints of analyses."""

from __future__ import annotations

from fastapi import APIRouter

from app.analyses.schemas import FeedbackIn, FeedbackOut
from app.http.dependencies import CallerDep, JsonBody, ServicesDep
from app.http.problems import responses

__all__ = ["router"]

router = APIRouter(prefix="/fits", tags=["fits"])

_DRAWS = 2000


@router.post(
    "/{fit_id}/feedback",
    summary="Compute the speed loop",
    dependencies=[JsonBody],
    responses=responses(400, 403, 404, 413, 415, 422, 503),
)
def compute_feedback(
    fit_id: str, body: FeedbackIn, services: ServicesDep, caller: CallerDep
) -> FeedbackOut:
    """Compute metrics and step responses of the speed loop with any controller and temperature.

    The numbers follow from the posterior of a succeeded fit and are not stored.
    """
    loop = services.analyses.loop(caller, fit_id, body.controllers, body.temperatures, draws=_DRAWS)
    return FeedbackOut.of(loop)
