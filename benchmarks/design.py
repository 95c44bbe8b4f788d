"""Separation of tied effects by a designed run, on simulated motors.

    python -m benchmarks.design [--cases 60] [--seed 0] [--log out/design.jsonl]

The independent bench simulator adds one effect to a randomly drawn motor and records two short runs
in one direction.  If the fit leaves the effect tied with others, a third, shorter run is played on
the same motor, and all three runs are fitted: the designed run, random levels, a binary signal and
a multisine.  All hold the same limits, at the same temperature.  To save time, the search knows
only the effects of one group; the rest is the program as a user runs it.

Each tried campaign appends one line of JSON to the log, so an interrupted measurement can be
resumed; the table is generated from the whole log.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench import EffectRequest, make_campaign
from bench.excitation import EXCITATIONS, Pace
from bench.motors import Motor, random_motor
from bench.simulator import SimulationFailed
from benchmarks.coverage import run_of
from identification import FitOptions, Run, identify
from identification.design import DesignOptions, proposal_entry, propose, task_of_result
from identification.design.models import time_constants
from identification.design.profiles import Profile, multisine, prbs, random_levels
from identification.design.propose import Designer
from identification.effects.catalogue import CATALOGUE
from identification.errors import IdentificationError

__all__ = ["main", "plan", "table", "tried"]

Array = NDArray[np.float64]

GROUPS: Final = (
    ("coulomb_friction", "load_torque", "stribeck_friction"),
    ("voltage_offset", "speed_offset", "brush_drop"),
    ("channel_delay", "speed_filter", "inductance_saturation"),
)
TEMPERATURE: Final = 25.0
ROWS: Final = 300
NEW_ROWS: Final = 120
TIED: Final = 0.02
"""Least probability of the true effect and of another one, from which they count as tied [-]."""
DECIDED: Final = 0.95
KINDS: Final = ("designed", "random levels", "binary signal", "multisine")


def plan(seed: int) -> Iterator[dict[str, Any]]:
    """Campaigns in a balanced order, without end.

    Args:
        seed: Seed of motors and effect sizes.
    """
    rng = np.random.default_rng(seed)
    turns = [(g, name) for k in range(3) for g, names in enumerate(GROUPS) for name in [names[k]]]
    number = 0
    while True:
        group, effect = turns[number % len(turns)]
        yield {
            "number": number,
            "seed": number + 1000 * seed,
            "motor": 50_000 + number + 1000 * seed,
            "group": group,
            "effect": effect,
            "share": float(rng.uniform(0.0, 1.0)),
        }
        number += 1


def tried(item: dict[str, Any]) -> dict[str, Any]:
    """Record, identify, design and repeat with each further run.

    Args:
        item: An item of `plan`.
    """
    began = time.process_time()
    motor = random_motor(item["motor"])
    requests = [_request(item)]
    settings = _settings() | {"seed": item["seed"]}
    try:
        measured = make_campaign(motor, requests, direction="forward", **settings)
        runs = [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training[:2])]
        before = _identified(runs, item["group"])
    except (SimulationFailed, IdentificationError) as error:
        return item | {"skipped": str(error)}
    known = _probabilities(before)
    if not _is_tied(before, item["effect"]):
        return item | {"skipped": "not tied", "before": known}
    duration = NEW_ROWS * motor.sample_interval
    options = DesignOptions(temperatures=(TEMPERATURE,), duration=duration)
    task = task_of_result(before, options)
    proposal = propose(task)
    designer, found = Designer(task), {}
    for kind in KINDS:
        voltage = proposal.best.voltage
        if kind != KINDS[0]:
            one = designer.candidate(_textbook(kind, designer, item["seed"]), TEMPERATURE)
            if one is None:
                continue
            voltage = one.voltage
        try:
            new = _played(motor, requests, voltage, item["seed"])
            found[kind] = _probabilities(_identified([*runs, new], item["group"]))
        except (SimulationFailed, IdentificationError) as error:
            found[kind] = {"failed": 0.0, str(error)[:80]: 0.0}
    return item | {
        "before": known,
        "after": found,
        "expected_bits": (proposal_entry(proposal)["separation"] or {}).get("gain_bits_least"),
        "profile": proposal.best.profile.label,
        "seconds": round(time.process_time() - began, 1),
    }


def _settings() -> dict[str, Any]:
    return {
        "rows": ROWS, "training": 3, "validation": 0, "temperature_motion": 0.0,
        "temperature_span": (TEMPERATURE, TEMPERATURE), "moving_start": False,
    }  # fmt: skip


def _request(item: dict[str, Any]) -> EffectRequest:
    from bench import EFFECTS

    low, high = EFFECTS[item["effect"]].typical
    return EffectRequest(item["effect"], size=low * (high / low) ** item["share"])


def _identified(runs: Sequence[Run], group: int) -> dict[str, Any]:
    withheld = [name for name in CATALOGUE if name not in GROUPS[group]]
    options = FitOptions(posterior=False, effort="quick")
    return identify(list(runs), [], options, withheld=withheld).result


def _probabilities(result: dict[str, Any]) -> dict[str, float]:
    """Probability of each effect and of each alternative."""
    found: dict[str, float] = {}
    for effect in result["effects"]:
        for one in (effect, *effect["alternatives"]):
            found[one["name"]] = max(one["probability"], found.get(one["name"], 0.0))
    return found


def _is_tied(result: dict[str, Any], true: str) -> bool:
    """True if an effect and its alternatives, one of them the true effect, all remain possible."""
    for effect in result["effects"]:
        odds = {one["name"]: one["probability"] for one in (effect, *effect["alternatives"])}
        if len(odds) > 1 and odds.get(true, 0.0) >= TIED:
            return bool(sorted(odds.values())[-2] >= TIED)
    return False


def _textbook(kind: str, designer: Designer, seed: int) -> Profile:
    """Random levels, a binary signal or a multisine for the time constants of the motor."""
    task, rng = designer.task, np.random.default_rng([seed, 7])
    fast, slow = time_constants(task.models[:1])
    clock = min(max(0.3 * slow, fast, 3.0 * task.interval), task.duration / 20.0)
    if kind == "random levels":
        return random_levels(task.duration, clock, rng)
    if kind == "binary signal":
        return prbs(task.duration, clock, rng)
    low, high = 2.0 / task.duration, 0.15 / task.interval
    return multisine(task.duration, low, max(min(high, 0.6 / max(fast, 1e-9)), 4.0 * low), rng)


def _played(motor: Motor, requests: Sequence[EffectRequest], voltage: Array, seed: int) -> Run:
    """Third run of the campaign, with this voltage."""

    def shape(rows: int, pace: Pace, rng: np.random.Generator) -> Array:
        return voltage / motor.rated_voltage

    # The campaign takes its excitations by name; the third run is the played one.
    EXCITATIONS["played"] = shape
    try:
        campaign = make_campaign(
            motor, requests, seed, amplitude=1.0, excitation=("steps", "steps", "played"),
            **(_settings() | {"rows": voltage.size}),
        )  # fmt: skip
    finally:
        del EXCITATIONS["played"]
    return run_of(campaign.training[2], "t2.csv")


def table(done: Sequence[dict[str, Any]], command: str) -> str:
    """Page with the fraction of cases in which the true effect wins, for each kind of run.

    Args:
        done: Outcomes of `tried`.
        command: Command that made them.
    """
    cases = [one for one in done if "after" in one]
    lines = [
        "# Separation by a designed run",
        "",
        "Made by `make design-benchmark`:",
        "",
        f"    {command}",
        "",
        *(__doc__ or "").split("\n\n")[2].splitlines(),
        "",
        f"Of {len(done)} campaigns, {len(cases)} left the true effect tied with another one "
        f"(both with a probability of at least {TIED:g}).",
        f"The two runs have {ROWS} samples each, the third one {NEW_ROWS}.  "
        "The true effect wins if its probability exceeds one half, "
        f"and is decided if it exceeds {DECIDED:g}.",
        "",
        "| third run | true effect wins | decided | median probability of the true effect |",
        "|---|---|---|---|",
        f"| none | {_row(cases, None)} |",
        *(f"| {kind} | {_row(cases, kind)} |" for kind in KINDS),
        "",
        "## By true effect",
        "",
        "| effect | cases | " + " | ".join(KINDS) + " |",
        "|---|---|" + "---|" * len(KINDS),
    ]
    for name in dict.fromkeys(name for group in GROUPS for name in group):
        own = [one for one in cases if one["effect"] == name]
        wins = [sum(_true(one, kind) > 0.5 for one in own) for kind in KINDS]
        if own:
            lines.append(f"| `{name}` | {len(own)} | " + " | ".join(map(str, wins)) + " |")
    return "\n".join(lines) + "\n"


def _row(cases: Sequence[dict[str, Any]], kind: str | None) -> str:
    true = np.array([_true(one, kind) for one in cases])
    if not true.size:
        return " | | "
    wins, decided = int(np.sum(true > 0.5)), int(np.sum(true > DECIDED))
    return f"{wins} of {true.size} | {decided} of {true.size} | {np.median(true):.3f}"


def _true(one: dict[str, Any], kind: str | None) -> float:
    """Probability of the true effect after a kind of run."""
    found = one["before"] if kind is None else one["after"].get(kind, {})
    return float(found.get(one["effect"], 0.0))


def main(arguments: Sequence[str] | None = None) -> None:
    """Try campaigns until enough of them are tied, and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=60, help="number of tied cases")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--log", type=Path, default=Path("out/design.jsonl"))
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/design.md"))
    chosen = parser.parse_args(arguments)
    chosen.log.parent.mkdir(parents=True, exist_ok=True)
    done = []
    if chosen.log.exists():
        done = [json.loads(line) for line in chosen.log.read_text().splitlines() if line]
    for item in plan(chosen.seed):
        if sum("after" in one for one in done) >= chosen.cases:
            break
        if item["number"] < len(done):
            continue
        done.append(tried(item))
        with chosen.log.open("a", encoding="utf-8") as log:
            log.write(json.dumps(done[-1]) + "\n")
        print(json.dumps(done[-1]), flush=True)
    command = f"python -m benchmarks.design --cases {chosen.cases} --seed {chosen.seed}"
    chosen.out.write_text(table(done, command), encoding="utf-8")


if __name__ == "__main__":
    main()
