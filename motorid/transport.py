"""Calls that are repeated until they are answered.

A call is sent again where no answer came, or one that says "not now" (429, 502, 503, 504): after
the time that `Retry-After` names, else after a pause that doubles and is drawn at random, so that
many clients of a service that comes back do not all knock at once.  Only calls may be repeated
that do the same when they are sent twice; who calls says so.
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
    """A connection to one service.

    Args:
        url: Address of the service, with or without ``/api/v1``.
        key: Key to show, or None.
        patience_s: Time over which a call is repeated [s].
        timeout_s: Time to wait for each part of an answer [s].
    """

    def __init__(self, url: str, key: str | None, patience_s: float, timeout_s: float) -> None:
        base = url.rstrip("/").removesuffix("/api/v1")
        if not base.startswith(("http://", "https://")):
            raise ValueError(f"{url!r} is no address of a service; expected http:// or https://")
        self.url = base
        self._patience_s = patience_s
        self._http = httpx.Client(
            base_url=f"{base}/api/v1",
            headers={"Authorization": f"Bearer {key}"} if key else {},
            timeout=httpx.Timeout(timeout_s, connect=min(timeout_s, 10.0)),
        )

    def close(self) -> None:
        """Give the connections back."""
        self._http.close()

    def call(
        self,
        method: str,
        path: str,
        *,
        content: Callable[[], AbstractContextManager[dict[str, Any]]] | None = None,
        repeat: bool = True,
        **words: Any,
    ) -> httpx.Response:
        """The answer of a call.

        Args:
            method: Such as ``GET``.
            path: Behind ``/api/v1``.
            content: Makes what is sent, anew for each try: a file is read from its beginning.
            repeat: Whether the call may be sent again.
            **words: For `httpx.Client.request`.

        Raises:
            Problem: The service refused.
            Unreachable: There was no answer.
        """

        def send() -> httpx.Response:
            with content() if content else nullcontext({}) as more:
                return self._http.request(method, path, **words, **more)

        return self._answered(send, self._patience_s if repeat else 0.0)

    def copy(self, path: str, headers: dict[str, str], file: IO[bytes]) -> None:
        """Write the content of an answer to a file, piece by piece.

        Raises:
            Problem: The service refused.
            Unreachable: There was no answer.
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

        self._answered(send, self._patience_s)

    def _answered(self, send: Callable[[], httpx.Response], patience_s: float) -> httpx.Response:
        deadline = time.monotonic() + patience_s
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
                    "is the service running, and is the address right?"
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
    """The JSON object of an answer.

    Raises:
        Unreachable: It is something else, so another program answers at this address.
    """
    try:
        content = answer.json()
    except ValueError:
        content = None
    if not isinstance(content, dict):
        raise Unreachable(
            f"{answer.url} answers with {answer.headers.get('content-type', 'no content')}; is "
            "this the address of motorid?"
        )
    return content


def pause_s(tried: int, answer: httpx.Response | None = None) -> float:
    """Time to wait before the next try [s].

    Args:
        tried: How often the call was sent.
        answer: What came, whose `Retry-After` is obeyed; None where nothing came.
    """
    asked = _retry_after(answer.headers.get("retry-after")) if answer is not None else None
    if asked is not None:
        return asked
    longest = min(_LONGEST_PAUSE_S, _FIRST_PAUSE_S * 2.0 ** min(tried - 1, 10))
    # Not cryptography: it only keeps clients from knocking in step.
    return random.uniform(0.5, 1.0) * longest


def _retry_after(text: str | None) -> float | None:
    """Seconds of a `Retry-After` header, which is a number or a date."""
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
