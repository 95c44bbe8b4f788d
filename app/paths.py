"""Addresses that more than one part of the service speaks of."""

from __future__ import annotations

from typing import Final

__all__ = ["API_PREFIX", "HEALTH_PATHS", "LOGIN_PATH", "STATIC_PREFIX"]

API_PREFIX: Final = "/api/v1"
"""Below it lie all calls."""

HEALTH_PATHS: Final = frozenset(
    f"{prefix}/{name}" for prefix in ("", API_PREFIX) for name in ("healthz", "readyz", "metrics")
)
"""Health and metrics, with the other calls and, for probes, at the root."""

LOGIN_PATH: Final = "/login"
"""The page that asks for a key."""

STATIC_PREFIX: Final = "/static/"
"""Below it lie the style and the scripts of the pages, the same for everyone."""
