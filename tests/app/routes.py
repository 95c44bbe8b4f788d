"""All routes of the application, and keys that give no access."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from app.access.service import AccessService
from app.database import Database
from app.http.gate import PUBLIC_PATHS, PUBLIC_PREFIXES

PLACE = re.compile(r"\{(\w+)\}")


def walked(routes: Iterable[Any]) -> Iterator[tuple[str, str]]:
    """Method and path of each route, including those of included routers."""
    for route in routes:
        if hasattr(route, "effective_route_contexts"):
            # FastAPI represents an included router as a single route.
            yield from walked(route.effective_route_contexts())
            continue
        for method in sorted(getattr(route, "methods", None) or {"GET"}):
            yield method, route.path


def every_route(application: FastAPI) -> list[tuple[str, str]]:
    """Method and path of each call that requires a key, from the routes and the OpenAPI paths."""
    described = application.openapi()["paths"]
    from_schema = [(m.upper(), path) for path, calls in described.items() for m in calls]
    found = {*from_schema, *walked(application.routes)}
    return sorted(
        (method, path)
        for method, path in found
        if path and path not in PUBLIC_PATHS and not f"{path}/".startswith(PUBLIC_PREFIXES)
    )


def revoked_key(data_dir: Path) -> str:
    """Secret of a revoked key of alice."""
    database = Database(f"sqlite:///{data_dir / 'motorid.sqlite3'}")
    access = AccessService(database)
    key, secret = access.create_key("lost", "alice")
    access.revoke_key(key.id)
    database.close()
    return secret


def expired_key(data_dir: Path) -> str:
    """Secret of an expired key of alice, which was valid for 86 microseconds."""
    database = Database(f"sqlite:///{data_dir / 'motorid.sqlite3'}")
    _, secret = AccessService(database).create_key("visitor", "alice", days=1e-9)
    database.close()
    return secret


def filled(path: str, ids: Mapping[str, str]) -> str:
    """Path with item IDs of alice as parameters; the table format is CSV."""
    return PLACE.sub(lambda found: {"form": "csv", **ids}[found.group(1)], path)
