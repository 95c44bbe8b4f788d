"""FastAPI dependencies of the endpoints."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Any

from fastapi import Depends, Header, Query, Request

from app.access.service import Caller
from app.composition import Services
from app.errors import BadKey, WrongMediaType
from app.http.problems import responses

__all__ = [
    "JSON_CALL",
    "After",
    "CallerDep",
    "IsWanted",
    "Limit",
    "OnlyMotor",
    "Remove",
    "RequestKey",
    "ServicesDep",
]


def _services(request: Request) -> Services:
    services: Services = request.app.state.services
    return services


def _caller(request: Request) -> Caller:
    caller = getattr(request.state, "caller", None)
    if not isinstance(caller, Caller):
        # The gate rejects requests without a client; this catches a route made public by mistake.
        raise BadKey("no key was given; expected the header `Authorization: Bearer KEY`")
    return caller


def _json_body(request: Request) -> None:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json":
        raise WrongMediaType("expected a body of the type application/json")


async def _is_wanted(request: Request) -> AsyncIterator[Callable[[], bool]]:
    is_gone = threading.Event()

    async def watch() -> None:
        # The body, if any, was read before the endpoint was called.
        while (await request.receive())["type"] != "http.disconnect":
            pass
        is_gone.set()

    watching = asyncio.create_task(watch())
    try:
        yield lambda: not is_gone.is_set()
    finally:
        watching.cancel()


ServicesDep = Annotated[Services, Depends(_services)]
CallerDep = Annotated[Caller, Depends(_caller)]
IsWanted = Annotated[Callable[[], bool], Depends(_is_wanted)]
"""Function that returns False once the client has disconnected, for computations of seconds."""
JSON_CALL: dict[str, Any] = {
    "dependencies": [Depends(_json_body)],
    "responses": responses(400, 403, 404, 413, 415, 422),
}
"""Arguments of a route whose body is JSON; bodies of other media types are rejected."""
After = Annotated[str | None, Query(max_length=200, description="`next` of the previous page.")]
Limit = Annotated[int, Query(ge=1, le=1000, description="Maximum number of entries on a page.")]
OnlyMotor = Annotated[str | None, Query(max_length=200, description="Only those of this motor.")]
Remove = Annotated[bool, Query(description="False: only cancel, and leave what has ended.")]
RequestKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        description="Key chosen by the client, such as a UUID; the same key with the same request "
        "has the same answer, so that a request can be repeated if its answer was lost.",
    ),
]
