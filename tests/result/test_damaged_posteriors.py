"""Files posterior.nc that are damaged, edited or of another fit: refused in one message."""

from __future__ import annotations

import functools
import io
import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.errors import InputError
from identification.identified import read_result
from identification.quantities import DECLARED_PARAMETERS
from identification.result.draws import chain_draws, write_posterior

UNITS = ("ohm", "1/K", "N m/A", "1/K", "kg m^2", "N m s/rad", "H")
CHAIN = 2.0 + 0.02 * np.random.default_rng(3).standard_normal((50, 8, 7))
MEDIANS = dict(zip(DECLARED_PARAMETERS, np.median(CHAIN, axis=(0, 1)).tolist(), strict=True))


@functools.cache
def posterior() -> bytes:
    """Posterior of eight walkers, whose parameters are all 2 to 1 %."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "posterior.nc"
        write_posterior(
            path,
            tuple(DECLARED_PARAMETERS),
            UNITS,
            CHAIN,
            CHAIN[:, :, 0],
            acceptance=0.4,
            attributes={},
        )
        return path.read_bytes()


def stored(folder: Path, content: bytes, **changes: float) -> Path:
    """Directory of a result with these medians and this posterior."""
    medians = MEDIANS | changes
    parameters = {name: {"median": value, "sd": 0.02} for name, value in medians.items()}
    text = json.dumps({"schema_version": 1, "parameters": parameters})
    (folder / "result.json").write_text(text)
    (folder / "posterior.nc").write_bytes(content)
    return folder


def replaced(values: object) -> Callable[[h5py.Group], None]:
    """Edit that replaces the draws of Kt25."""

    def edit(group: h5py.Group) -> None:
        old = group["Kt25"]
        scales = [old.dims[k][0] for k in range(2)]
        new = np.broadcast_to(np.asarray(values), old.shape)
        del group["Kt25"]
        group["Kt25"] = new
        for k, scale in enumerate(scales):
            group["Kt25"].dims[k].attach_scale(scale)

    return edit


def removed(group: h5py.Group) -> None:
    """Edit that removes the draws of Kt25."""
    del group["Kt25"]


def other_shape(group: h5py.Group) -> None:
    """Edit after which Kt25 has one draw for each walker."""
    scale = group["Kt25"].dims[0][0]
    del group["Kt25"]
    group["Kt25"] = np.full(8, 2.0)
    group["Kt25"].dims[0].attach_scale(scale)


def test_posterior_of_the_fit_is_drawn_from(tmp_path: Path) -> None:
    """The draws are those of the chain."""
    found = read_result(stored(tmp_path, posterior())).draws()

    assert np.array_equal(np.sort(found["J"]), np.sort(CHAIN[:, :, 4].ravel()))


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (removed, "Kt25"),
        (replaced(np.nan), "draws of Kt25 that are not finite"),
        (replaced(-2.0), "draws of Kt25 that are not above zero"),
        (replaced(b"two"), "could not convert string to float"),
        (other_shape, "expected one number of draws"),
    ],
)
def test_edited_posterior_is_refused(
    tmp_path: Path, edit: Callable[[h5py.Group], None], words: str
) -> None:
    """One variable was changed with another program."""
    directory = stored(tmp_path, posterior())
    with h5py.File(directory / "posterior.nc", "r+") as file:
        edit(file["posterior"])

    with pytest.raises(InputError, match=words) as caught:
        read_result(directory).draws()

    assert str(caught.value).startswith(str(directory / "posterior.nc"))


@pytest.mark.parametrize("name", ["Ra25", "L"])
def test_posterior_of_another_fit_is_refused(tmp_path: Path, name: str) -> None:
    """The median of one parameter in result.json is 10 % or ten standard deviations off."""
    directory = stored(tmp_path, posterior(), **{name: MEDIANS[name] + 0.2})

    with pytest.raises(InputError, match=f"another fit than result.json: the median of {name}"):
        read_result(directory).draws()


def test_noise_of_the_sampler_makes_no_other_fit(tmp_path: Path) -> None:
    """Medians of another chain of the same posterior deviate by a tenth of its deviation."""
    directory = stored(tmp_path, posterior(), Ra25=MEDIANS["Ra25"] + 0.002)

    assert len(read_result(directory).draws()["Ra25"]) == 400


@given(
    at=st.floats(0.0, 1.0, exclude_max=True),
    damage=st.sampled_from(["cut", "zero", "flip", "large"]),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_damaged_posterior_gives_draws_or_is_refused(at: float, damage: str) -> None:
    """A part is cut off, zeroed, changed by one bit or replaced by a large number."""
    content = bytearray(posterior())
    place = int(at * len(content))
    match damage:
        case "cut":
            del content[place:]
        case "zero":
            content[place : place + 512] = bytes(len(content[place : place + 512]))
        case "flip":
            content[place] ^= 16
        case _:
            content[place : place + 8] = (2**63).to_bytes(8, "little")
    refused, draws = "", {}
    try:
        draws = chain_draws(io.BytesIO(content), 100, "posterior.nc")
    except InputError as error:
        refused = str(error)

    assert refused.isprintable()
    assert bool(refused) != bool(draws)
    assert all(np.all(np.isfinite(values)) for values in draws.values())
