"""Connection deadlines and overload protection against slow clients.

A client without a key can open a connection, begin a request and stall.  Each connection uses a
file descriptor, and a service without free descriptors can answer no one.  Therefore

- the headers of a request must arrive within a time limit (`connection_class`);
- the body, except that of an upload, must arrive within the same limit (`BodyDeadline`);
- when most descriptors are in use, requests on new connections are rejected (`check_crowd`),
  except health checks, and the last descriptors are reserved for the service itself.
"""

from __future__ import annotations

import asyncio
import resource
from typing import Any, ClassVar

import anyio
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

from app.errors import BodyTooSlow, Unavailable
from app.http import HEALTH_PATHS, UPLOAD_PATHS
from app.http.problems import problem_of

__all__ = ["BodyDeadline", "accepted_at_once", "check_crowd", "connection_class"]

_CROWDED = 0.8
_FULL = 0.9
_UPLOADS = tuple(("POST", path) for path in UPLOAD_PATHS)


def connection_class(request_s: float) -> type[H11Protocol]:
    """Protocol class that uvicorn instantiates for each connection.

    The headers of a request must arrive within a time from the start of the connection or the end
    of the previous response [s].
    """

    class Connection(_Connection):
        patience_s = request_s
        most = _most_descriptors()

    return Connection


def accepted_at_once() -> int:
    """Number of connections accepted per iteration of the event loop.

    Some iterations pass before the first of them is handled, and all of them need descriptors.
    """
    most = _most_descriptors()
    return 1000 if most is None else max(1, min(1000, round((1.0 - _FULL) * most / 8.0)))


def _most_descriptors() -> int | None:
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return None if soft == resource.RLIM_INFINITY else soft


class _Connection(H11Protocol):
    """Connection with a deadline while no request is in progress."""

    patience_s: ClassVar[float]
    most: ClassVar[int | None]
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the deadline; abort at once if nearly all descriptors are in use."""
        super().connection_made(transport)
        # The kernel assigns the lowest free descriptor, so its number measures how many are in use.
        number = transport.get_extra_info("socket").fileno()
        if self.most is not None and number >= _FULL * self.most:
            transport.abort()
        elif self.most is not None and number >= _CROWDED * self.most:
            self.app_state = {**self.app_state, "is_crowded": True}
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the deadline."""
        super().connection_lost(exc)
        self._unwatch()

    def handle_events(self) -> None:
        """Handle received data; an incomplete request does not extend the deadline."""
        super().handle_events()
        if self._is_busy:
            self._unwatch()

    def on_response_complete(self) -> None:
        """Start the deadline of the next request."""
        super().on_response_complete()
        if not self._is_busy:
            self._watch()

    @property
    def _is_busy(self) -> bool:
        # uvicorn's annotation omits None.
        cycle: RequestResponseCycle | None = self.cycle
        return cycle is not None and not cycle.response_complete

    def _watch(self) -> None:
        self._unwatch()
        if not self.transport.is_closing():
            self._deadline = self.loop.call_later(self.patience_s, self._hang_up)

    def _unwatch(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _hang_up(self) -> None:
        if not self._is_busy and not self.transport.is_closing():
            self.transport.close()


def check_crowd(scope: Scope) -> None:
    """Raise `Unavailable` on a connection opened when descriptors were scarce; health passes."""
    if scope.get("state", {}).get("is_crowded") and scope["path"] not in HEALTH_PATHS:
        raise Unavailable("too many connections are open; try again in some seconds")


class BodyDeadline:
    """Middleware that aborts requests whose body is incomplete after `request_s` seconds.

    Uploads have separate limits.
    """

    def __init__(self, app: ASGIApp, request_s: float) -> None:
        self.app = app
        self.request_s = request_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request; if its body is late, answer 408 in place of the inner application."""
        if scope["type"] != "http" or (scope["method"], scope["path"]) in _UPLOADS:
            await self.app(scope, receive, send)
            return
        deadline = anyio.current_time() + self.request_s
        is_whole = is_late = has_begun = False

        async def received() -> Message:
            """Next message of the body; after the deadline, a client disconnect message."""
            nonlocal is_whole, is_late
            if is_whole:
                return await receive()
            with anyio.CancelScope(deadline=deadline):
                message: dict[str, Any] = dict(await receive())
                is_whole = not message.get("more_body", False)
                return message
            is_late = True
            return {"type": "http.disconnect"}

        async def answer(message: Message) -> None:
            nonlocal has_begun
            if is_late and not has_begun:
                # Discard the response of the inner application to a truncated request.
                return
            has_begun = True
            await send(message)

        await self.app(scope, received, answer)
        if is_late and not has_begun:
            error = BodyTooSlow(
                f"the body was not complete after {self.request_s:g} s; send the request again"
            )
            await problem_of(error)(scope, receive, send)
