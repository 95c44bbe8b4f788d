"""Choice of the runs of a fit on the start page: roles, motor names, prospects, start."""

from __future__ import annotations

import re
import secrets
import urllib.parse
from collections.abc import Iterator

import httpx
import pytest

from tests.app.service import API, Server, make_key, run_text

FILES = ("a.csv", "b.csv", "val_c.csv", "d.csv")


@pytest.fixture
def http(server: Server) -> Iterator[httpx.Client]:
    """Browser of a workspace with four runs of one motor."""
    key = make_key(server.data_dir, f"choice-{secrets.token_hex(8)}")
    headers = {"Authorization": f"Bearer {key}", "HX-Request": "true"}
    with httpx.Client(base_url=server.url, headers=headers, timeout=60) as client:
        for seed, name in enumerate(FILES, 100):
            files, data = {"file": (name, run_text(seed))}, {"motor": "servo 1"}
            assert client.post(f"{API}/runs", files=files, data=data).status_code == 201
        yield client


def ids(http: httpx.Client) -> dict[str, str]:
    """ID of each run by file name."""
    return {run["file"]: run["id"] for run in http.get(f"{API}/runs").json()["items"]}


def shown(text: str) -> dict[str, str]:
    """Role of each run as the page shows it, by ID."""
    menus = re.findall(r'name="role\.(\w+)".*?</select>', text, re.DOTALL)
    found = re.findall(r'name="role\.(\w+)"(.*?)</select>', text, re.DOTALL)
    assert len(menus) == len(found)
    return {
        run: "".join(re.findall(r"<option selected>(\w+)</option>", options))
        for run, options in found
    }


def test_findings_on_a_file_are_notes_in_both_tables(http: httpx.Client) -> None:
    """A run without a temperature has one, before and after it is added."""
    rows = (line.rpartition(b",")[0] for line in run_text(7).splitlines())
    files = {"file": ("cold.csv", b"\n".join(rows))}
    assert http.post("/pending", files=files).status_code == 200
    before = http.get("/").text
    assert http.post("/pending/confirm").status_code == 303
    after = http.get("/").text

    assert [len(re.findall(r"1\s+note", text)) for text in (before, after)] == [1, 1]
    assert not re.search(r"1\s+warning", before + after)


def test_roles_are_proposed_then_chosen_and_kept(http: httpx.Client) -> None:
    """The file named val validates until the user chooses; a reload shows the choice."""
    run = ids(http)
    proposed = shown(http.get("/").text)
    chosen = {f"role.{each}": "training" for each in run.values()} | {f"role.{run['a.csv']}": ""}
    http.post("/choice", data=chosen)
    again = shown(http.get("/").text)

    assert proposed == {
        run["a.csv"]: "training", run["b.csv"]: "training", run["d.csv"]: "training",
        run["val_c.csv"]: "validation",
    }  # fmt: skip
    assert again == {each: "training" for each in run.values()} | {run["a.csv"]: ""}


def test_role_of_one_run_leaves_the_proposal_of_the_others(http: httpx.Client) -> None:
    """The request has the role of one run only, and the table shows all others as before."""
    run = ids(http)
    proposed = shown(http.get("/").text)
    answer = http.post("/choice?motor=servo+1", data={f"role.{run['a.csv']}": ""})

    assert shown(answer.text) == proposed | {run["a.csv"]: ""}


@pytest.mark.parametrize(
    ("gesture", "pattern", "validating"),
    [
        ("all", "", []),
        ("pattern", "b", ["b.csv"]),
        ("pattern", "?.csv", ["a.csv", "b.csv", "d.csv"]),
        ("pattern", "VAL", ["val_c.csv"]),
        ("proposal", "", ["val_c.csv"]),
    ],
)
def test_one_gesture_chooses_all_roles(
    http: httpx.Client, gesture: str, pattern: str, validating: list[str]
) -> None:
    """A pattern without wildcards is a part of the file name; case does not matter."""
    run = ids(http)
    form = {f"role.{each}": "" for each in run.values()}
    answer = http.post("/choice", data=form | {"gesture": gesture, "pattern": pattern})

    expected = dict.fromkeys(run.values(), "training")
    assert shown(answer.text) == expected | {run[file]: "validation" for file in validating}


def test_none_and_an_empty_pattern(http: httpx.Client) -> None:
    """An empty pattern would match every file, so it is refused and changes nothing."""
    form = {f"role.{each}": "training" for each in ids(http).values()}
    refused = http.post("/choice", data=form | {"gesture": "pattern", "pattern": " "})
    none = http.post("/choice", data=form | {"gesture": "none"})

    assert refused.status_code == 422
    assert "expected a part of a file name" in refused.text
    assert set(shown(none.text).values()) == {""}


def test_prospects_of_the_chosen_runs(http: httpx.Client) -> None:
    """Two training runs of one temperature do not determine the temperature coefficients."""
    run = ids(http)
    form = {f"role.{run['a.csv']}": "training", f"role.{run['b.csv']}": "training"}

    found = http.post("/prospects", data=form)
    nothing = http.post("/prospects", data={f"role.{run['a.csv']}": ""})

    assert found.status_code == 200
    assert "What these runs can identify" in found.text
    assert "Choose at least one training run" in nothing.text


def test_motor_is_named_after_the_upload(http: httpx.Client) -> None:
    """The list of another motor does not contain the run any more."""
    run = ids(http)

    # The browser sends the names of all runs of the form, the last of which is that of a.csv.
    names = re.findall(r'name="(motor\.\w+|name)"', http.get("/").text)
    typed = [("servo 2" if run["d.csv"] in name else "servo 1") for name in names]
    body = urllib.parse.urlencode(list(zip(names, typed, strict=True)))
    http.post(
        f"/runs/{run['d.csv']}/motor", content=body,
        headers={"Content-Type": "application/x-www-form-urlencoded"},
    )  # fmt: skip

    assert len(names) == len(FILES)
    assert set(shown(http.get("/", params={"motor": "servo 2"}).text)) == {run["d.csv"]}
    assert run["d.csv"] not in shown(http.get("/", params={"motor": "servo 1"}).text)


def test_form_starts_the_fit_of_the_roles(http: httpx.Client) -> None:
    """Runs are in the order of upload, and the browser is sent to the page of the fit."""
    run = ids(http)
    form = {
        f"role.{run['d.csv']}": "training", f"role.{run['val_c.csv']}": "validation",
        f"role.{run['b.csv']}": "", f"role.{run['a.csv']}": "training",
        "temperatures": "25", "controllers": "P:1", "seed": "7",
    }  # fmt: skip

    answer = http.post("/fits", data=form)

    assert answer.status_code == 204
    fit = http.get(f"{API}{answer.headers['HX-Redirect']}").json()
    assert fit["training"] == [run["a.csv"], run["d.csv"]]
    assert fit["validation"] == [run["val_c.csv"]]
    assert (fit["motor"], fit["options"]["seed"]) == ("servo 1", 7)
    assert fit["options"]["posterior"] is False


@pytest.mark.parametrize(
    ("field", "text", "words"),
    [
        ("controllers", "", "Controllers: List should have at least 1 item"),
        ("temperatures", "warm", "&#39;warm&#39; is not a number"),
    ],
)
def test_fault_of_an_option_is_a_sentence(
    http: httpx.Client, field: str, text: str, words: str
) -> None:
    """The page shows it below the form, whose fields stay as they are."""
    form = {f"role.{ids(http)['a.csv']}": "training", "temperatures": "25", "controllers": "P:1"}

    answer = http.post("/fits", data=form | {field: text})

    assert answer.status_code == 422
    assert words in answer.text
    assert answer.text.startswith("<p ")
