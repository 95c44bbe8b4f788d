"""The Python library as a script or a notebook uses it: `import identification as mi`."""

from __future__ import annotations

import re
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import identification as mi
from identification.ingest.run import Run
from identification.speed_loop import feedback_metrics
from tests.motors import campaign, motor_named

ROOT = Path(__file__).parents[1]
RUNS = campaign(motor_named("servo 100 W"), seed=3, rows=600)
PAPER = {"Ra25": 0.59, "alpha_Ra": 0.004, "Kt25": 0.071, "alpha_Kt": -0.002} | {
    "J": 0.01, "b": 0.1, "L": 0.5,
}  # fmt: skip


@pytest.fixture(scope="module")
def found() -> mi.Identification:
    """A servo identified from two DataFrames and one validation run, with a posterior."""
    frames = [run.table() for run in RUNS[:2]]
    return mi.identify(frames, RUNS[2], mi.FitOptions(effects=False, effort="quick"))


@pytest.fixture(scope="module")
def stored(found: mi.Identification, tmp_path_factory: pytest.TempPathFactory) -> mi.StoredResult:
    """The same result, written and read again."""
    directory = tmp_path_factory.mktemp("motor")
    found.write(directory)
    return mi.read_result(directory)


def channels(run: Run) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(n_sample, 5) all channels of a run with a temperature."""
    assert run.temperature is not None
    return np.column_stack([run.time, run.voltage, run.current, run.speed, run.temperature])


def test_table_of_a_run_reads_back_as_the_same_run() -> None:
    """Canonical columns are in SI units, so no value changes by a bit."""
    run = mi.read_run(RUNS[0].table(), name="cold")

    assert run.name == "cold"
    assert np.array_equal(channels(run), channels(RUNS[0]))


def test_units_in_names_in_a_second_level_and_in_a_mapping_are_the_same_run() -> None:
    """The factors of ms, mA and rpm; one run in three notations agrees to rounding."""
    run = RUNS[0]
    cells = [1e3 * run.time, run.voltage, 1e3 * run.current, run.speed * 30 / np.pi]
    data = np.column_stack([*cells, run.table()["temperature_degC"]])
    names = ["t", "u", "i", "n", "temperature"]
    units = ["ms", "V", "mA", "rpm", "degC"]
    mapping = {
        name: {"column": column, "unit": unit}
        for name, column, unit in zip(run.table().columns, names, units, strict=True)
    }
    frames = [
        (pd.DataFrame(data, columns=[f"{n} [{u}]" for n, u in zip(names, units, strict=True)]), {}),
        (pd.DataFrame(data, columns=pd.MultiIndex.from_arrays([names, units])), {}),
        (pd.DataFrame(data, columns=names), mapping),
    ]

    for frame, mapped in frames:
        read = channels(mi.read_run(frame, mapping=mapped))
        np.testing.assert_allclose(read, channels(run), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("origin", ["2026-01-01 12:00", None])
def test_dates_and_durations_are_seconds_since_the_first_sample(origin: str | None) -> None:
    """A time index of either kind gives the logged time to the nanosecond."""
    since = pd.to_timedelta(RUNS[0].time, unit="s")
    index = since if origin is None else pd.Timestamp(origin) + since
    frame = RUNS[0].table().drop(columns="time_s").set_index(index.rename("time"))

    np.testing.assert_allclose(mi.read_run(frame).time, RUNS[0].time, atol=1e-9)


def test_cell_that_is_no_number_is_refused_with_its_position() -> None:
    """Row 7 by position, as `iloc` counts."""
    frame = RUNS[0].table().astype(object)
    frame.loc[7, "current_A"] = "n/a?"

    with pytest.raises(mi.RunFileError, match=r"cold, row 7, column current_A: .*n/a\?") as error:
        mi.read_run(frame, name="cold")

    assert error.value.value == "n/a?"


def test_frames_with_the_same_values_have_the_same_identity() -> None:
    """Changing one value changes the hash; the name does not."""
    frame = RUNS[0].table()
    other = frame.assign(current_A=frame["current_A"] + 1e-9)

    same, again, changed = (mi.read_run(f).sha256 for f in (frame, frame.copy(), other))

    assert same == again != changed


def test_index_named_like_a_column_is_refused_with_the_remedy() -> None:
    """The library cannot know which of the two is meant."""
    frame = RUNS[0].table().set_index("time_s", drop=False)

    with pytest.raises(mi.RunFileError, match="reset_index"):
        mi.read_run(frame)


def test_check_accepts_frames_runs_and_paths(tmp_path: Path) -> None:
    """Three forms of the same three runs give the same expected precision."""
    paths = [tmp_path / f"{number}.csv" for number in range(3)]
    for run, path in zip(RUNS, paths, strict=True):
        mi.write_run(run, path)

    mixed = mi.check([RUNS[0], str(paths[1]), RUNS[2].table()])

    assert mixed.is_accepted
    pd.testing.assert_frame_equal(mixed.table(), mi.check(RUNS).table())
    assert [run.name for run in mixed.runs][1:] == ["1.csv", "run 3"]


def test_what_is_no_run_is_refused() -> None:
    """A number and a list with a number name the argument and the type."""
    with pytest.raises(mi.InputError, match="training has an object of type int"):
        mi.identify(3)  # type: ignore[arg-type]
    with pytest.raises(mi.InputError, match="runs has an object of type float"):
        mi.check([RUNS[0], 0.5])  # type: ignore[list-item]


def test_table_holds_the_numbers_of_the_result(found: mi.Identification) -> None:
    """Each cell is the member of result.json with the name of its row and column."""
    table = found.table()

    for name, entry in found.result["parameters"].items():
        assert dict(table.loc[name]) == {key: entry[key] for key in table.columns}
    errors = found.table("errors").set_index(["model", "role", "channel"])
    expected = found.result["errors"]["after"]["validation"]["speed"]["noise_ratio"]
    assert errors.loc[("after", "validation", "speed"), "noise_ratio"] == expected
    assert len(found.table("warnings")) == len(found.result["warnings"])


def test_unknown_table_is_refused_with_the_names(found: mi.Identification) -> None:
    """The message lists what exists."""
    with pytest.raises(mi.OptionError, match="parameters, declared, effects"):
        found.table("parameter")  # type: ignore[arg-type]


def test_stored_result_has_the_tables_and_draws_of_the_fresh_one(
    found: mi.Identification, stored: mi.StoredResult
) -> None:
    """JSON and netCDF keep every bit; the stored draws are an even selection of the chain."""
    for name in ("parameters", "errors", "feedback"):
        pd.testing.assert_frame_equal(stored.table(name), found.table(name))
    assert set(stored.draws()) == set(found.draws())
    assert np.isin(stored.draws()["J"], found.draws()["J"]).all()


def test_prediction_is_the_same_from_object_content_and_directory(
    found: mi.Identification, stored: mi.StoredResult
) -> None:
    """A row for each sample; the error on the validation run is that of the result."""
    tables = [
        mi.predict(source, RUNS[2].table())
        for source in (found, found.result, stored, stored.path.parent)
    ]

    for table in tables[1:]:
        pd.testing.assert_frame_equal(table, tables[0])
    assert list(tables[0]) == ["time_s", "current_A", "speed_rad_s"]
    rmse = np.sqrt(np.mean((tables[0]["speed_rad_s"] - RUNS[2].speed) ** 2))
    assert rmse == pytest.approx(
        found.result["errors"]["after"]["validation"]["speed"]["rmse"], rel=0.02
    )


def test_feedback_of_known_parameters_has_the_final_value_of_the_closed_form() -> None:
    """P control with gain 1: Kt / (Ra b + Kt^2 + Kt) at 25 degC."""
    table = mi.feedback(PAPER, temperatures=25, controllers="P:1")

    final = table.set_index("metric").loc["steady_state", "median"]
    assert final == pytest.approx(0.071 / (0.59 * 0.1 + 0.071**2 + 0.071))


def test_feedback_of_an_identification_uses_its_draws(found: mi.Identification) -> None:
    """The same numbers as the list of the result, which has the same loops."""
    table = mi.feedback(found)

    assert len(table) == len(found.table("feedback"))
    expected = feedback_metrics(found.draws(), [25.0, 125.0], ["P:1"])[1]["rise_time_s"]["sd"]
    row = table.query("metric == 'rise_time_s' and temperature_degC == 125").iloc[0]
    assert row["sd"] == expected


def test_feedback_of_something_else_says_what_it_takes(found: mi.Identification) -> None:
    """The content of result.json has medians without correlations; a number has nothing."""
    with pytest.raises(mi.InputError, match="has no draws"):
        mi.feedback(found.result)
    with pytest.raises(mi.InputError, match="motor is a float"):
        mi.feedback(0.5)  # type: ignore[arg-type]


def test_report_is_the_page_of_write(
    found: mi.Identification, stored: mi.StoredResult, tmp_path: Path
) -> None:
    """The same page except for its date and the running numbers of its figures."""
    path = mi.report(found, tmp_path / "new" / "page.html")

    pages = [path.read_text("utf-8"), stored.path.with_name("report.html").read_text("utf-8")]
    own, other = (re.sub(r"svg\d+|\d{4}-\d\d-\d\d \d\d:\d\d", "", page) for page in pages)
    assert own == other
    with pytest.raises(mi.InputError, match=r"report\.html in its directory"):
        mi.report(stored, path)  # type: ignore[arg-type]


def test_functions_keep_their_names_after_every_import(found: mi.Identification) -> None:
    """No module has the name of a public function and replaces it once it is imported."""
    from identification import feedback, report

    assert mi.feedback(PAPER, 25).equals(feedback(PAPER, 25))
    assert (mi.feedback.__name__, report.__name__) == ("feedback", "report")


def test_everything_is_displayed_and_escaped(
    found: mi.Identification, stored: mi.StoredResult
) -> None:
    """A name with markup stays text; each parameter has a row."""
    hostile = mi.read_run(RUNS[0].table(), name="<script>alert(1)</script>")
    shown = [thing._repr_html_() for thing in (hostile, mi.check([hostile]), found, stored)]

    assert all("<script>" not in html for html in shown)
    assert "&lt;script&gt;" in shown[0]
    assert all(f"<td>{name}</td>" in shown[2] for name in found.result["parameters"])
    assert shown[2] == shown[3]


def test_runs_and_preview_print_as_some_lines_without_samples() -> None:
    """A console shows name, size and channels of a run, and the table of the preview."""
    run = mi.read_run(RUNS[0].table(), name="cold")
    preview = mi.check([run])

    assert repr(run).startswith("Run('cold': 600 samples at ")
    assert "array" not in repr(run) + repr(preview)
    assert repr(preview).startswith("Runs accepted: cold\n")
    assert all(name in repr(preview) for name in PAPER)
    assert "- there is one run only" in repr(preview)


def test_posterior_opens_in_arviz(found: mi.Identification, stored: mi.StoredResult) -> None:
    """Draws and units of the file, from the object, the directory and the file."""
    pytest.importorskip("arviz", reason="ArviZ is not installed")
    with warnings.catch_warnings():
        # ArviZ 0.x announces version 1 and uses functions that its dependencies deprecate.
        warnings.simplefilter("ignore")
        directory = stored.path.parent
        data = [
            mi.inference_data(source)
            for source in (found, stored, str(directory), directory / "posterior.nc")
        ]

    chain = data[0]["posterior"]["Ra25"]
    assert chain.attrs["units"] == "ohm"
    assert np.isin(stored.draws()["Ra25"], chain.values).all()
    for other in data[1:]:
        assert np.array_equal(other["posterior"]["Ra25"], chain)
        assert np.array_equal(other["sample_stats"]["lp"], data[0]["sample_stats"]["lp"])


def test_version_1_of_arviz_gets_a_tree(
    stored: mi.StoredResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """ArviZ 1.x has no InferenceData; its functions take the DataTree of xarray."""
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    monkeypatch.setitem(sys.modules, "arviz", type(sys)("arviz"))

    tree = mi.inference_data(stored)

    assert isinstance(tree, xarray.DataTree)
    assert tree["posterior"]["J"].attrs["units"] == "kg m^2"


def test_missing_arviz_is_named_with_its_remedy(
    stored: mi.StoredResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`None` in sys.modules makes Python refuse the import."""
    monkeypatch.setitem(sys.modules, "arviz", None)

    with pytest.raises(mi.MissingPackage, match="pip install arviz"):
        mi.inference_data(stored)


def test_result_without_a_chain_says_how_to_get_one(tmp_path: Path) -> None:
    """Intervals from the covariance have no chain, in memory and on disk."""
    pytest.importorskip("xarray", reason="xarray is not installed")
    options = mi.FitOptions(effects=False, posterior=False, effort="quick")
    found = mi.identify(RUNS[:2], options=options)
    found.write(tmp_path)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(mi.InputError, match="posterior=True"):
            mi.inference_data(found)
        with pytest.raises(mi.InputError, match="--no-posterior"):
            mi.inference_data(tmp_path)
    assert mi.read_result(tmp_path).draws()["Ra25"].size == 2000


def test_import_loads_no_numerical_package() -> None:
    """A script that only prints its help must not wait for numpy, pandas or CasADi."""
    program = (
        "import sys, identification\n"
        "print(*[n for n in ('numpy', 'pandas', 'casadi', 'scipy', 'arviz') if n in sys.modules])"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()

    assert loaded == []
