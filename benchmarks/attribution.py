"""Identification rate of hidden effects on simulated campaigns.

    python -m benchmarks.attribution [--campaigns 400] [--rows 1500] [--seed 0] [--only 7,11]

The independent bench simulator adds up to two effects to a randomly drawn motor; the search uses
only the runs.  Each finished campaign appends one line of JSON to the log, so an interrupted
measurement can be resumed; the tables are generated from the whole log.  One process per core
computes the campaigns, with one thread each.

An effect that increases the validation error of the best nominal model by less than 5 % of the
noise counts as not detectable and has a separate row.  The same holds for two effects if one of
them alone would not be detectable in that motor.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench import EFFECTS, EffectRequest, Noise, make_campaign
from bench.campaign import Campaign as Recorded
from bench.visibility import held_out_rise, size_for_rise
from benchmarks.coverage import run_of
from benchmarks.tables import tables
from identification.effects.catalogue import CATALOGUE
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.evaluate import simulate_unseen
from identification.fit.noise import with_noise_model
from identification.fit.solve import Fit
from identification.options import EFFORTS
from identification.posterior.density import Posterior
from identification.selection.non_identifiable import with_linear_parts
from identification.selection.search import search
from identification.work import Budget, metered

__all__ = ["main", "plan", "tried"]

KINDS = ("white", "coloured", "spiky")
POSITIONS = ("none", "absolute", "none", "incremental")
_APART = 1_000_000


def plan(count: int, seed: int = 0) -> Iterator[dict[str, Any]]:
    """Campaigns to measure, in an order whose first n are a balanced sample.

    Args:
        count: Number of campaigns.
        seed: Seed of motors, effect sizes, excitation and noise.
    """
    rng = np.random.default_rng(2026 + seed)
    listed = [name for name in EFFECTS if name in CATALOGUE]
    unlisted = [name for name in EFFECTS if name not in CATALOGUE]
    other = [(name, law) for name in listed for law in list(EFFECTS[name].laws)[1:]]
    strange = [(name, law) for name in unlisted for law in EFFECTS[name].laws]
    turns = {"clean": 0, "large": 0, "small": 0, "two": 0, "law": 0, "unlisted": 0}
    order = ["large", "clean", "law", "unlisted", "two", "large", "small", "unlisted", "law"]
    order.append("clean")
    for number in range(count):
        group = order[number % len(order)]
        turn = turns[group]
        turns[group] += 1
        effects: list[tuple[str, str | None]] = []
        if group in ("large", "small"):
            effects = [(listed[turn % len(listed)], None)]
        elif group == "law":
            effects = [other[turn % len(other)]]
        elif group == "unlisted":
            effects = [strange[turn % len(strange)]]
        elif group == "two":
            pair = rng.choice(len(listed), size=2, replace=False)
            effects = [(listed[int(k)], None) for k in pair]
        yield {
            "number": number,
            "group": group,
            "seed": number + _APART * seed,
            "motor": 10_000 + number + _APART * seed,
            "effects": effects,
            "share": float(rng.uniform(0.4, 1.0)),
            "rise": float(rng.uniform(0.08, 0.3)),
            "noise": KINDS[(number // len(order)) % 3],
            "position": POSITIONS[(number // len(order)) % 4],
        }


def tried(item: dict[str, Any], rows: int) -> dict[str, Any]:
    """Simulate and identify one campaign; return effects, errors and time.

    Args:
        item: An item of `plan`.
        rows: Samples per run.
    """
    noise = Noise(kind=item["noise"])
    settings = {"seed": item["seed"], "rows": rows, "noise": noise, "position": item["position"]}
    requests = []
    for name, law in item["effects"]:
        low, high = EFFECTS[name].typical
        size = low * (high / low) ** item["share"]
        if item["group"] == "small":
            found = size_for_rise(item["motor"], name, item["rise"], law, **settings)
            if found is None:
                return item | {"skipped": "no effect size gives the requested error"}
            size = found
        requests.append(EffectRequest(name=name, size=size, law=law))
    measured = make_campaign(item["motor"], requests, **settings)
    silent = replace(noise, current=0.0, speed=0.0)
    exact = make_campaign(item["motor"], requests, **(settings | {"noise": silent}))
    campaign = campaign_of(
        [run_of(r, f"training_{k}.csv") for k, r in enumerate(measured.training, 1)],
        [run_of(r, f"validation_{k}.csv") for k, r in enumerate(measured.validation, 1)],
    )
    began = time.perf_counter()
    declared = fit_declared(campaign.training, "zoh")
    samples = sum(record.rows for record in campaign.training)
    with metered():
        outcome = search(declared, campaign, budget=Budget(EFFORTS["normal"].search_of(samples)))
    seconds = time.perf_counter() - began
    noise_sd = [measured.truth["noise"][name] for name in ("current_A", "speed_rad_s")]
    equations = {
        term.name: [term.equation, *term.drivers] for term in outcome.fit.simulator.model.terms
    }
    return item | {
        "sizes": [request.size for request in requests],
        "rises": [held_out_rise(item["motor"], [one], **settings) for one in requests],
        "named": [found.name for found in outcome.effects],
        "alternatives": sorted({a.name for f in outcome.effects for a in f.alternatives}),
        "where": [equations[found.name] for found in outcome.effects],
        "noise_there": _noise_there(measured, exact, noise_sd),
        "before": _ratios(declared, campaign, noise_sd),
        "after": _ratios(outcome.fit, campaign, noise_sd),
        "deviations": _deviations(outcome.fit, measured.truth["parameters"]),
        "seconds": round(seconds, 2),
        "complete": outcome.complete,
    }


def _ratios(fit: Fit, campaign: Campaign, noise: Sequence[float]) -> list[float]:
    """Ratio of validation error to true noise, for current and speed."""
    own = any(state.is_own for term in fit.simulator.model.terms for state in term.states)
    squares, counts = np.zeros(2), np.zeros(2)
    for s in simulate_unseen(fit, campaign.validation, whole=own):
        squares += np.sum(s.record.weight * s.residual**2, axis=0)
        counts += s.record.weight.sum(axis=0)
    return [round(float(r), 4) for r in np.sqrt(squares / counts) / np.array(noise)]


def _noise_there(measured: Recorded, exact: Recorded, noise: Sequence[float]) -> list[float]:
    """Ratio of realised to nominal noise in the validation runs, for current and speed."""
    names = ["current_A", "speed_rad_s"]
    pairs = zip(measured.validation, exact.validation, strict=True)
    apart = np.concatenate([(one.frame[names] - other.frame[names]) for one, other in pairs])
    return [round(float(r), 4) for r in np.sqrt(np.mean(apart**2, axis=0)) / np.array(noise)]


def _deviations(fit: Fit, truth: dict[str, float]) -> dict[str, float]:
    """Error of each nominal parameter in posterior standard deviations."""
    final = with_noise_model(with_linear_parts(fit))
    posterior = Posterior(final, effective_fraction(final))
    spread = np.sqrt(np.diag(posterior.covariance()))
    at = dict(zip(final.coordinates.names, range(final.position.size), strict=True))
    wanted = final.values.copy()
    for name, value in truth.items():
        wanted[at[name]] = value
    gap = final.coordinates.of(wanted) - final.position
    return {name: round(float(gap[at[name]] / spread[at[name]]), 3) for name in truth}


def _begin(cores: Any) -> None:
    """Pin a worker to one core, so that parallel campaigns do not share threads."""
    os.sched_setaffinity(0, {cores.get()})


def _job(task: tuple[dict[str, Any], int]) -> dict[str, Any]:
    try:
        return tried(*task)
    except Exception as error:  # noqa: BLE001  one campaign must not end the benchmark
        return task[0] | {"failed": f"{type(error).__name__}: {error}"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the campaigns that are missing from the log and write the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--campaigns", type=int, default=400)
    parser.add_argument("--rows", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=0, help="seed of the campaigns")
    parser.add_argument(
        "--only",
        type=lambda text: {int(word) for word in text.split(",")},
        help="numbers of campaigns",
    )
    parser.add_argument("--log", type=Path, default=Path("out/attribution.jsonl"))
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/attribution.md"))
    chosen = parser.parse_args(arguments)
    chosen.log.parent.mkdir(parents=True, exist_ok=True)
    done = []
    if chosen.log.exists():
        done = [json.loads(line) for line in chosen.log.read_text().splitlines() if line]
    known = {d["number"] for d in done}
    items = plan(chosen.campaigns, chosen.seed)
    wanted = [item for item in items if chosen.only is None or item["number"] in chosen.only]
    tasks = [(item, chosen.rows) for item in wanted if item["number"] not in known]
    context = multiprocessing.get_context("spawn")
    cores = context.Queue()
    available = sorted(os.sched_getaffinity(0))
    for core in available:
        cores.put(core)
    with context.Pool(len(available), _begin, (cores,), maxtasksperchild=None) as pool:
        for outcome in pool.imap_unordered(_job, tasks):
            done.append(outcome)
            with chosen.log.open("a", encoding="utf-8") as log:
                log.write(json.dumps(outcome) + "\n")
            print(json.dumps(outcome), flush=True)  # noqa: T201
    options = f"--campaigns {chosen.campaigns} --rows {chosen.rows} --seed {chosen.seed}"
    command = f"python -m benchmarks.attribution {options}"
    text = tables(done, command, list(CATALOGUE), chosen.campaigns)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(text, encoding="utf-8")
    print(text)  # noqa: T201


if __name__ == "__main__":
    main()
