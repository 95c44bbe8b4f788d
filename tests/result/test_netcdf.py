"""The posterior file, read back with an independent library."""

from __future__ import annotations

from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pytest

from identification.result.draws import write_posterior

NAMES, UNITS = ("Ra25", "J"), ("ohm", "kg m^2")
RNG = np.random.default_rng(51)
CHAIN = RNG.standard_normal((40, 6, 2))
LOG_PROB = RNG.standard_normal((40, 6))


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """Posterior file of six walkers, forty draws and two parameters."""
    path = tmp_path / "posterior.nc"
    write_posterior(
        path, NAMES, UNITS, CHAIN, LOG_PROB, acceptance=0.4, attributes={"motorid": "0.1.0"}
    )
    return path


def test_each_parameter_is_a_variable_over_chain_and_draw(written: Path) -> None:
    """Group and dimensions follow ArviZ; each walker is a chain."""
    with h5netcdf.File(written, "r") as file:
        posterior = file["posterior"]

        assert posterior["J"].dimensions == ("chain", "draw")
        assert np.array_equal(posterior["J"][...], CHAIN[:, :, 1].T)
        assert posterior["chain"][...].tolist() == list(range(6))
        assert posterior["draw"][...].tolist() == list(range(40))


def test_units_interval_and_versions_stand_in_the_attributes(written: Path) -> None:
    """Units follow the contract; the kind of interval is given with its level."""
    with h5netcdf.File(written, "r") as file:
        assert file.attrs["schema_version"] == "1"
        assert file.attrs["motorid"] == "0.1.0"
        assert file["posterior"].attrs["interval_kind"] == "equal-tailed"
        assert file["posterior"].attrs["interval_level"] == 0.9
        assert file["posterior"]["J"].attrs["units"] == "kg m^2"


def test_the_log_density_is_stored_with_the_draws(written: Path) -> None:
    """Group and name follow ArviZ; a single acceptance rate is repeated for each walker."""
    with h5netcdf.File(written, "r") as file:
        stats = file["sample_stats"]

        assert np.array_equal(stats["lp"][...], LOG_PROB.T)
        assert stats["acceptance_rate"][...].tolist() == [0.4] * 6


def test_draws_whose_density_is_unknown_have_none_in_the_file(tmp_path: Path) -> None:
    """Readers take a variable of NaN for a failed chain; an absent one is optional."""
    path = tmp_path / "posterior.nc"
    write_posterior(path, NAMES, UNITS, CHAIN, None, acceptance=0.4)

    with h5netcdf.File(path, "r") as file:
        assert "lp" not in file["sample_stats"].variables
        assert file["posterior"]["J"].shape == (6, 40)


def test_the_file_is_netcdf4_and_not_merely_hdf5(written: Path) -> None:
    """Dimensions are HDF5 dimension scales, from which other NetCDF readers take the axis names."""
    with h5py.File(written, "r") as file:
        scales = file["posterior/Ra25"].dims

        assert [dimension[0].name for dimension in scales] == [
            "/posterior/chain",
            "/posterior/draw",
        ]


def test_the_same_chain_gives_the_same_bytes(written: Path, tmp_path: Path) -> None:
    """The file contains no time stamp."""
    again = tmp_path / "again.nc"

    write_posterior(
        again, NAMES, UNITS, CHAIN, LOG_PROB, acceptance=0.4, attributes={"motorid": "0.1.0"}
    )

    assert again.read_bytes() == written.read_bytes()
