"""Machine code from the disk cache is the compiled one, or it is compiled again."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.model import machine
from identification.model.scan import Scan

Array = NDArray[np.float64]

KEY = "a" * 64


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Cache folder of the test, detected again before and after it."""
    monkeypatch.setenv("MOTORID_CACHE", str(tmp_path))
    machine._folder.cache_clear()
    found = machine._folder()
    assert found is not None
    assert found.is_relative_to(tmp_path)
    yield found
    machine._folder.cache_clear()


def braking() -> ca.Function:
    """Step of a decaying speed with an exponential of the vector library."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 1)
    following = x + ca.vertcat(u * p, ca.exp(-x[0]) * ca.log(2.0 + u**2))
    return ca.Function("braking", [x, u, p], [following, x])


def ends(loop: Scan) -> Array:
    """Final carry after five steps from rest, for three lanes."""
    parameters = np.array([[0.5, 1.0, 2.0]])
    return loop([np.linspace(0.0, 1.0, 5)[:, None]], parameters, [np.zeros((2, 3))])[0][0]


def forbid(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make any compilation raise from here on."""

    def compiled(*arguments: object) -> object:
        raise AssertionError("compiled, although it was kept")

    monkeypatch.setattr(machine, "_compile", compiled)


def test_a_cached_loop_gives_the_same_bits(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Equal machine code gives equal bits."""
    expected = ends(Scan(braking(), key=KEY))
    forbid(monkeypatch)

    assert np.array_equal(ends(Scan(braking(), key=KEY)), expected)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_a_truncated_or_corrupt_file_is_never_run(data: st.DataObject) -> None:
    """A file with one changed byte, or truncated, counts as a cache miss."""
    found = machine._folder()
    if found is None:
        pytest.skip("this machine keeps nothing")
    machine.keep(KEY, bytes(range(200)))
    path = found / KEY
    content = path.read_bytes()
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        place = data.draw(st.integers(0, len(content) - 1))
        changed = bytes([content[place] ^ data.draw(st.integers(1, 255))])
        content = content[:place] + changed + content[place + 1 :]
    path.write_bytes(content)

    assert machine.kept(KEY) is None
    path.unlink()


def test_a_folder_that_others_can_write_is_not_used(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Code in a writable folder is not trusted; the loop is compiled instead."""
    expected = ends(Scan(braking(), key=KEY))
    folder.chmod(0o777)
    machine._folder.cache_clear()

    assert machine.kept(KEY) is None
    assert np.array_equal(ends(Scan(braking(), key=KEY)), expected)


@pytest.mark.parametrize("chosen", ["", "/proc/nowhere"])
def test_without_a_cache_folder_loops_are_compiled(
    chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is disabled or cannot be created; the result is computed by hand."""
    monkeypatch.setenv("MOTORID_CACHE", chosen)
    machine._folder.cache_clear()

    try:
        found = ends(Scan(braking(), key=KEY))
    finally:
        machine._folder.cache_clear()

    np.testing.assert_allclose(found[0], 2.5 * np.array([0.5, 1.0, 2.0]))


def test_a_full_cache_removes_its_least_recently_used_half(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of six files with a limit of five, three remain: the two newest and the one just read."""
    for number in range(6):
        machine.keep(f"{number}", b"code")
        os.utime(folder / f"{number}", (1000.0 + number, 1000.0 + number))
    assert machine.kept("0") == b"code"
    monkeypatch.setattr(machine, "_MOST", 5)
    machine._folder.cache_clear()

    assert machine._folder() == folder
    assert sorted(path.name for path in folder.iterdir()) == ["0", "4", "5"]
