"""Application factory `create_app(settings)`; importing this module has no side effects.

uvicorn --factory app.main:create_app         settings from the environment
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any

import anyio
from anyio import to_thread
from fastapi import FastAPI

from app.analyses.endpoints import designs
from app.analyses.endpoints import router as analyses
from app.batches.endpoints import router as batches
from app.composition import Services
from app.errors import BadRequest, Unavailable
from app.fits.endpoints import router as fits
from app.health.endpoints import router as health
from app.http import API_PREFIX, HELP_PREFIX, STATIC_PREFIX, UPLOAD_PATHS
from app.http.connections import BodyDeadline, check_crowd
from app.http.files import HelpPages, PageFiles
from app.http.gate import Gate
from app.http.middleware import (
    HeadCheck,
    RequestCheck,
    RequestLog,
    UnexpectedErrors,
    check_form,
    host_check,
    size_check,
)
from app.http.problems import add_problem_handlers
from app.http.rate import RateLimit
from app.pages.choice import router as choice
from app.pages.endpoints import router as pages
from app.pages.keys import router as keys
from app.pages.pending import router as pending
from app.pages.rendering import PLOT_FILES, STATIC_FILES, ErrorPages
from app.runs.endpoints import router as runs
from app.settings import Settings, load_settings

__all__ = ["create_app"]

_FORM_BYTES = 1 << 20
_DESCRIPTION = """
Identifies brushed DC motors from measured runs.

1. `POST /api/v1/runs` each run file; the answer has its id.
2. `POST /api/v1/fits` the ids; the answer is 202 and says where the fit is.
3. `GET /api/v1/fits/{id}` until `status` is `succeeded`, or listen to its events.
4. The result is in the fit; its report and posterior have addresses of their own.

Errors are RFC 9457 `application/problem+json`; `code` is a stable word for scripts, and `file`,
`row` and `column` say where in a run file something was wrong.
"""


def create_app(settings: Settings | None = None) -> FastAPI:
    """Build the service as an ASGI application; by default with the settings of the environment.

    Raises:
        OptionError: A setting is not accepted.
    """
    settings = settings or load_settings()
    services = Services(settings)
    application = FastAPI(
        title="motorid",
        version=version("motorid"),
        summary="Identification of brushed DC motors",
        description=_DESCRIPTION,
        openapi_url=f"{API_PREFIX}/openapi.json",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        lifespan=_lifespan,
    )
    application.state.services = services
    application.include_router(
        runs, prefix=API_PREFIX, max_body_size=settings.max_upload_bytes + _FORM_BYTES
    )
    for router in (fits, analyses, designs, batches, health):
        application.include_router(router, prefix=API_PREFIX, max_body_size=settings.max_body_bytes)
    application.include_router(health, include_in_schema=False)
    for router in (pages, choice, keys):
        application.include_router(router, max_body_size=settings.max_body_bytes)
    application.include_router(pending, max_body_size=settings.max_upload_bytes + _FORM_BYTES)
    application.mount(f"{STATIC_PREFIX}vendor/uplot", PageFiles(directory=PLOT_FILES))
    application.mount(STATIC_PREFIX.rstrip("/"), PageFiles(directory=STATIC_FILES))
    if settings.help_dir is not None:
        application.mount(HELP_PREFIX.rstrip("/"), HelpPages(settings.help_dir))
    add_problem_handlers(application)
    # The middleware added last handles a request first.
    application.add_middleware(HeadCheck)
    application.add_middleware(BodyDeadline, request_s=settings.request_s)
    limits = dict.fromkeys(UPLOAD_PATHS, settings.max_upload_bytes + _FORM_BYTES)
    application.add_middleware(RequestCheck, check=size_check(settings.max_body_bytes, limits))
    application.add_middleware(
        RateLimit,
        rate_per_s=settings.rate_per_s,
        burst=settings.rate_burst,
        metrics=services.metrics,
    )
    application.add_middleware(Gate, access=services.access, no_auth=settings.no_auth)
    application.add_middleware(RequestCheck, check=host_check(settings.hosts))
    application.add_middleware(RequestCheck, check=check_form, closing=(BadRequest,))
    application.add_middleware(RequestCheck, check=check_crowd, closing=(Unavailable,))
    application.add_middleware(UnexpectedErrors)
    application.add_middleware(ErrorPages)
    application.add_middleware(RequestLog, metrics=services.metrics)
    application.openapi = lambda: _openapi(application)  # type: ignore[method-assign]
    return application


@asynccontextmanager
async def _lifespan(application: FastAPI) -> AsyncIterator[None]:
    services: Services = application.state.services
    await to_thread.run_sync(services.start)
    try:
        async with anyio.create_task_group() as group:
            group.start_soon(services.watcher.run)
            yield
            group.cancel_scope.cancel()
    finally:
        await to_thread.run_sync(services.stop)


def _openapi(application: FastAPI) -> dict[str, Any]:
    """OpenAPI schema, with bearer authentication for every call except health."""
    if application.openapi_schema is None:
        schema = FastAPI.openapi(application)
        schema["components"]["securitySchemes"] = {
            "key": {
                "type": "http",
                "scheme": "bearer",
                "description": "A key from `motorid keys create`; not asked for where the service "
                "runs with `--no-auth`.",
            }
        }
        # Drop FastAPI's own validation error schema, which no call returns.
        for name in ("HTTPValidationError", "ValidationError"):
            schema["components"]["schemas"].pop(name, None)
        for one in schema["components"]["schemas"].values():
            for member in one.get("properties", {}).values():
                if "description" in member:
                    member["description"] = " ".join(member["description"].split())
        for path in schema["paths"].values():
            for call in path.values():
                if "HTTPValidationError" in str(call["responses"].get("422")):
                    del call["responses"]["422"]
                call["security"] = [] if call["tags"] == ["health"] else [{"key": []}]
    return FastAPI.openapi(application)
