"""Prometheus metrics of the running service.

Route templates and statuses are labels.  Ids and file names are not, because their number is
unbounded.
"""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

__all__ = ["MEDIA_TYPE", "Metrics"]

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"

_FIT_BUCKETS_S = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600, 7200)


class Metrics:
    """Counters, gauges and histograms of one service."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "motorid_http_requests",
            "Requests answered.",
            ["method", "route", "status"],
            registry=self.registry,
        )
        self.request_seconds = Histogram(
            "motorid_http_request_seconds",
            "Time to the end of an answer.",
            ["method", "route"],
            registry=self.registry,
        )
        self.uploaded_bytes = Counter(
            "motorid_uploaded_bytes", "Bytes of run files received.", registry=self.registry
        )
        self.uploads = Counter(
            "motorid_uploads",
            "Run files received, by what became of them.",
            ["outcome"],
            registry=self.registry,
        )
        self.read_seconds = Histogram(
            "motorid_read_seconds", "Time to read a run file.", registry=self.registry
        )
        self.stored_runs = Gauge("motorid_runs", "Runs that there are.", registry=self.registry)
        self.stored_bytes = Gauge(
            "motorid_run_bytes", "Bytes of the run files that there are.", registry=self.registry
        )
        self.free_bytes = Gauge(
            "motorid_free_bytes", "Space left in the data directory.", registry=self.registry
        )
        self.refused = Counter(
            "motorid_refused",
            "Calls refused by a rate, a quota or a full queue, by which.",
            ["limit"],
            registry=self.registry,
        )
        self.removed = Counter(
            "motorid_removed",
            "What was removed because of its age, by kind.",
            ["kind"],
            registry=self.registry,
        )
        self.fits = Gauge(
            "motorid_fits", "Fits that there are, by status.", ["status"], registry=self.registry
        )
        self.oldest_queued_seconds = Gauge(
            "motorid_oldest_queued_fit_seconds",
            "Age of the fit that waits longest.",
            registry=self.registry,
        )
        self.fit_capacity = Gauge(
            "motorid_fit_capacity",
            "Fits that can be computed at once now; 0 while the cluster is away.",
            registry=self.registry,
        )
        self.fits_ended = Counter(
            "motorid_fits_ended",
            "Fits that ended here, by status.",
            ["status"],
            registry=self.registry,
        )
        self.fit_attempts_failed = Counter(
            "motorid_fit_attempts_failed",
            "Attempts that ended without a result.",
            registry=self.registry,
        )
        self.fit_seconds = Histogram(
            "motorid_fit_seconds",
            "Computing time of fits that succeeded.",
            buckets=_FIT_BUCKETS_S,
            registry=self.registry,
        )

    def text(self) -> bytes:
        """All metrics in the Prometheus text format."""
        return generate_latest(self.registry)
