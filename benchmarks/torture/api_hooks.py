"""Hooks of schemathesis that put real runs into some of the generated requests."""

from __future__ import annotations

import hashlib
import os
from typing import Any

import schemathesis

from tests.app.service import run_text

__all__ = ["RUNS", "real_runs", "real_upload"]

RUNS = "MOTORID_TORTURE_RUNS"
"""Environment variable with the ids of existing runs, separated by commas."""


_on_body: Any = schemathesis.hook("map_body").apply_to  # type: ignore[attr-defined]


def _chance(body: object, of: int) -> int:
    """Number below `of` that is derived from the body, so that a case is reproducible."""
    return hashlib.sha256(repr(body).encode("utf-8", "replace")).digest()[0] % of


def _with_runs(fit: Any) -> Any:
    known = [name for name in os.environ.get(RUNS, "").split(",") if name]
    if not isinstance(fit, dict) or not known or _chance(fit, 3) == 0:
        return fit
    first = _chance(fit, len(known))
    return fit | {"training": [known[first]], "validation": []}


@_on_body(method="POST", path_regex="/(fits|batches)$")
def real_runs(context: schemathesis.HookContext, body: Any) -> Any:
    """Name existing runs in two of three fits."""
    if isinstance(body, dict) and isinstance(body.get("motors"), list):
        return body | {"motors": [_with_runs(motor) for motor in body["motors"]]}
    return _with_runs(body)


@_on_body(method="POST", path_regex="/runs$")
def real_upload(context: schemathesis.HookContext, body: Any) -> Any:
    """Send a valid file in two of three uploads."""
    if isinstance(body, dict) and "file" in body and _chance(body, 3):
        return {"file": run_text(1000 + _chance(body, 200))}
    return body
