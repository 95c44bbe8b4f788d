"""Diagnosis entries: variance shares, correlations and shifts with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from identification.diagnosis.detection import ChannelCheck, Detection
from identification.diagnosis.localise import Deficiency, Localisation, Missing
from identification.model.excitation import records_of
from identification.result.diagnosis import detection_entry, shift_entries, trace_entry
from identification.result.entries import parameter_entry
from tests.motors import motor_named, noiseless


def test_a_term_that_follows_a_driver_is_explained_by_it_alone() -> None:
    """A torque even in the speed is uncorrelated with it, yet the speed explains 97 % of it."""
    records = records_of(noiseless(motor_named("servo 100 W"), seed=3))
    silent = Deficiency("V", 0.0, 0.1, 0.0, 1.0, False)
    loud = Deficiency("N m", 0.1, 0.1, 90.0, 1e-9, True)
    pieces = tuple(
        Missing(r.run, r.start, r.time, np.zeros(r.rows), np.zeros(r.rows),
                -1e-6 * r.measured[:, 1] ** 2, np.zeros(r.rows))
        for r in records
    )  # fmt: skip

    entry = trace_entry(Localisation(silent, loud, np.ones(2), pieces), None, records)

    drivers = entry["mechanical"]["drivers"]
    assert abs(drivers["speed"]["correlation"]) < 0.5
    assert drivers["speed"]["share"] > 0.97
    assert drivers["speed"]["share"] == max(d["share"] for d in drivers.values())
    assert entry["electrical"]["drivers"]["speed"] == {"correlation": None, "share": None}
    assert entry["mechanical"]["significant"] is True


def test_without_a_search_the_entries_are_empty() -> None:
    """Without a search there is neither a detection nor a trace."""
    assert detection_entry(None) == {}
    assert trace_entry(None, None, []) == {}


def test_a_detection_keeps_its_reasons() -> None:
    """The entry contains each check with its reason, and the sentence."""
    check = ChannelCheck("speed", "training", 4.0, 1.1, 1e-9, 0.2, False, "too large")

    entry = detection_entry(Detection(0.01, (check,), True, "Something is missing."))

    assert entry["missing"] is True
    assert entry["checks"][0]["reason"] == "too large"
    assert entry["sentence"] == "Something is missing."


def test_a_shift_has_the_spread_of_two_independent_fits() -> None:
    """1.11 over 1.00 at 1 % each is a shift of 11 % with a standard deviation of 1.57 %."""
    rng = np.random.default_rng(2)
    before, after = 1.11 * (1 + 0.01 * rng.standard_normal(20_000)), 1 + 0.01 * (
        rng.standard_normal(20_000)
    )  # fmt: skip
    entries = [{"Ra25": parameter_entry(draws, "ohm", True)} for draws in (after, before)]

    shift = shift_entries(entries[0], entries[1], {"Ra25": after}, {"Ra25": before})["Ra25"]

    assert shift["relative"]["mean"] == pytest.approx(0.11, abs=2e-3)
    assert shift["relative"]["sd"] == pytest.approx(0.0111 * np.sqrt(2), rel=0.03)
    assert shift["off"] is True


@pytest.mark.parametrize(("offset", "known"), [(0.02, True), (0.5, False)])
def test_an_insignificant_or_undetermined_shift_is_not_marked(offset: float, known: bool) -> None:
    """A shift of 2 % at 1 % each is insignificant; one of 50 % is ignored if undetermined."""
    rng = np.random.default_rng(5)
    before = (1 + offset) * (1 + 0.01 * rng.standard_normal(2000))
    after = 1 + 0.01 * rng.standard_normal(2000)
    entries = [{"b": parameter_entry(draws, "N m s/rad", known)} for draws in (after, before)]

    shift = shift_entries(entries[0], entries[1], {"b": after}, {"b": before})["b"]

    assert shift["off"] is False
