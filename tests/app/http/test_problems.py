"""Mapping from error classes to HTTP statuses."""

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
    """Error of a class."""
    if kind is errors.FieldRefused:
        return errors.FieldRefused("text", "field")
    if kind is errors.RunRefused:
        return errors.RunRefused("text", reason="no_table", file="a.csv", row=3, column="x")
    if kind is errors.TooManyUploads:
        return errors.TooManyUploads("text", retry_after_s=2.0)
    return kind("text")


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_every_service_error_has_a_status_and_a_code(
    kind: type[errors.ServiceError],
) -> None:
    """Each leaf class has a status of at least 400 and a unique code."""
    answer = problem_of(made(kind))

    body = json.loads(bytes(answer.body))
    assert 400 <= answer.status_code < 600
    assert body["status"] == answer.status_code
    assert answer.media_type == MEDIA_TYPE
    assert body["code"] in (kind.code, "no_table")
    assert sum(other.code == kind.code for other in CLASSES) == 1


def test_documented_error_tree_is_complete() -> None:
    """The drawing in the module docstring names each class."""
    drawing = inspect.getdoc(errors)

    assert drawing is not None
    for name in errors.__all__:
        assert name in drawing, name


def test_every_error_of_a_run_file_is_unprocessable() -> None:
    """Every subclass of InputError is a fault of the request and maps to 422."""
    leaves = [
        kind
        for _, kind in inspect.getmembers(library, inspect.isclass)
        if issubclass(kind, InputError)
    ]

    assert len(leaves) > 20
    for kind in leaves:
        assert problem_of(kind("text")).status_code == 422, kind


def test_problem_gives_the_source_location() -> None:
    """File, row and column are members and part of the detail."""
    error = NotANumber("'x' is not a number", file="a.csv", row=7, column="current_A")

    body = json.loads(bytes(problem_of(error).body))

    assert (body["file"], body["row"], body["column"]) == ("a.csv", 7, "current_A")
    assert body["code"] == "not_a_number"
    assert body["detail"] == "a.csv, row 7, column current_A: 'x' is not a number"


def test_problem_without_a_location_omits_its_members() -> None:
    """RFC 9457: members that do not apply are omitted."""
    body = json.loads(bytes(problem_of(OptionError("hold is 'x'")).body))

    assert {"file", "row", "column", "errors"} & body.keys() == set()


def test_challenge_and_retry_time_are_headers() -> None:
    """RFC 9110: 401 carries WWW-Authenticate, 503 may carry Retry-After."""
    assert "www-authenticate" in problem_of(errors.BadKey("no key")).headers
    assert "retry-after" in problem_of(errors.Unavailable("later")).headers


def test_table_lists_no_class_that_its_parent_covers() -> None:
    """A class with the status of its base class needs no entry."""
    for kind, status in STATUS.items():
        parents = [STATUS[parent] for parent in kind.__mro__[1:] if parent in STATUS]
        assert not parents or parents[0] != status, kind
