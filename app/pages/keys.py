"""Page of the API keys of a workspace: list, create and revoke.

A key gives access to all data of its workspace and to nothing else; that of an owner manages the
keys, too.

The form brings the ID of the key that it creates.  If the answer is lost, the page asks by this ID
whether the key exists, and a form that is sent again creates no second key.  The secret is not kept
for a second answer, because only its hash may be stored: a key that nobody saw is revoked.
"""

from __future__ import annotations

import time
from typing import Annotated, Any

from fastapi import APIRouter, Form, Response
from fastapi.responses import HTMLResponse

from app.access.service import Caller
from app.composition import Services
from app.errors import FieldRefused, NotFound, NotOwner
from app.http import LOGIN_PATH
from app.http.dependencies import CallerDep, ServicesDep
from app.identifiers import new_id
from app.pages.rendering import Page, refusal
from app.pages.views import when
from app.tables import KeyRow
from app.texts import moment
from identification.errors import OptionError

__all__ = ["router"]

router = APIRouter(prefix="/keys", include_in_schema=False)


@router.get("")
def show(page: Page, services: ServicesDep, caller: CallerDep, lost: str = "") -> HTMLResponse:
    """Keys of the workspace, and what became of the one whose creation had no answer."""
    _check_owner(caller)
    if lost and _open_key(services, caller, lost) is None:
        problem = "the key was not created, because the service did not get the form; send it again"
        return _shown(page, services, caller, problem=problem)
    return _shown(page, services, caller, lost=lost)


@router.post("")
def create(
    page: Page,
    services: ServicesDep,
    caller: CallerDep,
    *,
    name: Annotated[str, Form(max_length=200)],
    days: Annotated[str, Form(max_length=20)] = "",
    owner: Annotated[bool, Form()] = False,
    key_id: Annotated[str, Form(alias="key", max_length=40)] = "",
) -> HTMLResponse:
    """Create a key of the workspace and show its secret once."""
    _check_owner(caller)
    if key_id and _open_key(services, caller, key_id) is not None:
        return _shown(page, services, caller, lost=key_id)
    if caller.key_id is None:
        raise FieldRefused("this service requires no keys (--no-auth)", "name")
    try:
        lifetime = float(days.replace(",", ".")) if days.strip() else None
        _, secret = services.access.create_key(
            name.strip(), caller.workspace, days=lifetime, owner=owner, key_id=key_id or None
        )
    except ValueError:
        return _shown(page, services, caller, problem=f"days: {days!r} is not a number")
    except OptionError as error:
        return _shown(page, services, caller, problem=str(error))
    return _shown(page, services, caller, secret=secret)


@router.post("/{key_id}/revoke")
def revoke(key_id: str, page: Page, services: ServicesDep, caller: CallerDep) -> Response:
    """Revoke a key of the workspace and end its sessions; show the table anew."""
    _check_owner(caller)
    try:
        services.access.revoke_key(key_id, caller.workspace)
    except OptionError as error:
        raise NotFound("there is no such key that can be revoked; /keys lists them") from error
    if key_id == caller.key_id:
        return Response(status_code=204, headers={"HX-Redirect": LOGIN_PATH})
    # The rest of the page may show the secret of a new key.
    return _shown(page, services, caller, is_revoked=True)


def _check_owner(caller: Caller) -> None:
    """Raise `NotOwner` for a key without an owner, which may not manage keys."""
    if not caller.is_owner:
        raise NotOwner(
            "this key does not manage keys; ask an owner of the workspace, or make one with "
            "`motorid keys create --owner`"
        )


def _shown(
    page: Page,
    services: Services,
    caller: Caller,
    *,
    secret: str = "",
    problem: str = "",
    is_revoked: bool = False,
    lost: str = "",
) -> HTMLResponse:
    services.access.write_uses()
    keys = reversed(services.access.list_keys(caller.workspace))
    return page(
        "keys",
        **refusal(problem, "#keys-problem"),
        keys=[_key_view(key, caller) for key in keys],
        secret=secret,
        problem=problem,
        is_revoked=is_revoked,
        lost=_open_key(services, caller, lost) if lost else None,
        new_id=new_id("key"),
    )


def _open_key(services: Services, caller: Caller, key_id: str) -> KeyRow | None:
    """Key of the workspace of the caller that is not revoked."""
    keys = services.access.list_keys(caller.workspace)
    return next((key for key in keys if key.id == key_id and key.revoked_at is None), None)


def _key_view(key: KeyRow, caller: Caller) -> dict[str, Any]:
    state = "valid"
    if key.revoked_at is not None:
        state = "revoked"
    elif key.expires_at is not None and key.expires_at <= time.time():
        state = "expired"
    times = {
        "created": key.created_at, "expires": key.expires_at, "last_used": key.last_used_at,
    }  # fmt: skip
    return {
        "id": key.id,
        "name": key.name,
        "state": state,
        "is_own": key.id == caller.key_id,
        "is_owner": key.owner,
        "times": {
            label: None if at is None else {"iso": moment(at), "text": when(moment(at))}
            for label, at in times.items()
        },
    }
