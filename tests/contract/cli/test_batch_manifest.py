"""Errors in manifests of motorid batch."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.cli import main


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("m.csv", "motor,training,sed\n", "row 1: has the header 'motor,training,sed'"),
        ("m.csv", "motor,training\nm,a.csv,b.csv\n", "row 2: has 3 cells; expected at most 2"),
        ("m.csv", "motor,training\nm,;\n", "row 2, column training: has no training run"),
        ("m.csv", "motor,training\nm,m.csv m.csv\n", "'m.csv m.csv' is no file; expected semic"),
        ("m.csv", "motor,training,seed\nm,a.csv,x\n", "row 2, column seed: 'x' is not valid"),
        ("m.csv", "motor,training,seed\nm,a.csv,-1\n", "row 2: seed is -1"),
        ("m.csv", "motor,training,seed\nm,a.csv,1_0\n", "column seed: '1_0' is not valid"),
        ("m.csv", "motor,training,seed\nm,a.csv,\u0661\n", "'\u0661' is not valid"),
        ("m.csv", "motor,training,temperatures\nm,a,25;1_0\n", "'25;1_0' is not valid"),
        ("m.csv", "motor,training,controllers\nm,a,P:1_0\n", "the gain '1_0', which is not"),
        ("m.csv", "motor,training,controllers\nm,a.csv,Q:1\n", "row 2: "),
        ("m.csv", "motor,training,known\nm,a.csv,Kt=1\n", "row 2: known 'Kt=1': there is no"),
        ("m.csv", "motor,training,nameplate\nm,a,volts=1\n", "row 2: nameplate 'volts=1': exp"),
        ("m.yaml", "motors: []\noptions: {known: L=1e-3}\n", "'L=1e-3' is not valid; expected kn"),
        ("m.yaml", "motors: []\noptions: {nameplate: 12}\n", "'12' is not valid; expected namepl"),
        (
            "m.yaml",
            "motors: [{motor: m, trainings: [a]}]\n",
            "motor 1 of the list: has 'trainings'",
        ),
        ("m.yaml", "motors: [{motor: m, training: 7}]\n", "column training: motor 1 of the list"),
        ("m.yaml", "motors: [{motor: ../m, training: a}]\n", "'../m' is not a valid motor name"),
        ("m.yaml", "motors: [{motor: m, training: a, options: {sed: 1}}]\n", "motor m: has the"),
        (
            "m.yaml",
            "motors: [{motor: m, training: a, options: {seed: 1.5}}]\n",
            "'1.5' is not valid",
        ),
        ("m.yaml", "options: {hold: often}\nmotors: []\n", "column hold: 'often'"),
        ("m.yaml", "motors: [\n  {motor: m\n", "row 3: is not YAML"),
        ("m.yaml", "- a\n", "has no list `motors`"),
        ("m.yaml", "motors: []\n", "lists no motor"),
        ("m.yaml", "motors: !!python/object/apply:os.system [true]\n", "is not YAML"),
        ("m.yaml", "a: &a [x]\nmotors: [*a, *a]\n", "has an alias"),
        (
            "m.yaml",
            "motors:\n- motor: m\n  training: a\n  motor: n\n",
            "row 4: is not YAML (has the key 'motor' twice",
        ),
        (
            "m.yaml",
            "motors: []\noptions: {}\nmotors: [x]\n",
            "row 3: is not YAML (has the key 'motors' twice",
        ),
        ("m.yaml", "motors: [{motor: m, training: a, options: {seed: 1" + ":1" * 100_000, "10000"),
        ("m.csv", "motor,training" + ",x" * 100_000, "expected the columns"),
        ("m.yaml", "motors: " + "[" * 20_000, "is not YAML"),
        ("m.yaml", "motors: [{motor: m, training: a, mapping: 2001-99-99}]\n", "is not YAML"),
        ("m.yaml", "motors: [!!timestamp abc]\n", "is not YAML"),
        ("m.yaml", 'motors: [{motor: m, training: "a\\0b"}]\n', "is not a valid path"),
        ("m.yaml", 'motors: [{motor: m, training: ["\\ud800.csv"]}]\n', "is not a valid path"),
        (
            "m.yaml",
            "motors: [{motor: m, training: a, options: {temperatures: [1" + "0" * 400 + "]}}]\n",
            "is not valid",
        ),
        ("m.yaml", "motors: [{motor: m, training: a, type: [x]}]\n", "not a valid motor type"),
        (
            "m.csv",
            "motor,training\nresults.csv,a.csv\n",
            "is the name of an output file of the batch",
        ),
    ],
)
def test_error_in_a_manifest_names_its_location(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, told: str
) -> None:
    """The command exits with status 2 and one line before it fits or writes anything."""
    (tmp_path / name).write_text(text)

    assert main(["batch", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2

    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
