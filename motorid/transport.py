"""HTTP calls with retries.

A call without a response, or with a temporary error (429, 502, 503, 504), is repeated: after the
time in `Retry-After`, else with exponential backoff and jitter, so that the clients of a restarted
service do not all call at once.  Only idempotent calls may be repeated; the caller decides.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import IO, Any

import httpx

from motorid.errors import Unreachable, problem_from

__all__ = ["Transport", "content_of", "pause_s"]

_FIRST_PAUSE_S = 0.2
_LONGEST_PAUSE_S = 8.0
_NOT_NOW = (429, 502, 503, 504)
_LASTING = ("file_lost", "database_damaged")


class Transport:
    """Connection to one service.

    Args:
        url: URL of the service, with or without ``/api/v1``.
        key: API key, or None.
        patience_s: Time over which a call is repeated [s].
        timeout_s: Time limit for each part of a response [s].
    """

    def __init__(self, url: str, key: str | None, patience_s: float, timeout_s: float) -> None:
        base = url.rstrip("/").removesuffix("/api/v1")
        if not base.startswith(("http://", "https://")):
            raise ValueError(f"{url!r} is no address of a service; expected http:// or https://")
        self.url = base
        self._patience_s = patience_s
        self._http = httpx.Client(
            base_url=f"{base}/api/v1",
            # To read the authorities takes 30 ms, and plain HTTP has no certificate to check.
            verify=base.startswith("https://"),
            headers={"Authorization": f"Bearer {key}"} if key else {},
            timeout=httpx.Timeout(timeout_s, connect=min(timeout_s, 10.0)),
        )

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def call(
        self,
        method: str,
        path: str,
        *,
        content: Callable[[], AbstractContextManager[dict[str, Any]]] | None = None,
        **words: Any,
    ) -> httpx.Response:
        """Send a call and return its response.

        Args:
            method: HTTP method.
            path: Path below ``/api/v1``.
            content: Function that creates the request body, anew for each attempt.
            **words: Further arguments of `httpx.Client.request`.

        Raises:
            Problem: The service refused the call.
            Unreachable: The service did not respond.
        """

        def send() -> httpx.Response:
            with content() if content else nullcontext({}) as more:
                return self._http.request(method, path, **words, **more)

        return self._answered(send)

    def copy(self, path: str, headers: dict[str, str], file: IO[bytes]) -> None:
        """Write the body of a response to a file, block by block.

        Raises:
            Problem: The service refused the call.
            Unreachable: The service did not respond.
        """

        def send() -> httpx.Response:
            file.seek(0)
            file.truncate()
            with self._http.stream("GET", path, headers=headers) as answer:
                if answer.is_success:
                    file.writelines(answer.iter_bytes())
                else:
                    answer.read()
                return answer

        self._answered(send)

    def _answered(self, send: Callable[[], httpx.Response]) -> httpx.Response:
        deadline = time.monotonic() + self._patience_s
        tried = 0
        while True:
            tried += 1
            answer: httpx.Response | None = None
            try:
                answer = send()
                if answer.is_success:
                    return answer
                reason: Exception = _problem(answer)
            except httpx.TransportError as error:
                reason = Unreachable(
                    f"{self.url} does not answer ({_words(error)}), tried {tried} times; "
                    "check that the service runs and that its URL is right"
                )
                reason.__cause__ = error
            is_lasting = getattr(reason, "code", None) in _LASTING
            if answer is not None and (answer.status_code not in _NOT_NOW or is_lasting):
                raise reason
            pause = pause_s(tried, answer)
            if time.monotonic() + pause > deadline:
                raise reason
            time.sleep(pause)


def content_of(answer: httpx.Response) -> dict[str, Any]:
    """JSON object in a response.

    Raises:
        Unreachable: The body is something else, so another program answers at this URL.
    """
    try:
        content = answer.json()
    except ValueError:
        content = None
    if not isinstance(content, dict):
        raise Unreachable(
            f"{answer.url} answers with {answer.headers.get('content-type', 'no content')}; "
            "expected the URL of motorid"
        )
    return content


def pause_s(tried: int, answer: httpx.Response | None = None) -> float:
    """Time to wait before the next attempt [s].

    Args:
        tried: Number of attempts so far.
        answer: Response with an optional `Retry-After`, or None without a response.
    """
    asked = _retry_after(answer.headers.get("retry-after")) if answer is not None else None
    if asked is not None:
        return asked
    longest = min(_LONGEST_PAUSE_S, _FIRST_PAUSE_S * 2.0 ** min(tried - 1, 10))
    # Not for cryptography: the jitter only keeps clients from calling at once.
    return random.uniform(0.5, 1.0) * longest


def _retry_after(text: str | None) -> float | None:
    """Time in a `Retry-After` header, which is a number or a date [s]."""
    if text is None:
        return None
    try:
        return max(0.0, float(text))
    except ValueError:
        pass
    try:
        moment = parsedate_to_datetime(text)
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return max(0.0, (moment - datetime.now(UTC)).total_seconds())


def _problem(answer: httpx.Response) -> Exception:
    try:
        body = answer.json()
    except ValueError:
        body = None
    return problem_from(answer.status_code, body)


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__
