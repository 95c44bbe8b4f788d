"""Preview of run files: columns as understood, excitation, contradictions, expected precision.

    check(["cold.csv", "hot.csv"]).table()

Nothing is fitted but the nominal model, on segments; nothing is written.  A file that cannot be
read does not keep the others from being examined.  `examine` leaves out the precision, the only
part that takes more than a moment.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from html import escape

import pandas as pd

from identification.checks.campaign import check_runs
from identification.checks.finding import Finding
from identification.checks.values import check_values
from identification.errors import IdentificationError, InputError, RunFileError
from identification.fit.campaign import campaign_of
from identification.ingest.file import Limits
from identification.ingest.given import RunLike, each_given, run_of
from identification.ingest.mapping import OPTIONAL_CHANNELS, MappingLike
from identification.ingest.run import Run, Source
from identification.ingest.units import CHANNEL_QUANTITIES, FACTOR_QUANTITIES, canonical_unit
from identification.model.excitation import Record
from identification.preview.excitation import Excitation, excitation_of
from identification.preview.prospects import Prospect, prospects_of

__all__ = ["Preview", "check", "examine"]


@dataclass(frozen=True)
class Preview:
    """Preview of run files before a fit."""

    runs: tuple[Run, ...]
    """Readable runs, in the order given."""
    errors: tuple[InputError, ...]
    """Reasons why the other files cannot be read, or why the runs together cannot be fitted."""
    findings: tuple[Finding, ...]
    """Contradictions and suspicions in the readable runs."""
    excitation: tuple[Excitation, ...]
    """Excitation of each readable run."""
    prospects: tuple[Prospect, ...]
    """Expected precision of the nominal parameters; empty if runs contradict."""
    notes: tuple[str, ...]
    """What the runs cannot show, and what to record instead."""
    records: tuple[Record, ...] = ()
    """Records of the readable runs; empty if they do not suffice for a fit."""

    def with_prospects(self) -> Preview:
        """The preview with expected precision, unless runs contradict, and suspicions."""
        if not self.records or any(f.severity == "refuse" for f in self.findings):
            return self
        try:
            prospects, unusual, found = prospects_of(self.records, excitation_of(self.runs))
        except IdentificationError as error:
            note = f"the expected precision cannot be computed: {error}"
            return replace(self, notes=(*self.notes, note))
        findings, notes = (*self.findings, *unusual), (*found, *self.notes)
        return replace(self, prospects=tuple(prospects), findings=findings, notes=notes)

    @property
    def is_accepted(self) -> bool:
        """True if `identify` would accept the files as they are."""
        return not self.errors and not any(f.severity == "refuse" for f in self.findings)

    def mapping(self) -> dict[str, object]:
        """Mapping of each channel as understood, which makes later readings explicit.

        Channels whose column differs between the runs stand under ``files``.
        """
        if not self.runs:
            return {}
        common: dict[str, object] = {}
        single: dict[str, dict[str, object]] = {}
        for name in (*CHANNEL_QUANTITIES, *FACTOR_QUANTITIES):
            # Runs may have the same name.
            entries = [(run.name, _mapped(run.sources.get(name))) for run in self.runs]
            first = entries[0][1]
            if any(entry != first for _, entry in entries):
                for file, entry in entries:
                    if entry is not None or name in OPTIONAL_CHANNELS:
                        single.setdefault(file, {})[name] = entry
            elif first is not None:
                common[name] = first
        return common | ({"files": single} if single else {})

    def table(self) -> pd.DataFrame:
        """Estimate and expected standard deviation of each nominal parameter, with advice."""
        columns = ["value", "sd", "unit", "identified", "advice"]
        rows = [[getattr(one, column) for column in columns] for one in self.prospects]
        names = pd.Index([one.name for one in self.prospects], name="parameter")
        return pd.DataFrame(rows, names, columns)

    def __repr__(self) -> str:
        remarks = [*self.errors, *self.findings, *self.notes]
        verdict = "accepted" if self.is_accepted else "refused"
        names = ", ".join(run.name for run in self.runs) or "none readable"
        parts = [f"Runs {verdict}: {names}", self.table().to_string() if self.prospects else ""]
        return "\n".join(filter(None, [*parts, *(f"- {remark}" for remark in remarks)]))

    def _repr_html_(self) -> str:
        """Runs, errors, findings, expected precision and notes, for notebooks."""
        runs = ", ".join(
            f"{escape(run.name)} ({run.rows} samples at {run.sample_rate_hz:.4g} Hz)"
            for run in self.runs
        )
        remarks = [*self.errors, *self.findings, *self.notes]
        listed = "".join(f"<li>{escape(str(remark))}</li>" for remark in remarks)
        verdict = "accepted" if self.is_accepted else "refused"
        table = self.table().to_html(float_format="{:.4g}".format) if self.prospects else ""
        return f"<p><b>Runs {verdict}</b>: {runs or 'none readable'}</p>{table}<ul>{listed}</ul>"

    def content(self) -> dict[str, object]:
        """The preview as plain data, without NaN and infinity."""
        return {
            "schema_version": 1,
            "accepted": self.is_accepted,
            "runs": [
                _run_entry(run, excitation)
                for run, excitation in zip(self.runs, self.excitation, strict=True)
            ],
            "errors": [
                {
                    "code": one.code if isinstance(one, RunFileError) else None,
                    "message": one.message,
                    "file": error.file,
                    "row": one.row,
                    "column": one.column,
                    "examples": list(one.examples),
                }
                for error in self.errors
                for one in (error, *error.further)
            ],
            "findings": [finding.entry() for finding in self.findings],
            "parameters": {
                p.name: {
                    "value": p.value,
                    "expected_sd": p.sd if math.isfinite(p.sd) else None,
                    "unit": p.unit,
                    "identified": p.identified,
                    "advice": p.advice,
                }
                for p in self.prospects
            },
            "notes": list(self.notes),
            "mapping": self.mapping(),
        }


def check(
    runs: RunLike | Iterable[RunLike],
    mapping: MappingLike | None = None,
    *,
    names: Sequence[str | None] = (),
) -> Preview:
    """Examine runs and compute the precision that a fit can reach.

    Args:
        runs: Runs of one motor, paths of run files or DataFrames, or a single one.
        mapping: Columns of the channels; see `read_run`.
        names: Name of each run; default: the file names.

    Raises:
        InputError: An object is neither a run nor a path nor a DataFrame.
    """
    return examine(runs, mapping, names=names).with_prospects()


def examine(
    given: RunLike | Iterable[RunLike],
    mapping: MappingLike | None = None,
    *,
    names: Sequence[str | None] = (),
    limits: Limits | None = None,
) -> Preview:
    """Read and examine runs of one motor; the precision is left out.

    Raises:
        InputError: An object is neither a run nor a path nor a DataFrame.
    """
    runs: list[Run] = []
    errors: list[InputError] = []
    several = each_given(given, "runs")
    for number, one in enumerate(several, start=1):
        name = names[number - 1] if names else None
        if name is None and isinstance(one, pd.DataFrame):
            name = f"run {number}"
        try:
            runs.append(run_of(one, name, mapping, limits))
        except RunFileError as error:
            errors.append(error)
    if not runs:
        return Preview((), tuple(errors), (), (), (), ())
    verdict = check_runs(runs)
    together: list[str] = []
    records: tuple[Record, ...] = ()
    # The remaining conditions of a fit that concern all runs together.
    try:
        check_values(runs, ())
        # Without the samples that a fit omits.
        campaign = campaign_of(verdict.runs, ())
        records = campaign.training
        together = [str(w) for w in campaign.warnings if w.code != "unknown_temperature"]
    except InputError as error:
        # With an unreadable file the runs are not complete.
        errors += [] if errors else [error]
    fastest = max(float(abs(run.speed).max()) for run in runs)
    each = tuple(excitation_of([run], fastest) for run in runs)
    notes = (*together, *_notes(runs, excitation_of(runs)))
    return Preview(tuple(runs), tuple(errors), verdict.findings, each, (), notes, records)


def _notes(runs: Sequence[Run], total: Excitation) -> Iterator[str]:
    """Notes on what the excitation cannot show."""
    if total.directions == 1:
        yield (
            "the shaft turns in one direction only: dry friction, a constant load torque and an "
            "offset of the current sensor are not distinguishable; record both directions"
        )
    elif total.directions == 0:
        yield "the shaft does not turn; record runs in which the motor is driven"
    if total.temperature_degC is None:
        yield (
            "no run has a temperature: Ra25 and Kt25 are those of an unknown temperature, and the "
            "speed loop at other temperatures follows from typical temperature coefficients"
        )
    if all(run.position is None for run in runs):
        yield (
            "no run has a shaft angle (position_rad): cogging is found only where the integrated "
            "speed keeps the phase"
        )
    if len(runs) == 1:
        yield (
            "there is one run only: record a second one for validation, with another course of "
            "the voltage"
        )


def _mapped(source: Source | None) -> dict[str, object] | None:
    """Entry of a mapping for a channel; None if it has no column of its own."""
    if source is None or source.origin is not None:
        return None
    if source.value is not None:
        return {"value": source.value, "unit": source.unit}
    scaled = source.scale != 1.0 or source.offset != 0.0
    kept = ("column", "unit", "period", "sign", *(("scale", "offset") if scaled else ()))
    return {name: value for name, value in source.entry().items() if name in kept}


def _run_entry(run: Run, excitation: Excitation) -> dict[str, object]:
    gaps = [
        {
            "after_s": float(run.time[last - 1]),
            "length_s": float(run.time[last] - run.time[last - 1]),
        }
        for _, last in run.segments[:-1]
    ]
    return {
        "file": run.name,
        "sha256": run.sha256,
        "rows": run.rows,
        "sample_rate_hz": run.sample_rate_hz,
        "gaps": gaps,
        "channels": {
            name: source.entry() | {"si_unit": canonical_unit(name).name}
            for name, source in run.sources.items()
        },
        "clipped": {name: int(marked.sum()) for name, marked in run.clipped.items()},
        "excitation": asdict(excitation),
        "warnings": [
            {"code": w.code, "message": w.message, "row": w.row, "column": w.column}
            for w in run.warnings
        ],
    }
