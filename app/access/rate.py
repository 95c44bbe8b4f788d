"""Rate: how many calls a key may make, counted in a token bucket.

    bucket = Bucket(rate_per_s=50.0, burst=500)
    bucket.take(now)       None, or the time after which the next call is let through [s]

A key holds up to `burst` calls and gets `rate_per_s` new ones a second.  The buckets are in the
memory of this process: where several servers share one database each has its own, so that a key may
make as many times the calls as there are servers.  A restart fills them.

Health asks for no key and so has no bucket; nor has a service that runs without keys.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.access.service import Caller
from app.errors import TooManyRequests
from app.metrics import Metrics
from app.problems import problem_of

__all__ = ["Bucket", "RateLimit"]


@dataclass
class Bucket:
    """What one key may still call.

    Args:
        rate_per_s: Calls that it gets each second.
        burst: Most calls that it holds.
        left: Calls that it holds.
        filled: When that was [s].
    """

    rate_per_s: float
    burst: int
    left: float
    filled: float

    def take(self, now: float) -> float | None:
        """Take one call; None, or the time until there is one [s].

        Args:
            now: The time of a clock that never jumps [s].
        """
        elapsed = max(0.0, now - self.filled)
        self.left = min(float(self.burst), self.left + elapsed * self.rate_per_s)
        self.filled = now
        if self.left < 1.0:
            return (1.0 - self.left) / self.rate_per_s
        self.left -= 1.0
        return None

    @property
    def full_in_s(self) -> float:
        """Time until it is full again [s]."""
        return (self.burst - self.left) / self.rate_per_s


class RateLimit:
    """Refuses the calls of a key that makes too many, and tells each call how many are left.

    It stands behind the gate, so that it counts only who was let in.

    Args:
        app: The layer below.
        rate_per_s: Calls a second and key; 0 lets everything through.
        burst: Most calls at once.
        metrics: Where refusals are counted.
        clock: A clock that never jumps [s].
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        rate_per_s: float,
        burst: int,
        metrics: Metrics,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.app = app
        self._rate_per_s = rate_per_s
        self._burst = burst
        self._metrics = metrics
        self._clock = clock
        self._buckets: dict[str, Bucket] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on if its key may make another call."""
        caller = scope.get("state", {}).get("caller")
        key_id = caller.key_id if isinstance(caller, Caller) else None
        if scope["type"] != "http" or key_id is None or self._rate_per_s == 0.0:
            await self.app(scope, receive, send)
            return
        # Only the thread of the event loop comes here, and it does not wait in between.
        bucket = self._bucket(key_id)
        wait_s = bucket.take(self._clock())
        headers = self._headers(bucket)

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(headers)
            await send(message)

        if wait_s is None:
            await self.app(scope, receive, answer)
            return
        self._metrics.refused.labels("rate").inc()
        error = TooManyRequests(
            f"the key made more than {self._rate_per_s:g} calls a second; wait "
            f"{math.ceil(wait_s)} s, and ask less often or listen to the events of a fit",
            retry_after_s=wait_s,
        )
        await problem_of(error)(scope, receive, answer)

    def _bucket(self, key_id: str) -> Bucket:
        if key_id not in self._buckets:
            full = float(self._burst)
            bucket = Bucket(self._rate_per_s, self._burst, full, self._clock())
            self._buckets[key_id] = bucket
        return self._buckets[key_id]

    def _headers(self, bucket: Bucket) -> dict[str, str]:
        """The fields of draft-ietf-httpapi-ratelimit-headers."""
        window_s = math.ceil(self._burst / self._rate_per_s)
        left, full_in_s = math.floor(bucket.left), math.ceil(bucket.full_in_s)
        return {
            "RateLimit-Policy": f'"key";q={self._burst};w={window_s}',
            "RateLimit": f'"key";r={left};t={full_in_s}',
        }
