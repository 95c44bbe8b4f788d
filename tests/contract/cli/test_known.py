"""Known values and the nameplate: same syntax on the command line, by HTTP and in a manifest."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.cli import main
from app.commands.batch.manifest import read_manifest
from app.commands.batch.record import record_of
from app.commands.motor import fit_options
from app.fits.job import options_of
from app.fits.schemas import FitCreate
from identification.errors import InputError, OptionError
from identification.options import FitOptions

FAST = ["--no-posterior", "--no-effects", "--quiet"]
KNOWN = ("Kt25=0.07+-5%", "L=2e-3")
PLATE = "voltage=24,no_load_speed=3249rpm,no_load_current=0.3,stall_current=40"


def by_http(known: tuple[str, ...], nameplate: str) -> FitOptions:
    """Options as the service sees them after validation of a request."""
    body = {"training": ["run_x"], "options": {"known": list(known), "nameplate": nameplate}}
    return options_of(FitCreate.model_validate(body).options.content())


def by_manifest(path: Path, text: str) -> FitOptions:
    """Options of the only motor of a manifest."""
    path.write_text(text)
    (motor,) = read_manifest(path, FitOptions())
    return motor.options


def everywhere(directory: Path, known: tuple[str, ...], nameplate: str) -> list[Any]:
    """Options, or the error message, of each interface."""
    (directory / "run.csv").touch()
    options = {"known": list(known), "nameplate": nameplate}
    entry = json.dumps({"motor": "m", "training": ["run.csv"], "options": options})
    table = f'motor,training,known,nameplate\nm,run.csv,{";".join(known)},"{nameplate}"\n'
    ways: tuple[Callable[[], FitOptions], ...] = (
        lambda: fit_options({"known": known, "nameplate": [nameplate]}),
        lambda: by_http(known, nameplate),
        lambda: by_manifest(directory / "m.csv", table),
        lambda: by_manifest(directory / "m.yaml", f"motors: [{entry}]\n"),
    )
    answers: list[Any] = []
    for way in ways:
        try:
            answers.append(way())
        except InputError as error:
            answers.append(error.message)
    return answers


def test_all_interfaces_give_the_same_options(tmp_path: Path) -> None:
    """Command line, HTTP, CSV and YAML parse the same texts to equal options."""
    answers = everywhere(tmp_path, KNOWN, PLATE)

    assert answers == [FitOptions(known=KNOWN, nameplate=PLATE)] * 4
    assert [p.origin for p in answers[0].priors] == ["--known", "--known", "--nameplate"]


@pytest.mark.parametrize(
    ("known", "nameplate"),
    [
        (("Kt=0.07",), ""),
        (("Kt25=fast",), ""),
        (("Kt25=0.07+--5%",), ""),
        (("Kt25=0.07", "Kt25=0.08"), ""),
        ((), "voltage=12"),
        ((), "voltage=12,volts=12"),
        ((), "voltage=12A,stall_current=1"),
    ],
)
def test_all_interfaces_reject_with_the_same_message(
    tmp_path: Path, known: tuple[str, ...], nameplate: str
) -> None:
    """All use one parser; a manifest prepends the location of the error."""
    with pytest.raises(OptionError) as caught:
        FitOptions(known=known, nameplate=nameplate)

    for answer in everywhere(tmp_path, known, nameplate):
        assert answer.endswith(caught.value.message)


def test_command_line_values_reach_the_result(run_files: list[Path], tmp_path: Path) -> None:
    """The option takes several values and may be repeated."""
    words = ["--known", *KNOWN, "--known", "J=1e-4+-10%", "--nameplate", "voltage=24"]
    words += ["stall_current=40"]

    assert main(["fit", *map(str, run_files[:2]), *words, "--out", str(tmp_path), *FAST]) == 0

    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["options"]["known"] == [*KNOWN, "J=1e-4+-10%"]
    assert result["options"]["nameplate"] == "voltage=24,stall_current=40"
    origins = {n: e["prior"]["origin"] for n, e in result["parameters"].items() if "prior" in e}
    assert origins == {"Ra25": "--nameplate", "Kt25": "--known", "J": "--known", "L": "--known"}


def test_invalid_value_is_one_line_and_exit_status_2(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line names the value and the expected ones; nothing is written."""
    out = tmp_path / "out"

    assert main(["fit", str(run_files[0]), "--known", "Kt=1", "--out", str(out), *FAST]) == 2

    assert capsys.readouterr().err == (
        "motorid: known 'Kt=1': there is no parameter 'Kt'; expected one of Ra25, alpha_Ra, Kt25, "
        "alpha_Kt, J, b, L\n"
    )
    assert not out.exists()


def test_report_marks_an_estimate_that_rests_on_a_known_value(
    run_files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run at one temperature does not determine alpha_Ra, which is given."""
    text = run_files[0].read_text(encoding="utf-8").splitlines()
    place = text[0].split(",").index("temperature_degC")
    rows = [line.split(",") for line in text[1:]]
    for row in rows:
        row[place] = "25"
    run = tmp_path / "cold.csv"
    run.write_text("\n".join([text[0], *(",".join(row) for row in rows)]) + "\n")
    out = tmp_path / "out"

    words = ["--known", "alpha_Ra=0.0039+-5%", "--no-posterior", "--no-effects"]
    assert main(["fit", str(run), *words, "--out", str(out)]) == 0

    report = (out / "report.html").read_text(encoding="utf-8")
    assert "from --known (known values), not from the runs" in report
    assert (
        "The runs do not determine alpha_Ra; the value comes only from the given knowledge"
        in report
    )
    assert not re.search(r"The runs determine all \d+ parameters", report)
    assert "--known" in capsys.readouterr().out


def test_bench_of_a_manifest_is_part_of_the_record_only_if_given(tmp_path: Path) -> None:
    """CSV and YAML name it alike; without it, a result from before it existed is kept."""
    (tmp_path / "run.csv").touch()
    (tmp_path / "m.csv").write_text("motor,training,bench\na,run.csv,\nb,run.csv,bench 4\n")
    (tmp_path / "m.yaml").write_text(
        "motors: [{motor: a, training: run.csv}, {motor: b, training: run.csv, bench: bench 4}]"
    )
    plain, named = (
        [record_of(m) for m in read_manifest(tmp_path / name, FitOptions())]
        for name in ("m.csv", "m.yaml")
    )

    assert plain == named
    assert plain[1] == plain[0] | {"bench": "bench 4"}


def test_name_of_a_bench_is_checked(tmp_path: Path) -> None:
    """A name with a control character is refused with its place."""
    (tmp_path / "m.csv").write_text("motor,training,bench\na,run.csv,\x07\n")

    with pytest.raises(InputError, match=r"bench is '\\x07'; expected at most 200 printable") as at:
        read_manifest(tmp_path / "m.csv", FitOptions())

    assert (at.value.row, at.value.column) == (2, "bench")


def test_record_without_known_values_is_unchanged(tmp_path: Path) -> None:
    """A result from before these options existed stays up to date and is not fitted again."""
    (tmp_path / "run.csv").touch()
    (tmp_path / "m.csv").write_text("motor,training,known\na,run.csv,\nb,run.csv,L=1e-3\n")
    plain, known = (
        record_of(m)["options"] for m in read_manifest(tmp_path / "m.csv", FitOptions())
    )

    assert not {"known", "nameplate"} & plain.keys()
    assert known == plain | {"known": ["L=1e-3"]}
