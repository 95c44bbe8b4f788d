"""Choice of the runs of a fit on the start page, their precision, and the request for the fit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import HTMLResponse
from pydantic import ValidationError

from app.access.service import Caller
from app.composition import Services
from app.errors import FieldRefused
from app.fits.schemas import FitCreate
from app.http.dependencies import CallerDep, RequestKey, ServicesDep
from app.pages.forms import number, texts_of
from app.pages.pending import finding_view
from app.pages.rendering import Page
from app.pages.views import located, run_view
from app.runs.choice import corrected
from app.runs.schemas import RunOut
from app.texts import parts
from identification.result.numbers import number_text, unit_prefix, unit_text

__all__ = ["MotorFilter", "choice_of", "options_from", "prospects_view", "router"]

router = APIRouter(include_in_schema=False)

_MOST_ROWS = 200
_ROLE = "role."
_INTERVAL = 1.645
"""Half width of a 90 % interval of a normal distribution [standard deviations]."""

MotorFilter = Annotated[str | None, Query(max_length=200)]


def choice_of(services: Services, caller: Caller, motor: str | None) -> dict[str, Any]:
    """View of the runs of a motor with their roles.

    The motor ``*`` stands for all, as does one without runs; None for that of the newest run.
    """
    motors = services.choice.motors(caller)
    if motor is None:
        newest, _ = services.runs.page(caller, after=None, limit=1, motor=None)
        motor = newest[0].motor if newest else None
    motor = motor if motor in motors else "*"
    wanted = None if motor == "*" else motor
    runs, more = services.runs.page(caller, after=None, limit=_MOST_ROWS, motor=wanted)
    roles, is_proposal = services.choice.roles(runs)
    return {
        "runs": [run_view(RunOut.of(run)) | {"role": roles[run.id]} for run in runs],
        "training": sum(role == "training" for role in roles.values()),
        "validation": sum(role == "validation" for role in roles.values()),
        "is_proposal": is_proposal and bool(runs),
        "has_more": more is not None,
        "motor": motor,
        "motors": motors,
        "moved": None,
        "is_mixed": len({run.motor for run in runs if roles[run.id]}) > 1,
    }


@router.get("/choice")
def show(
    page: Page, services: ServicesDep, caller: CallerDep, motor: MotorFilter = None
) -> HTMLResponse:
    """Runs of one motor."""
    return page("choice", choice=choice_of(services, caller, motor))


@router.post("/choice")
async def choose(
    page: Page,
    request: Request,
    services: ServicesDep,
    caller: CallerDep,
    motor: MotorFilter = None,
) -> HTMLResponse:
    """Store the roles in the form, or those of a gesture: all, none, pattern, proposal."""
    form = await texts_of(request)
    await to_thread.run_sync(_choose, services, caller, form, motor)
    return page("choice", choice=await to_thread.run_sync(choice_of, services, caller, motor))


def _choose(services: Services, caller: Caller, form: Mapping[str, str], motor: str | None) -> None:
    roles = _roles(form)
    runs = [services.runs.get(caller, run_id) for run_id in roles]
    gesture = form.get("gesture", "")
    if gesture == "all":
        roles = dict.fromkeys(roles, "training")
    elif gesture == "none":
        roles = dict.fromkeys(roles, "")
    elif gesture == "pattern":
        roles = services.choice.by_pattern(runs, form.get("pattern", ""))
    elif gesture == "proposal":
        for run in runs:
            run.role = None
        roles, _ = services.choice.roles(runs)
    else:
        # The role of one run leaves those of the others as they are shown, proposed or chosen.
        shown = choice_of(services, caller, motor)
        proposed = shown["runs"] if shown["is_proposal"] else ()
        roles = {run["id"]: run["role"] for run in proposed} | roles
    if gesture in ("all", "pattern"):
        # The page lists the newest run first.
        roles |= dict.fromkeys(corrected(runs[::-1]), "")
    services.choice.set_roles(caller, roles)


@router.post("/prospects")
async def prospects(
    page: Page, request: Request, services: ServicesDep, caller: CallerDep
) -> HTMLResponse:
    """Show what a fit of the training runs in the form can identify."""
    form = await texts_of(request)
    training = _of_role(form, "training")
    found = None
    if training:
        services.reading.check()
        found = await services.reading.run(services.choice.prospects, caller, training)
    return page("prospects", prospects=prospects_view(found, len(training)))


@router.post("/runs/{run_id}/motor")
async def rename(
    run_id: str,
    request: Request,
    page: Page,
    services: ServicesDep,
    caller: CallerDep,
    motor: MotorFilter = None,
) -> HTMLResponse:
    """Set the motor of a run."""
    # htmx sends the whole form, so the names of the other runs are in the body too.
    name = (await texts_of(request)).get(f"motor.{run_id}", "")
    await to_thread.run_sync(services.choice.rename, caller, run_id, name)
    view = await to_thread.run_sync(choice_of, services, caller, motor)
    if run_id not in [run["id"] for run in view["runs"]]:
        run = await to_thread.run_sync(services.runs.get, caller, run_id)
        view["moved"] = {"file": run.file, "motor": run.motor}
    return page("choice", choice=view)


@router.delete("/runs/{run_id}")
def delete(
    run_id: str, page: Page, services: ServicesDep, caller: CallerDep, motor: MotorFilter = None
) -> HTMLResponse:
    """Delete a run."""
    services.runs.delete(caller, run_id)
    return page("choice", choice=choice_of(services, caller, motor))


@router.post("/fits")
async def start(
    request: Request, services: ServicesDep, caller: CallerDep, idempotency_key: RequestKey = None
) -> Response:
    """Request the fit of the form and open its page; a repeated request opens the same fit."""
    form = await texts_of(request)
    fit = await to_thread.run_sync(_started, services, caller, form, idempotency_key)
    return Response(status_code=204, headers={"HX-Redirect": f"/fits/{fit}"})


def _started(services: Services, caller: Caller, form: Mapping[str, str], key: str | None) -> str:
    training = _of_role(form, "training")
    if not training:
        raise FieldRefused("no training run is chosen; choose at least one", "training")
    content = {
        "training": training,
        "validation": _of_role(form, "validation"),
        "motor": services.runs.get(caller, training[0]).motor,
        "options": options_from(form),
    }
    try:
        body = FitCreate.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        field = ".".join(str(part) for part in first["loc"]).removeprefix("options.")
        raise FieldRefused(f"{field}: {first['msg']}", field) from error
    return services.fits.create(caller, body.request(body.options), key).row.id


def options_from(form: Mapping[str, str]) -> dict[str, Any]:
    """Options of a fit in the fields of the form."""
    contradicting = form.get("contradicting", "")
    return {
        "posterior": "posterior" in form,
        "effects": "effects" in form,
        "hold": form.get("hold", "auto"),
        "effort": form.get("effort", "normal"),
        "set_aside": contradicting == "set_aside",
        "force": contradicting == "force",
        "temperatures": [
            number("temperatures", part) for part in parts(form.get("temperatures", ""))
        ],
        "controllers": _words(form.get("controllers", "")),
        # Blanks around the signs are allowed, as in "Kt25 = 0.048 ± 5 %".
        "known": _words(
            re.sub(r"\s+%", "%", re.sub(r"\s*(=|\+-|±)\s*", r"\1", form.get("known", "")))
        ),
        "nameplate": form.get("nameplate", "").strip(),
        "seed": int(number("seed", form.get("seed", "0") or "0")),
    }


def _words(text: str) -> list[str]:
    """Parts of a text, separated by blanks, semicolons, or commas followed by a blank."""
    return [word for word in re.split(r"[\s;]+|,\s+", text.strip()) if word]


def _roles(form: Mapping[str, str]) -> dict[str, str]:
    """Role of each run in the form, newest first."""
    return {name.removeprefix(_ROLE): v for name, v in form.items() if name.startswith(_ROLE)}


def _of_role(form: Mapping[str, str], role: str) -> list[str]:
    """Runs of a role in the order of upload; the table starts with the newest run."""
    return [run_id for run_id, chosen in reversed(_roles(form).items()) if chosen == role]


def prospects_view(found: Mapping[str, Any] | None, training: int) -> dict[str, Any]:
    """View of the preview of the training runs; None if no run is chosen."""
    if found is None:
        return {"training": 0}
    units = {n: unit_prefix(e["unit"], [e["value"]]) for n, e in found["parameters"].items()}
    parameters = [
        {
            "name": name,
            "value": number_text(units[name][0] * entry["value"], 3),
            "unit": unit_text(units[name][1]),
            "precision": _precision(entry, units[name][0]),
            "identified": entry["identified"],
            "advice": entry["advice"],
        }
        for name, entry in found["parameters"].items()
    ]
    lacking = [p["name"] for p in parameters if not p["identified"]]
    return {
        "training": training,
        "parameters": parameters,
        "lacking": lacking,
        "errors": [
            {"text": ": ".join(filter(None, (e["file"], located(e)))), "code": e["code"]}
            for e in found["errors"]
        ],
        "findings": [finding_view(finding) for finding in found["findings"]],
        "notes": found["notes"],
    }


def _precision(entry: Mapping[str, Any], factor: float) -> str:
    """Half width of the expected 90 % interval in percent of the value, or else in its unit."""
    if entry["expected_sd"] is None:
        return "unknown"
    half = _INTERVAL * entry["expected_sd"]
    if half > 0.995 * abs(entry["value"]):
        # A coefficient near zero can be determined well.
        return f"± {number_text(factor * half, 2)}"
    return f"± {100.0 * half / abs(entry['value']):.2g} %"
