"""The table from errors to statuses."""

from __future__ import annotations

import inspect
import json

import pytest

from app import errors
from app.http.problems import MEDIA_TYPE, STATUS, problem_of
from identification import errors as library
from identification.errors import InputError, NotANumber, OptionError

CLASSES = [
    kind
    for _, kind in inspect.getmembers(errors, inspect.isclass)
    if issubclass(kind, errors.ServiceError) and not kind.__subclasses__()
]


def made(kind: type[errors.ServiceError]) -> errors.ServiceError:
    """An error of a class."""
    if kind is errors.FieldRefused:
        return errors.FieldRefused("text", "field")
    if kind is errors.RunRefused:
        return errors.RunRefused("text", reason="no_table", file="a.csv", row=3, column="x")
    if kind is errors.TooManyUploads:
        return errors.TooManyUploads("text", retry_after_s=2.0)
    return kind("text")


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_every_error_of_the_service_has_a_status_and_a_word(
    kind: type[errors.ServiceError],
) -> None:
    """Each leaf of the tree reaches a status from 400 on, with a code of its own."""
    answer = problem_of(made(kind))

    body = json.loads(bytes(answer.body))
    assert 400 <= answer.status_code < 600
    assert body["status"] == answer.status_code
    assert answer.media_type == MEDIA_TYPE
    assert body["code"] in (kind.code, "no_table")
    assert sum(other.code == kind.code for other in CLASSES) == 1


def test_tree_in_the_text_is_the_tree_in_the_code() -> None:
    """Each class stands in the drawing at the top of its file."""
    drawing = inspect.getdoc(errors)

    assert drawing is not None
    for name in errors.__all__:
        assert name in drawing, name


def test_every_error_of_a_run_file_is_unprocessable() -> None:
    """The library knows no statuses; all leaves below InputError are the caller's fault."""
    leaves = [
        kind
        for _, kind in inspect.getmembers(library, inspect.isclass)
        if issubclass(kind, InputError)
    ]

    assert len(leaves) > 20
    for kind in leaves:
        assert problem_of(kind("text")).status_code == 422, kind


def test_problem_says_where_the_fault_is() -> None:
    """File, row and column as fields, and in the words."""
    error = NotANumber("'x' is not a number", file="a.csv", row=7, column="current_A")

    body = json.loads(bytes(problem_of(error).body))

    assert (body["file"], body["row"], body["column"]) == ("a.csv", 7, "current_A")
    assert body["code"] == "not_a_number"
    assert body["detail"] == "a.csv, row 7, column current_A: 'x' is not a number"


def test_problem_without_a_place_has_no_empty_fields() -> None:
    """RFC 9457: members that do not apply are left out."""
    body = json.loads(bytes(problem_of(OptionError("hold is 'x'")).body))

    assert {"file", "row", "column", "errors"} & body.keys() == set()


def test_challenge_and_time_to_wait_are_said() -> None:
    """RFC 9110: 401 carries WWW-Authenticate, 503 may carry Retry-After."""
    assert "www-authenticate" in problem_of(errors.BadKey("no key")).headers
    assert "retry-after" in problem_of(errors.Unavailable("later")).headers


def test_table_lists_no_class_that_its_parent_covers() -> None:
    """An entry equal to that of the nearest parent would only be noise."""
    for kind, status in STATUS.items():
        parents = [STATUS[parent] for parent in kind.__mro__[1:] if parent in STATUS]
        assert not parents or parents[0] != status, kind
