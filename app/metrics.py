"""Prometheus metrics of the running service.

Route templates and statuses are labels.  Ids and file names are not, because their number is
unbounded.
"""

from __future__ import annotations

from functools import partial

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

__all__ = ["MEDIA_TYPE", "Metrics"]

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"

_FIT_BUCKETS_S = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600, 7200)


class Metrics:
    """Counters, gauges and histograms of one service."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        counter = partial(Counter, registry=self.registry)
        gauge = partial(Gauge, registry=self.registry)
        histogram = partial(Histogram, registry=self.registry)
        self.requests = counter(
            "motorid_http_requests", "Requests answered.", ["method", "route", "status"]
        )
        self.request_seconds = histogram(
            "motorid_http_request_seconds", "Time to the end of an answer.", ["method", "route"]
        )
        self.uploaded_bytes = counter("motorid_uploaded_bytes", "Bytes of run files received.")
        self.uploads = counter(
            "motorid_uploads", "Run files received, by what became of them.", ["outcome"]
        )
        self.read_seconds = histogram("motorid_read_seconds", "Time to read a run file.")
        self.stored_runs = gauge("motorid_runs", "Runs that there are.")
        self.stored_bytes = gauge("motorid_run_bytes", "Bytes of the run files that there are.")
        self.free_bytes = gauge("motorid_free_bytes", "Space left in the data directory.")
        self.refused = counter(
            "motorid_refused",
            "Calls refused by a rate, a quota or a full queue, by which.",
            ["limit"],
        )
        self.removed = counter(
            "motorid_removed", "What was removed because of its age, by kind.", ["kind"]
        )
        self.fits = gauge("motorid_fits", "Fits that there are, by status.", ["status"])
        self.oldest_queued_seconds = gauge(
            "motorid_oldest_queued_fit_seconds", "Age of the fit that waits longest."
        )
        self.fit_capacity = gauge(
            "motorid_fit_capacity",
            "Fits that can be computed at once now; 0 while the cluster is away.",
        )
        self.fits_ended = counter(
            "motorid_fits_ended", "Fits that ended here, by status.", ["status"]
        )
        self.fit_attempts_failed = counter(
            "motorid_fit_attempts_failed", "Attempts that ended without a result."
        )
        self.fit_seconds = histogram(
            "motorid_fit_seconds", "Computing time of fits that succeeded.", buckets=_FIT_BUCKETS_S
        )
