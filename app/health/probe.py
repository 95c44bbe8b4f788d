"""Readiness probe for the container, run on the machine of the service.

python -m app.health.probe         exit status 0 if ready, else 1 and one line with the reason

The probe runs every few seconds for as long as the container lives.  It therefore imports little
and reads MOTORID_PORT and MOTORID_HOST itself.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import closing
from http.client import HTTPConnection, HTTPException
from typing import Final

__all__ = ["PATH", "address", "unready"]

PATH: Final = "/readyz"

_TIMEOUT_S = 4.0
_ANYWHERE = ("0.0.0.0", "::", "[::]")  # noqa: S104  compared with MOTORID_HOST, never bound


def address(variables: Mapping[str, str]) -> tuple[str, str]:
    """Host and port of the service as seen from the same machine."""
    host = variables.get("MOTORID_HOST") or "127.0.0.1"
    return "127.0.0.1" if host in _ANYWHERE else host, variables.get("MOTORID_PORT") or "8000"


def unready(variables: Mapping[str, str]) -> str | None:
    """Reason why the service is not ready; None if it is."""
    host, port = address(variables)
    try:
        with closing(HTTPConnection(host.strip("[]"), int(port), timeout=_TIMEOUT_S)) as service:
            # The service accepts `localhost` whatever MOTORID_ALLOWED_HOSTS says.
            service.request("GET", PATH, headers={"Host": "localhost"})
            answer = service.getresponse()
            content = answer.read(10_000).decode(errors="replace")
    except (OSError, ValueError, HTTPException) as error:
        return f"{host} port {port} does not answer ({error}); see MOTORID_PORT and the log"
    return None if answer.status == 200 else f"{PATH} answers {answer.status}: {content}"


if __name__ == "__main__":
    if (reason := unready(os.environ)) is not None:
        sys.exit(f"motorid: {reason}")
