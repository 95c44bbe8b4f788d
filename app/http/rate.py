"""Rate limit per API key: token bucket.

    bucket = Bucket(rate_per_s=50.0, burst=500)
    bucket.take(now)       None, or the time until the next call is accepted [s]

A bucket holds up to `burst` tokens, one per call, and gains `rate_per_s` tokens per second.  The
buckets are kept in the memory of this process: several servers on one database each grant the full
rate, and a restart refills the buckets.

Calls without a key have no bucket: health checks, and all calls to a service without keys.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.access.service import Caller
from app.errors import TooManyRequests
from app.http.problems import problem_of
from app.metrics import Metrics

__all__ = ["Bucket", "RateLimit"]


@dataclass
class Bucket:
    """Token bucket of one key."""

    rate_per_s: float
    """Refill rate [tokens/s]."""
    burst: int
    """Capacity [tokens]."""
    left: float
    """Current number of tokens."""
    filled: float
    """Time of the last update, monotonic clock [s]."""

    def take(self, now: float) -> float | None:
        """Take one token at a monotonic time; return None, or the time until one is free [s]."""
        elapsed = max(0.0, now - self.filled)
        self.left = min(float(self.burst), self.left + elapsed * self.rate_per_s)
        self.filled = now
        if self.left < 1.0:
            return (1.0 - self.left) / self.rate_per_s
        self.left -= 1.0
        return None

    @property
    def full_in_s(self) -> float:
        """Time until the bucket is full [s]."""
        return (self.burst - self.left) / self.rate_per_s


class RateLimit:
    """Middleware that enforces the rate limit of each key and reports the remaining calls.

    This layer is inside the gate, so that it counts only authenticated calls.

    Each key has a bucket of `burst` calls; a rate of 0 disables the limit.
    """

    def __init__(self, app: ASGIApp, *, rate_per_s: float, burst: int, metrics: Metrics) -> None:
        self.app = app
        self._rate_per_s = rate_per_s
        self._burst = burst
        self._metrics = metrics
        self._buckets: dict[str, Bucket] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        caller = scope.get("state", {}).get("caller")
        key_id = caller.key_id if isinstance(caller, Caller) else None
        if scope["type"] != "http" or key_id is None or self._rate_per_s == 0.0:
            await self.app(scope, receive, send)
            return
        # Thread-safe: only the event loop runs this code, and it does not await here.
        full = float(self._burst)
        new = Bucket(self._rate_per_s, self._burst, full, time.monotonic())
        bucket = self._buckets.setdefault(key_id, new)
        wait_s = bucket.take(time.monotonic())
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

    def _headers(self, bucket: Bucket) -> dict[str, str]:
        """Header fields of draft-ietf-httpapi-ratelimit-headers."""
        window_s = math.ceil(self._burst / self._rate_per_s)
        left, full_in_s = math.floor(bucket.left), math.ceil(bucket.full_in_s)
        return {
            "RateLimit-Policy": f'"key";q={self._burst};w={window_s}',
            "RateLimit": f'"key";r={left};t={full_in_s}',
        }
