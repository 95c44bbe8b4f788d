"""Claims of `make peers` on small data: same posterior, its rate, arithmetic and fit."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.peers.__main__ import main
from benchmarks.peers.child import Stopwatch, posterior_line
from benchmarks.peers.costs import kernels_line
from benchmarks.peers.emcee_numba import MOVES, WALKERS, density_of
from benchmarks.peers.goals import goals
from benchmarks.peers.ours import fit_line, sampled
from benchmarks.peers.page import page
from benchmarks.peers.plan import PARTS, plan
from benchmarks.peers.problem import recording_of, task_of
from benchmarks.peers.statistics import agreement, exponent
from benchmarks.peers.task import Task
from benchmarks.speed import as_runs
from identification import threads
from identification.fit.declared import fit_declared
from identification.model.excitation import records_of

emcee = pytest.importorskip("emcee")

ROWS = 5_000


@pytest.fixture(scope="module")
def task() -> Task:
    """Five runs of a thousand rows."""
    recording, _, noise = recording_of(ROWS)
    return task_of(fit_declared(records_of(as_runs(recording)), "zoh"), recording, noise)


@pytest.fixture(scope="module")
def ours(task: Task) -> dict[str, Any]:
    """Line of the posterior by motorid."""
    return sampled(task, 0)


@pytest.fixture(scope="module")
def theirs(task: Task) -> dict[str, Any]:
    """Line of 400 steps of emcee with its best moves on the hand-written loop."""
    density, watch = density_of(task, "loop"), Stopwatch()
    start = task.started(0, WALKERS["loop"])
    density(start)
    sampler = emcee.EnsembleSampler(*start.shape, density, vectorize=True, moves=MOVES["de"])
    np.random.seed(0)  # noqa: NPY002  emcee reads the global generator
    with watch.timed("sampling"):
        sampler.run_mcmc(start, 400)
    return posterior_line(watch, task.physical(sampler.get_chain(discard=100)), 0.75)


def test_the_peers_sample_the_posterior_of_motorid(ours: dict[str, Any]) -> None:
    """The hand-tuned kernel is exact, so the log densities agree far below one."""
    assert ours["density_difference"] < 0.01


def test_an_effective_sample_costs_a_twentieth_of_one_on_the_hand_written_loop(
    ours: dict[str, Any], theirs: dict[str, Any]
) -> None:
    """The page measures more than a hundred; both spend the time of one process."""
    assert ours["ess_per_cpu_s"] > 20.0 * theirs["ess_per_cpu_s"]


def test_the_spread_is_that_of_emcee(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    """A faster sampler of a narrower posterior would win as well; 300 samples know it to 12 %."""
    np.testing.assert_allclose(ours["sd"], theirs["sd"], rtol=0.35)


def test_the_nominal_model_costs_at_most_twice_the_hand_tuned_kernel(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The page states 0.44, with dry friction 1.37.

    Both run in one thread, as for the page: two threads of one core slow each other.
    """
    monkeypatch.setattr(threads, "_told", 1)
    ratios = kernels_line(ROWS)["ratios"]

    assert ratios["nominal"] < 2.0
    assert ratios["friction"] < 5.0


def test_a_fit_without_a_guess_ends_where_a_fit_with_sensitivities_ends(task: Task) -> None:
    """Both minimise squares; the Runge-Kutta method may shift it by half a deviation."""
    by_scipy = pytest.importorskip("benchmarks.peers.fit").by_scipy
    from benchmarks.peers.sensitivities import LeastSquares  # noqa: PLC0415  compiled by this test

    problem = LeastSquares(task)
    found = problem.values(by_scipy(problem)[0])
    deviations = task.physical(task.started(1, 500)).std(axis=0)[:7]

    assert np.abs((found - fit_line(task)["values"]) / deviations).max() < 1.0


def test_nuts_samples_the_same_density_and_is_slower(task: Task, ours: dict[str, Any]) -> None:
    """A gradient of the JAX simulation costs more than all that motorid pays for one sample."""
    jax = pytest.importorskip("jax", reason="jax is in .venv-peers only (make peers)")
    pytest.importorskip("numpyro", reason="numpyro is in .venv-peers only (make peers)")
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003
    from benchmarks.peers.nuts import gradient_seconds, potential_of  # noqa: PLC0415

    z = np.random.default_rng(3).standard_normal((32, 9))
    points = task.centre + np.vstack([np.zeros(9), z]) @ task.root.T
    exact = density_of(task, "lanes")(np.resize(points, (64, 9)))[:33]
    found = -np.array([potential_of(task)(one) for one in np.vstack([np.zeros(9), z])])

    np.testing.assert_allclose(found - found[0], exact - exact[0], atol=1e-4)
    assert gradient_seconds(task) > 1.0 / ours["ess_per_wall_s_with_warm_up"]


def test_pysindy_names_the_friction_if_its_library_has_the_law(tmp_path: Path) -> None:
    """The comparison is fair only if the peer can succeed."""
    pytest.importorskip("pysindy", reason="pysindy is in .venv-peers only (make peers)")
    from bench import make_campaign  # noqa: PLC0415
    from benchmarks.peers.campaigns import CHANNELS  # noqa: PLC0415
    from benchmarks.peers.sindy import found_terms  # noqa: PLC0415

    recorded = make_campaign("servo_150w", [("coulomb_friction", 0.06)], seed=3, rows=2000)
    runs = [{n: run.frame[n].to_numpy(float) for n in CHANNELS} for run in recorded.runs]

    assert "sgn w" in found_terms(runs[:4], runs[4:5])[1]


def test_each_measurement_has_a_key_of_its_own() -> None:
    """The log is read by key, so two with one key would lose one."""
    keys = [each.key for each in plan(PARTS, (10_000, 100_000, 1_000_000), 2)]

    assert len(keys) == len(set(keys))


def test_the_exponent_is_that_of_a_power_law() -> None:
    """Cost 3 n^1.5."""
    sizes = [1e4, 1e5, 1e6]

    assert exponent(sizes, [3.0 * n**1.5 for n in sizes]) == pytest.approx(1.5)
    assert math.isnan(exponent([1e4], [1.0]))


def test_different_posteriors_do_not_agree() -> None:
    """Negative control: one mean is half a standard deviation off, ten errors of 400 samples."""
    one = {"mean": [1.0, 2.0], "sd": [0.1, 0.2], "ess": [800.0, 800.0]}

    assert agreement(one, one) == 0.0
    assert agreement(one, one | {"mean": [1.0, 2.1]}) == pytest.approx(10.0)


def _logged(name: str, rate: float) -> dict[str, Any]:
    spent = {"first call": 1.0, "sampling": 2.0}
    kinds = ("cpu_s", "wall_s", "cpu_s_with_warm_up", "wall_s_with_warm_up")
    return {
        "key": f"posterior/{name}", "part": "posterior", "name": name, "rows": 10_000, "effect": "",
        "wall": spent, "cpu": spent, "peak_mb": 100.0, "r_hat": 1.0, "ess": [1000.0] * 9,
        "mean": [1.0] * 9, "sd": [0.1] * 9, "density_difference": 0.0, "evaluations": 1000,
        "versions": {"numpy": "2"},
        **{f"ess_per_{kind}": rate for kind in kinds},
    }  # fmt: skip


def test_the_page_says_which_goals_are_not_reached(tmp_path: Path) -> None:
    """Ten times emcee is not twenty; a failed peer is named with its message."""
    lines = [_logged("motorid", 1000.0), _logged("emcee, loop", 100.0), _logged("NUTS", 10.0)]
    failed = {"key": "fit/scipy", "part": "fit", "name": "scipy", "rows": 10_000, "effect": ""}
    log = tmp_path / "log.jsonl"
    said = [*lines, failed | {"failed": "no wheel", "elapsed_s": 0.0}]
    log.write_text("\n".join(json.dumps(line) for line in said) + "\n", encoding="utf-8")

    main(["--only", "", "--log", str(log), "--out", str(tmp_path / "docs" / "b" / "peers.md")])
    written = (tmp_path / "docs" / "b" / "peers.md").read_text("utf-8")

    assert [reached for _, _, reached in goals(lines)] == ["**no**", "yes", "yes"]
    assert "no wheel" in written
    assert (tmp_path / "docs" / "pictures" / "peers" / "posterior.svg").exists()
    assert page(said, "make peers", "x").count("**no**") == 1
