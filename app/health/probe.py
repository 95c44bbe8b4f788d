"""Health check of the container: whether the service on this machine is ready.

python -m app.health.probe         exit status 0 if it is, else 1 and one line that says why

It runs every few seconds for as long as the container lives, so it loads next to nothing and reads
MOTORID_PORT and MOTORID_HOST itself.
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
"""What is asked."""

_TIMEOUT_S = 4.0
_ANYWHERE = ("0.0.0.0", "::", "[::]")  # noqa: S104  addresses of a server, not to listen on


def address(variables: Mapping[str, str]) -> tuple[str, str]:
    """Host and port at which the service can be asked from the same machine.

    Args:
        variables: The environment of the service.
    """
    host = variables.get("MOTORID_HOST") or "127.0.0.1"
    return "127.0.0.1" if host in _ANYWHERE else host, variables.get("MOTORID_PORT") or "8000"


def unready(variables: Mapping[str, str]) -> str | None:
    """Why the service cannot do its work; None if it can.

    Args:
        variables: The environment of the service.
    """
    host, port = address(variables)
    try:
        with closing(HTTPConnection(host.strip("[]"), int(port), timeout=_TIMEOUT_S)) as service:
            # A loopback name is allowed whatever MOTORID_ALLOWED_HOSTS says.
            service.request("GET", PATH, headers={"Host": "localhost"})
            answer = service.getresponse()
            content = answer.read(10_000).decode(errors="replace")
    except (OSError, ValueError, HTTPException) as error:
        return f"{host} port {port} does not answer ({error}); see MOTORID_PORT and the log"
    return None if answer.status == 200 else f"{PATH} answers {answer.status}: {content}"


if __name__ == "__main__":
    if (reason := unready(os.environ)) is not None:
        sys.exit(f"motorid: {reason}")
