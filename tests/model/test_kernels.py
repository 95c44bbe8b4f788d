"""Machine code that is kept on disk is that which was compiled, or it is compiled anew."""

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

from identification.model import kernels, scan
from identification.model.scan import Scan

Array = NDArray[np.float64]

KEY = "a" * 64


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of its own, found anew before and after."""
    monkeypatch.setenv("MOTORID_CACHE", str(tmp_path))
    kernels._folder.cache_clear()
    found = kernels._folder()
    assert found is not None
    assert found.is_relative_to(tmp_path)
    yield found
    kernels._folder.cache_clear()


def braking() -> ca.Function:
    """A speed that decays, with an exponential from the library of vector functions."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 1)
    following = x + ca.vertcat(u * p, ca.exp(-x[0]) * ca.log(2.0 + u**2))
    return ca.Function("braking", [x, u, p], [following, x])


def ends(loop: Scan) -> Array:
    """Where five steps lead from rest, three lanes at a time."""
    parameters = np.array([[0.5, 1.0, 2.0]])
    return loop([np.linspace(0.0, 1.0, 5)[:, None]], parameters, [np.zeros((2, 3))])[0][0]


def forbid(monkeypatch: pytest.MonkeyPatch) -> None:
    """No loop may be compiled from here on."""

    def compiled(*arguments: object) -> object:
        raise AssertionError("compiled, although it was kept")

    monkeypatch.setattr(scan, "_compile", compiled)


def test_a_kept_loop_computes_what_the_compiled_one_did(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same machine code gives the same bits."""
    expected = ends(Scan(braking(), key=KEY))
    forbid(monkeypatch)

    assert np.array_equal(ends(Scan(braking(), key=KEY)), expected)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_a_file_cut_short_or_garbled_is_never_run(data: st.DataObject) -> None:
    """Any one byte changed, or any length but the whole, is as if nothing had been kept."""
    found = kernels._folder()
    if found is None:
        pytest.skip("this machine keeps nothing")
    kernels.keep(KEY, bytes(range(200)))
    path = found / KEY
    content = path.read_bytes()
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        place = data.draw(st.integers(0, len(content) - 1))
        changed = bytes([content[place] ^ data.draw(st.integers(1, 255))])
        content = content[:place] + changed + content[place + 1 :]
    path.write_bytes(content)

    assert kernels.kept(KEY) is None
    path.unlink()


def test_a_folder_that_others_can_write_is_not_used(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Code from there could be anybody's; the loop is compiled and computes as ever."""
    expected = ends(Scan(braking(), key=KEY))
    folder.chmod(0o777)
    kernels._folder.cache_clear()

    assert kernels.kept(KEY) is None
    assert np.array_equal(ends(Scan(braking(), key=KEY)), expected)


@pytest.mark.parametrize("chosen", ["", "/proc/nowhere"])
def test_where_nothing_can_be_kept_loops_are_compiled(
    chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty name, and one below which no folder can be made; three steps add up by hand."""
    monkeypatch.setenv("MOTORID_CACHE", chosen)
    kernels._folder.cache_clear()

    try:
        found = ends(Scan(braking(), key=KEY))
    finally:
        kernels._folder.cache_clear()

    np.testing.assert_allclose(found[0], 2.5 * np.array([0.5, 1.0, 2.0]))


def test_the_half_used_longest_ago_is_removed_where_there_are_too_many(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of six files where five are the most, the three oldest go; one that was read is young."""
    for number in range(6):
        kernels.keep(f"{number}", b"code")
        os.utime(folder / f"{number}", (1000.0 + number, 1000.0 + number))
    assert kernels.kept("0") == b"code"
    monkeypatch.setattr(kernels, "_MOST", 5)
    kernels._folder.cache_clear()

    assert kernels._folder() == folder
    assert sorted(path.name for path in folder.iterdir()) == ["0", "4", "5"]
