"""View models of the web pages: API responses with numbers and times formatted for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from app.batches.schemas import BatchSummary
from app.fits.schemas import FitSummary, Progress
from app.runs.schemas import RunOut

__all__ = ["batch_view", "duration", "fit_view", "located", "run_view", "span", "when"]

_CHANNELS = {
    "voltage_V": "V",
    "current_A": "A",
    "speed_rad_s": "rad/s",
    "temperature_degC": "°C",
    "position_rad": "rad",
}
_NONE = "–"


def run_view(run: RunOut) -> dict[str, Any]:
    """View of a run for the table."""
    return {
        "id": run.id,
        "file": run.file,
        "motor": run.motor,
        "rows": f"{run.rows:,}".replace(",", "\u202f"),
        "rate": f"{run.sample_rate_hz:.4g} Hz",
        "length": duration(run.duration_s),
        "ranges": dict.fromkeys(_CHANNELS, _NONE)
        | {n: span(n, c.min, c.max) for n, c in run.channels.items() if n in _CHANNELS},
        "warnings": [located(w.model_dump()) for w in run.warnings],
        "created_at": run.created_at,
        "received": when(run.created_at),
    }


def fit_view(fit: FitSummary, files: Mapping[str, str]) -> dict[str, Any]:
    """View of a fit for the table and for its own page."""
    took = ""
    if fit.started_at and fit.ended_at:
        seconds = _time(fit.ended_at) - _time(fit.started_at)
        took = duration(seconds.total_seconds())
    return {
        **fit.model_dump(exclude={"training", "validation"}),
        "training": [files.get(run, run) for run in fit.training],
        "validation": [files.get(run, run) for run in fit.validation],
        "begun": when(fit.created_at),
        "percent": f"{100 * fit.progress.fraction:.0f} %",
        "progress_text": _progress(fit.progress),
        "took": took,
        "options": {name: _option(value) or _NONE for name, value in fit.options.items()},
    }


def batch_view(batch: BatchSummary) -> dict[str, Any]:
    """View of a batch for the table."""
    counts = [f"{number} {status}" for status, number in batch.counts.items() if number]
    return {
        **batch.model_dump(),
        "begun": when(batch.created_at),
        "percent": f"{100 * batch.progress.fraction:.0f} %",
        "has_ended": batch.status not in ("queued", "running"),
        "counts_text": ", ".join(counts),
    }


def _progress(progress: Progress) -> str:
    """Stage, percent and time left; `progressText` in calls.js does the same for later events."""
    parts = [progress.stage, f"{100 * progress.fraction:.0f} %"]
    if progress.remaining_s is not None:
        parts.append(f"about {duration(max(1, round(progress.remaining_s)))} left")
    return " · ".join(parts)


def located(entry: Mapping[str, Any]) -> str:
    """Message of an error or a warning after the row and the column that it concerns."""
    position = [f"{name} {entry[name]}" for name in ("row", "column") if entry.get(name)]
    return ": ".join([*([", ".join(position)] if position else []), entry["message"]])


def _option(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(f"{part:g}" if isinstance(part, float) else str(part) for part in value)
    return _NONE if value is None else str(value)


def span(name: str, low: float, high: float) -> str:
    """Range of a channel with its unit."""
    ends = (f"{end:.0f}" if 1e3 <= abs(end) < 1e6 else f"{end:.3g}" for end in (low, high))
    return f"{' … '.join(ends)} {_CHANNELS[name]}".replace("-", "\u2212")


def duration(seconds: float) -> str:
    """Duration for people, from seconds to hours."""
    if seconds < 120:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"


def _time(text: str) -> datetime:
    return datetime.fromisoformat(text)


def when(text: str) -> str:
    """Time in UTC, formatted for people; the script of the pages shows local time."""
    return f"{_time(text):%Y-%m-%d %H:%M} UTC"
