"""HTTP endpoints of analyses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Depends, Query
from fastapi.responses import FileResponse

from app.analyses.schemas import (
    DesignIn,
    DesignOut,
    FeedbackIn,
    FeedbackOut,
    PredictionOut,
    TuningIn,
    TuningOut,
)
from app.errors import FieldRefused
from app.http.dependencies import JSON_CALL, CallerDep, IsWanted, ServicesDep
from app.http.files import OpenFileResponse
from app.http.problems import responses

__all__ = ["designs", "router"]

router = APIRouter(prefix="/fits", tags=["fits"])
designs = APIRouter(prefix="/designs", tags=["designs"])

_DRAWS = 2000
_TUNING_DRAWS = 200


@dataclass(frozen=True)
class _Prediction:
    """Parameters of both endpoints of a prediction."""

    caller: CallerDep
    fit_id: str
    run_id: str
    is_wanted: IsWanted
    declared: Annotated[
        bool, Query(description="Use the nominal model instead of the final one.")
    ] = False


_PredictionDep = Annotated[_Prediction, Depends()]


@router.post("/{fit_id}/feedback", summary="Compute the speed loop", **JSON_CALL)
def compute_feedback(
    fit_id: str, body: FeedbackIn, services: ServicesDep, caller: CallerDep
) -> FeedbackOut:
    """Compute metrics and step responses of the speed loop with any controller and temperature.

    The numbers follow from the posterior of a succeeded fit and are not stored.
    """
    loop = services.analyses.loop(caller, fit_id, body.controllers, body.temperatures, draws=_DRAWS)
    return FeedbackOut.of(loop)


@router.post("/{fit_id}/tunings", summary="Tune the speed loop", **JSON_CALL)
def tune_loop(
    fit_id: str, body: TuningIn, services: ServicesDep, caller: CallerDep, is_wanted: IsWanted
) -> TuningOut:
    """Find controllers that meet a specification over posterior draws and temperatures.

    The loop is simulated with the effects found, limits, sample time and delay.  The answer takes
    some seconds and is not stored.  A computation whose client has disconnected is ended.
    """
    found, remarks = services.analyses.tuning(
        caller, fit_id, draws=_TUNING_DRAWS, is_wanted=is_wanted, **body.options()
    )
    return TuningOut(tuning=found, remarks=list(remarks))


# This path comes first: the one below would take `ID.csv` for an ID.
@router.get(
    "/{fit_id}/predictions/{run_id}.csv",
    summary="Fetch a predicted run",
    response_class=FileResponse,
    responses={
        200: {
            "description": "A row for each sample of the run.",
            "content": {"text/csv": {"example": "time_s,current_A,speed_rad_s\n0.0,0.12,3.4\n"}},
        },
        **responses(400, 404, 416, 422, 503, 507),
    },
)
def fetch_prediction(wanted: _PredictionDep, services: ServicesDep) -> OpenFileResponse:
    """Fetch the simulated signals of a stored run, as `motorid predict` writes them."""
    return OpenFileResponse(
        services.analyses.prediction_table(**vars(wanted)),
        media_type="text/csv; charset=utf-8",
        filename=f"{wanted.run_id}.csv",
    )


@router.get(
    "/{fit_id}/predictions/{run_id}", summary="Predict a run", responses=responses(404, 422, 503)
)
def predict_run(wanted: _PredictionDep, services: ServicesDep) -> PredictionOut:
    """Simulate a stored run from its inputs and compare it with the measured signals."""
    run, prediction = services.analyses.prediction(**vars(wanted))
    return PredictionOut.of(wanted.fit_id, run.id, wanted.declared, prediction)


@designs.post("", summary="Design a run", **JSON_CALL)
def design_run(
    body: DesignIn, services: ServicesDep, caller: CallerDep, is_wanted: IsWanted
) -> DesignOut:
    """Design the voltage of the next run of a motor, or of the first run of a nameplate.

    The run separates the alternatives of the fit and narrows its parameters within the limits, as
    `motorid design` does.  It is not stored; equal requests give equal answers.
    """
    if (body.fit is None) == (body.nameplate is None):
        raise FieldRefused("expected either fit or nameplate", field="fit")
    found = services.analyses.design(
        caller, body.fit, body.options(), body.nameplate or "", is_wanted=is_wanted
    )
    return DesignOut(design=found.entry, table=found.table)
