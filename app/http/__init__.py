"""HTTP layer of the service: URL paths, middleware, problem responses and dependencies."""

from __future__ import annotations

from typing import Final

__all__ = [
    "API_PREFIX",
    "HEALTH_PATHS",
    "HELP_PREFIX",
    "LOGIN_PATH",
    "PENDING_PATH",
    "STATIC_PREFIX",
    "UPLOAD_PATHS",
]

API_PREFIX: Final = "/api/v1"

HEALTH_PATHS: Final = frozenset(
    f"{prefix}/{name}" for prefix in ("", API_PREFIX) for name in ("healthz", "readyz", "metrics")
)
"""Health and metrics paths, below the API prefix and, for probes, at the root."""

PENDING_PATH: Final = "/pending"
"""Pending runs, as parts of the start page."""

UPLOAD_PATHS: Final = (f"{API_PREFIX}/runs", f"{API_PREFIX}/runs/preview", PENDING_PATH)
"""Paths whose body is a run file, with the size limit and the deadline of an upload."""

LOGIN_PATH: Final = "/login"

HELP_PREFIX: Final = "/help/"

STATIC_PREFIX: Final = "/static/"
"""Prefix of the style sheets and scripts of the web pages, which are the same for all users."""
