"""Speed as the difference of a logged angle, where no speed is logged."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.commands.arguments import mapping_of
from identification import errors
from identification.checks.finding import factor, other_unit
from identification.ingest import MappingLike, Run, read_run
from identification.preview import examine
from tests.ingest.samples import motor, write

Array = NDArray[np.float64]

STEP = 1e-3
COUNTS = 4096
COUNT = 2.0 * math.pi / COUNTS


def turned(columns: dict[str, Array]) -> Array:
    """Angle of a motor: the integral of its speed [rad]."""
    return np.cumsum(columns["speed_rad_s"]) * STEP


def read(
    tmp_path: Path, name: str, angle: Array, mapping: MappingLike | None = None, rows: int = 4000
) -> Run:
    """Read a run in which an angle replaces the speed."""
    columns = {key: value[:rows] for key, value in motor().items() if key != "speed_rad_s"}
    path = tmp_path / "run.csv"
    path.write_bytes(write({**columns, name: angle[:rows]}))
    return read_run(path, mapping=mapping)


def counts(bits: int | None = None) -> Array:
    """Counts of an encoder on the simulated motor, in a counter of some bits."""
    found = np.floor(turned(motor()) / COUNT)
    return found if bits is None else np.mod(found, 2.0**bits)


def mapped(**more: float) -> dict[str, object]:
    """Mapping of the column of counts."""
    return {"position_rad": {"column": "count", "scale": COUNT, **more}}


def test_speed_is_the_difference_over_the_interval_that_ends_at_the_sample(tmp_path: Path) -> None:
    """A parabola t^2 has the differences t_k + t_(k-1); the first sample ends no interval."""
    time = motor()["time_s"]

    run = read(tmp_path, "position_rad", time**2)

    assert np.array_equal(run.time, time[1:])
    assert run.speed == pytest.approx(time[1:] + time[:-1], abs=1e-9)
    assert run.sources["speed_rad_s"].method == "difference"
    assert [w.code for w in run.warnings].count("speed_from_angle") == 1


def test_resolution_of_an_encoder_stays_in_the_speed(tmp_path: Path) -> None:
    """Every speed is a whole number of counts over the interval."""
    run = read(tmp_path, "count", counts(), mapped())

    in_counts = run.speed * STEP / COUNT
    assert in_counts == pytest.approx(np.round(in_counts), abs=1e-6)
    assert np.max(np.abs(run.speed - motor()["speed_rad_s"][1:])) < 1.01 * COUNT / STEP


@pytest.mark.parametrize("given", [{}, {"period": 65536.0}])
def test_overflow_of_a_counter_does_not_change_the_speed(
    tmp_path: Path, given: dict[str, float]
) -> None:
    """The expected speed is that of a counter that does not overflow."""
    assert np.max(np.abs(np.diff(counts(16)))) > 60_000

    run = read(tmp_path, "count", counts(16), mapped(**given))

    expected = read(tmp_path, "count", counts(), mapped())
    assert run.speed == pytest.approx(expected.speed, abs=1e-6)


@pytest.mark.parametrize(("header", "turn"), [("Winkel [deg]", 360.0), ("angle [rad]", 2 * np.pi)])
def test_angle_within_one_turn_is_continued(tmp_path: Path, header: str, turn: float) -> None:
    """The expected speed is that of the angle over all turns."""
    angle = turned(motor())

    run = read(tmp_path, header, np.mod(angle / (2 * np.pi), 1.0) * turn)

    assert run.speed == pytest.approx(np.diff(angle) / STEP, abs=1e-6)
    assert np.max(np.abs(np.diff(run.position))) < 1.0 if run.position is not None else False


def test_sample_after_a_gap_is_omitted(tmp_path: Path) -> None:
    """A difference over a gap is no speed of a sample: two records lose one sample each."""
    columns = {k: np.delete(v, slice(1000, 1500)) for k, v in motor().items() if k[:5] != "speed"}
    angle = np.delete(turned(motor()), slice(1000, 1500))
    path = tmp_path / "run.csv"
    path.write_bytes(write({**columns, "position_rad": angle}))

    run = read_run(path)

    assert run.rows == angle.size - 2
    assert [stop - start for start, stop in run.segments] == [999, 2499]


def test_logged_speed_is_not_replaced(tmp_path: Path) -> None:
    """The expected speed is that of the file."""
    path = tmp_path / "run.csv"
    path.write_bytes(write({**motor(), "position_rad": turned(motor())}))

    run = read_run(path)

    assert np.array_equal(run.speed, motor()["speed_rad_s"])
    assert "speed_from_angle" not in [w.code for w in run.warnings]


def test_jump_by_an_unknown_period_is_refused(tmp_path: Path) -> None:
    """No turn and no counter has 50000 counts; the message says how to give the period."""
    with pytest.raises(errors.AmbiguousAngle, match='"period": "PERIOD"'):
        read(tmp_path, "count", np.mod(counts(), 50000.0), mapped())

    run = read(tmp_path, "count", np.mod(counts(), 50000.0), mapped(period=50000))

    assert run.speed == pytest.approx(read(tmp_path, "count", counts(), mapped()).speed, abs=1e-6)


def test_period_is_the_last_word_of_a_map_text() -> None:
    """The expected mapping has each part of the text under its key."""
    entry = {"column": "phi 1", "scale": 2.0, "offset": 1.0, "unit": "deg", "period": 180.0}

    assert mapping_of(None, ["position_rad=phi 1 * 2 + 1 in deg mod 180"]) == {
        "position_rad": entry
    }
    for wrong in ("position_rad=phi mod 0", "voltage_V=v mod 360"):
        with pytest.raises(errors.MappingError, match="period"):
            mapping_of(None, [wrong])


def test_motor_that_turns_too_fast_for_its_angle_is_refused(tmp_path: Path) -> None:
    """Steps of 0.45 turns could be steps of 0.55 turns backwards."""
    angle = np.mod(0.45 * np.arange(4000), 1.0)

    with pytest.raises(errors.AmbiguousAngle, match="direction is ambiguous"):
        read(tmp_path, "angle [rev]", angle)


def test_values_beyond_the_given_period_are_refused(tmp_path: Path) -> None:
    """A counter of 8 bit has no 65535."""
    with pytest.raises(errors.AmbiguousAngle, match="more than the period"):
        read(tmp_path, "count", counts(16), mapped(period=256))


def test_count_without_a_scale_asks_for_it(tmp_path: Path) -> None:
    """The angle of one count is not known."""
    with pytest.raises(errors.MissingColumn, match="RAD_PER_COUNT"):
        read(tmp_path, "encoder_count", counts())


def test_an_encoder_in_volts_is_no_angle(tmp_path: Path) -> None:
    """The level of its pulses needs a counter, and a voltage in proportion to the speed a gain."""
    with pytest.raises(errors.MissingColumn, match="RAD_S_PER_V"):
        read(tmp_path, "encoder_V", 5.0 * (counts() % 2))


def test_ten_samples_are_too_few_for_their_differences(tmp_path: Path) -> None:
    """Nine differences remain."""
    with pytest.raises(errors.TooFewRows, match="9 samples"):
        read(tmp_path, "position_rad", turned(motor()), rows=10)


def test_corrections_and_mapping_refer_to_the_column_of_the_angle(tmp_path: Path) -> None:
    """A speed without a column is corrected by the factor of the angle."""
    run = read(tmp_path, "count", counts(16), mapped(period=65536))

    mapping = examine([run]).mapping()

    assert factor(run, "speed_rad_s", -1.0).endswith(f"count * {-COUNT:.12g} mod 65536")
    assert "position_rad=count" in other_unit(run, "speed_rad_s", "rpm")
    assert "speed_rad_s" not in mapping
    assert np.array_equal(read(tmp_path, "count", counts(16), mapping).speed, run.speed)


def test_a_speed_that_overflows_its_number_is_continued(tmp_path: Path) -> None:
    """The expected speed is that of the motor, which exceeds half the period."""
    speed = motor()["speed_rad_s"]
    period = 1.2 * float(np.abs(speed).max())
    wrapped = np.mod(speed + period / 2, period) - period / 2
    path = tmp_path / "run.csv"
    path.write_bytes(write({**motor(), "speed_rad_s": wrapped}))

    mapping = {"speed_rad_s": {"column": "speed_rad_s", "period": period}}
    run = read_run(path, mapping=mapping)

    assert np.ptp(wrapped) < np.ptp(speed)
    assert run.speed == pytest.approx(speed, abs=1e-9)
