"""Request and response schemas of runs."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from app.tables import RunRow
from app.texts import Documented, Moment, with_example

__all__ = ["PreviewOut", "RunList", "RunOut", "UPLOAD_BODY", "UploadBody"]

_EXAMPLE: dict[str, Any] = {
    "id": "run_n2dq4hoyzmxrj6tcf7k3wvb5ea",
    "sha256": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    "file": "training_1.csv",
    "motor": "bench 4, motor 17",
    "bytes": 1604211,
    "rows": 24000,
    "sample_rate_hz": 1000.0,
    "duration_s": 23.999,
    "channels": {
        "voltage_V": {"min": -12.0, "max": 12.0},
        "current_A": {"min": -3.91, "max": 3.87},
        "speed_rad_s": {"min": -141.2, "max": 139.8},
        "temperature_degC": {"min": 24.9, "max": 41.3},
    },
    "mapping": {"speed_rad_s": {"column": "n_ist", "unit": "rpm"}},
    "warnings": [],
    "created_at": "2026-11-21T12:00:00.000000Z",
}


class UploadBody(Documented):
    """Form of an upload."""

    file: bytes
    """Run file: a text table of samples."""
    motor: str = Field(default="", max_length=200, examples=["bench 4, motor 17"])
    """Name of the motor."""
    mapping: str = Field(
        default="",
        examples=[
            '{"speed_rad_s": {"column": "n_ist", "unit": "rpm"}, '
            '"current_A": {"column": "sensor_V", "scale": 2.5}}'
        ],
    )
    """Columns and units of the channels, as JSON; required if the header does not name them.
    Value = (cell * scale + offset) in the given unit."""


UPLOAD_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"multipart/form-data": {"schema": UploadBody.model_json_schema()}},
    }
}
"""OpenAPI schema of the body of an upload, which is streamed and not validated by its model."""


class ChannelRange(Documented):
    """Minimum and maximum of a channel, in SI units."""

    min: float
    max: float


class RunWarningOut(Documented):
    """Warning about a run that matters for the interpretation of a result."""

    code: str
    message: str
    row: int | None = None
    column: str | None = None


class RunOut(Documented):
    """A stored run."""

    model_config = with_example(_EXAMPLE)

    id: str
    sha256: str
    """SHA-256 of the uploaded bytes."""
    file: str
    """File name given in the upload."""
    motor: str | None
    bytes: int
    rows: int
    """Number of samples."""
    sample_rate_hz: float
    duration_s: float
    channels: dict[str, ChannelRange]
    mapping: dict[str, Any] | None
    warnings: list[RunWarningOut]
    created_at: Moment
    """UTC, ISO 8601."""

    @classmethod
    def of(cls, row: RunRow) -> RunOut:
        """Build the schema from a stored run."""
        return cls.model_validate(row, from_attributes=True)


class PreviewOut(Documented):
    """Preview of a run file; docs/cli.md describes `motorid check`."""

    accepted: bool
    """True if a fit would accept the file as it is."""
    runs: list[dict[str, Any]]
    """The run with its channels (column, unit, scale, offset), gaps, excitation and warnings; empty
    if the file cannot be read."""
    errors: list[dict[str, Any]]
    """Why the file cannot be read or fitted."""
    findings: list[dict[str, Any]]
    """Contradictions and suspicions, each with the mapping that corrects it."""
    parameters: dict[str, dict[str, Any]]
    """Precision of the nominal parameters that a fit of this run can reach, and what to record to
    improve it; empty if it was not computed."""
    notes: list[str]
    """What the run cannot show."""
    mapping: dict[str, Any]
    """Mapping of the channels as understood."""


class RunList(Documented):
    """A page of runs, newest first."""

    items: list[RunOut]
    next: str | None
    """Value of `after` for the next page; null on the last page."""
