"""Clients with unlimited retries, which check that each accepted fit ends once.

Each client sends fits with an Idempotency-Key, repeats calls without an answer, and polls its fits
until they have ended.  Once a fit has succeeded, its result must not change.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import httpx

from tests.app.service import API, ENDED, run_text

__all__ = ["Client", "patient"]

_PAUSE_S = 0.1
_OUTSTANDING = 4


def patient(
    url: Callable[[], str], method: str, path: str, unexpected: list[str], **words: Any
) -> dict[str, Any]:
    """Repeat a call until it is answered.

    Args:
        url: Function that returns the present address of the server.
        method: Method of the call.
        path: Path below that of the interface.
        unexpected: Receives answers that no client should see, such as a 500.
        **words: Arguments of the request.
    """
    while True:
        try:
            answer = httpx.request(method, url() + API + path, timeout=30, **words)
        except httpx.TransportError:
            time.sleep(_PAUSE_S)
            continue
        if answer.is_success:
            return dict(answer.json())
        if answer.status_code != 503:
            unexpected.append(f"{method} {path}: {answer.status_code} {answer.text[:200]}")
        time.sleep(_PAUSE_S)


class Client:
    """Client that sends fits until it is stopped and then waits for the last one.

    Args:
        url: Function that returns the present address of the server.
        number: Number of the client, which is part of its keys and its run.
    """

    def __init__(self, url: Callable[[], str], number: int) -> None:
        self._url = url
        self._number = number
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self.accepted: dict[str, int] = {}
        """Seed of each accepted fit."""
        self.ended: dict[str, dict[str, Any]] = {}
        """Each fit as first observed after its end."""
        self.unexpected: list[str] = []

    def start(self) -> None:
        """Start sending."""
        self._thread.start()

    def stop(self) -> None:
        """Stop sending."""
        self._stop.set()

    @property
    def is_busy(self) -> bool:
        """True while the client waits for a fit to end."""
        return self._thread.is_alive()

    def changed(self) -> list[str]:
        """Fits whose result has changed since their end was first observed."""
        return [
            fit for fit, seen in self.ended.items() if self._call("GET", f"/fits/{fit}") != seen
        ]

    def _work(self) -> None:
        files = {"file": (f"{self._number}.csv", run_text(self._number))}
        run = self._call("POST", "/runs", files=files)["id"]
        seed = 0
        while not self._stop.is_set():
            if len(self.accepted) - len(self.ended) < _OUTSTANDING:
                self._send(run, seed)
                seed += 1
            self._look()
        while len(self.ended) < len(self.accepted):
            self._look()

    def _send(self, run: str, seed: int) -> None:
        body = {"training": [run], "options": {"seed": seed, "posterior": False}}
        headers = {"Idempotency-Key": f"client-{self._number}-{seed}"}
        fit = self._call("POST", "/fits", json=body, headers=headers)
        self.accepted[fit["id"]] = seed

    def _look(self) -> None:
        for fit in self.accepted.keys() - self.ended.keys():
            state = self._call("GET", f"/fits/{fit}")
            if state["status"] in ENDED:
                self.ended[fit] = state
        time.sleep(_PAUSE_S)

    def _call(self, method: str, path: str, **words: Any) -> dict[str, Any]:
        return patient(self._url, method, path, self.unexpected, **words)
