"""Connections that do not come to the point: deadlines for requests, and what to do when crowded.

Anyone can open a connection, begin a request and fall silent, without a key.  Each holds a file
descriptor, and a service without descriptors answers nobody.  So

- what comes before a request, and its headers, have to be there within a time (`connection_class`);
- a body, but for that of an upload, has to be whole within the same time (`BodyDeadline`);
- when most descriptors are in use new connections are told to come back (`CrowdCheck`), health is
  still answered, and the last descriptors are kept for the service itself.
"""

from __future__ import annotations

import asyncio
import resource
from typing import Any, ClassVar

import anyio
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

from app.errors import BodyTooSlow, Unavailable
from app.paths import API_PREFIX, HEALTH_PATHS
from app.problems import problem_of

__all__ = ["BodyDeadline", "CrowdCheck", "accepted_at_once", "connection_class"]

_CROWDED = 0.8
_FULL = 0.9
_UPLOAD = ("POST", f"{API_PREFIX}/runs")


def connection_class(request_s: float) -> type[H11Protocol]:
    """What uvicorn makes for each connection.

    Args:
        request_s: Time until a connection has sent the headers of a request, from its beginning or
            the end of the answer before [s].
    """

    class Connection(_Connection):
        patience_s = request_s
        most = _most_descriptors()

    return Connection


def accepted_at_once() -> int:
    """Connections that are accepted in one round of the event loop.

    Some rounds pass until the first of them is looked at, and all must find descriptors.
    """
    most = _most_descriptors()
    return 1000 if most is None else max(1, min(1000, round((1.0 - _FULL) * most / 8.0)))


def _most_descriptors() -> int | None:
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return None if soft == resource.RLIM_INFINITY else soft


class _Connection(H11Protocol):
    """A connection with a deadline for whatever is no request in progress."""

    patience_s: ClassVar[float]
    most: ClassVar[int | None]
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request; hang up at once where hardly a descriptor is left."""
        super().connection_made(transport)
        # The system gives the lowest number that is free, so this one counts whatever is open.
        number = transport.get_extra_info("socket").fileno()
        if self.most is not None and number >= _FULL * self.most:
            transport.abort()
        elif self.most is not None and number >= _CROWDED * self.most:
            self.app_state = {**self.app_state, "is_crowded": True}
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop to wait."""
        super().connection_lost(exc)
        self._unwatch()

    def handle_events(self) -> None:
        """Take what came; what is still no request does not prolong the wait."""
        super().handle_events()
        if self._is_busy:
            self._unwatch()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        if not self._is_busy:
            self._watch()

    @property
    def _is_busy(self) -> bool:
        # Typed as if there always were one.
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


class CrowdCheck:
    """Refuses requests of connections for which hardly a descriptor was left, but for health.

    Args:
        app: The layer below.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on if there is room."""
        is_crowded = scope["type"] == "http" and scope.get("state", {}).get("is_crowded", False)
        if not is_crowded or scope["path"] in HEALTH_PATHS:
            await self.app(scope, receive, send)
            return
        error = Unavailable("too many connections are open; try again in some seconds")
        problem = problem_of(error)
        problem.headers["Connection"] = "close"
        await problem(scope, receive, send)


class BodyDeadline:
    """Gives up requests whose body is not whole in time; uploads have a time of their own.

    Args:
        app: The layer below.
        request_s: Time for a body [s].
    """

    def __init__(self, app: ASGIApp, request_s: float) -> None:
        self.app = app
        self.request_s = request_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and answer 408 in place of what is below where the body is late."""
        if scope["type"] != "http" or (scope["method"], scope["path"]) == _UPLOAD:
            await self.app(scope, receive, send)
            return
        body = _Body(receive, anyio.current_time() + self.request_s)
        has_begun = False

        async def answer(message: Message) -> None:
            nonlocal has_begun
            if body.is_late and not has_begun:
                # Of a request that was cut off, whatever the layers below make of it.
                return
            has_begun = True
            await send(message)

        await self.app(scope, body.receive, answer)
        if body.is_late and not has_begun:
            error = BodyTooSlow(
                f"the body was not complete after {self.request_s:g} s; send the request again"
            )
            await problem_of(error)(scope, receive, send)


class _Body:
    """The messages of a request, until they are late."""

    def __init__(self, receive: Receive, deadline: float) -> None:
        self._receive = receive
        self._deadline = deadline
        self._is_whole = False
        self.is_late = False

    async def receive(self) -> Message:
        """The next message; the caller has gone where the body is late."""
        if self._is_whole:
            return await self._receive()
        with anyio.CancelScope(deadline=self._deadline):
            message: dict[str, Any] = dict(await self._receive())
            self._is_whole = not message.get("more_body", False)
            return message
        self.is_late = True
        return {"type": "http.disconnect"}
