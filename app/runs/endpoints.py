"""HTTP endpoints of runs."""

from __future__ import annotations

from collections.abc import AsyncGenerator, AsyncIterator, Mapping
from contextlib import aclosing, asynccontextmanager

import anyio
from anyio import to_thread
from fastapi import APIRouter, Request, Response

from app.composition import Services
from app.errors import BodyTooSlow
from app.http.dependencies import After, CallerDep, Limit, OnlyMotor, ServicesDep
from app.http.problems import responses
from app.runs.schemas import UPLOAD_BODY, PreviewOut, RunList, RunOut
from app.runs.upload import FIELDS, Upload, UploadForm, boundary_of

__all__ = ["received", "router"]

router = APIRouter(prefix="/runs", tags=["runs"])

_BLOCK_BYTES = 1 << 18
_SENT_AGAIN_S = 2.0


@router.post(
    "",
    status_code=201,
    summary="Store a run",
    response_description="The run was stored.",
    responses={
        200: {"model": RunOut, "description": "The same bytes were stored before."},
        **responses(400, 403, 408, 413, 415, 422, 507),
    },
    openapi_extra=UPLOAD_BODY,
)
async def upload_run(
    request: Request, response: Response, services: ServicesDep, caller: CallerDep
) -> RunOut:
    """Upload a run file in the form field `file`.

    The same bytes with the same mapping are the same run: a repeated upload returns status
    200 and the same ID. A file that cannot be parsed returns status 422 with the row and
    column of the error.
    """
    services.reading.check()
    began = anyio.current_time()
    async with received(request, services) as upload:
        # The queue may have filled meanwhile.  An upload that took longer is parsed in any case,
        # since repeating it would cost the caller more.
        if anyio.current_time() - began < _SENT_AGAIN_S:
            services.reading.check()
        row, is_new = await services.reading.run(services.runs.store, caller, upload)
    response.status_code = 201 if is_new else 200
    response.headers["Location"] = f"/api/v1/runs/{row.id}"
    return RunOut.of(row)


@router.post(
    "/preview",
    summary="Examine a run without storing it",
    responses=responses(400, 403, 408, 413, 415, 422, 507),
    openapi_extra=UPLOAD_BODY,
)
async def preview_run(request: Request, services: ServicesDep, _: CallerDep) -> PreviewOut:
    """Examine a run file in the form field `file`: columns, excitation, contradictions, precision.

    Nothing is stored. A file that cannot be parsed is an answer with status 200 whose
    `accepted` is false and whose `errors` give the row and column of the error.
    """
    services.reading.check()
    async with received(request, services) as upload:
        found = await services.reading.run(services.runs.preview, upload)
    return PreviewOut.model_validate(found)


@router.get("", summary="List runs", responses=responses(422))
def list_runs(
    services: ServicesDep,
    caller: CallerDep,
    limit: Limit = 100,
    after: After = None,
    motor: OnlyMotor = None,
) -> RunList:
    """List runs, newest first."""
    runs, following = services.runs.page(caller, after=after, limit=limit, motor=motor)
    return RunList(items=[RunOut.of(run) for run in runs], next=following)


@router.get("/{run_id}", summary="Show a run", responses=responses(404))
def show_run(run_id: str, services: ServicesDep, caller: CallerDep) -> RunOut:
    """Show a run."""
    return RunOut.of(services.runs.get(caller, run_id))


@router.delete(
    "/{run_id}", status_code=204, summary="Delete a run", responses=responses(403, 404, 409)
)
def delete_run(run_id: str, services: ServicesDep, caller: CallerDep) -> None:
    """Delete a run and its file; refused while an unfinished fit needs the run."""
    services.runs.delete(caller, run_id)


@asynccontextmanager
async def received(
    request: Request, services: Services, accepted: Mapping[str, int] = FIELDS
) -> AsyncIterator[Upload]:
    """Receive an upload form; a thread is occupied only during disk access.

    After the block, a file that did not become a run is deleted.

    The fields accepted besides `file` have maximum sizes [bytes].

    Raises:
        RequestRefused: The form is malformed, too large or too slow.
        StorageFull: No disk space is left.
    """
    settings = services.settings
    boundary = boundary_of(request.headers.get("content-type", ""))
    form = await to_thread.run_sync(
        UploadForm, boundary, services.storage.new_incoming(), settings.max_upload_bytes, accepted
    )
    with form:
        async with aclosing(_blocks(request, settings.upload_idle_s, settings.upload_s)) as blocks:
            async for block in blocks:
                await to_thread.run_sync(form.feed, block)
        upload = await to_thread.run_sync(form.finish)
    try:
        yield upload
    finally:
        upload.path.unlink(missing_ok=True)


async def _blocks(request: Request, idle_s: float, whole_s: float) -> AsyncGenerator[bytes]:
    """Body of the request in blocks of at least 256 KiB, except the last; `BodyTooSlow` if late."""
    deadline = anyio.current_time() + whole_s
    held = bytearray()
    stream = request.stream().__aiter__()
    while True:
        try:
            with anyio.fail_after(min(idle_s, deadline - anyio.current_time())):
                held += await anext(stream)
        except StopAsyncIteration:
            break
        except TimeoutError as error:
            if anyio.current_time() < deadline:
                raise BodyTooSlow(
                    f"no data received for {idle_s:g} s; send the run again"
                ) from error
            raise BodyTooSlow(
                f"the upload was not complete after {whole_s:g} s; split the run, use a faster "
                "connection, or ask the operator to raise MOTORID_UPLOAD_S"
            ) from error
        if len(held) >= _BLOCK_BYTES:
            yield bytes(held)
            held.clear()
    if held:
        yield bytes(held)
