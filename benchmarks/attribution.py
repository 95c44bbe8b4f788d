"""Are hidden effects named?

    python -m benchmarks.attribution [--campaigns 400] [--rows 1500]

The independent bench simulator hides an effect, or none, in a motor; the search is given the runs
and nothing else.  One line of JSON a campaign is appended to the log as soon as it is known, so a
run that was cut off goes on where it ended; the table is made from the whole log.

Counted for each kind of campaign: *exact*, the effects named are those hidden and no others;
*held*, the hidden ones are among those named or their alternatives.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bench import EFFECTS, MOTORS, EffectRequest, Noise, make_campaign
from benchmarks.coverage import run_of
from identification.effects.catalogue import CATALOGUE
from identification.effects.search import search
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared

__all__ = ["main", "plan", "tried"]

Kind = Literal["white", "coloured", "spiky"]
KINDS: tuple[Kind, ...] = ("white", "coloured", "spiky")


def plan(count: int) -> Iterator[dict[str, Any]]:
    """What to measure: clean motors, each effect by each of its laws, and pairs, by turns.

    Args:
        count: Number of campaigns.
    """
    motors = sorted(MOTORS)
    rng = np.random.default_rng(2026)
    singles = [(name, law) for name in CATALOGUE for law in EFFECTS[name].laws]
    names = sorted(CATALOGUE)
    for number in range(count):
        turn = number % 10
        if turn < 2:
            effects: list[tuple[str, str | None]] = []
            group = f"clean, {KINDS[(number // 10) % 3]} noise"
        elif turn < 9:
            name, law = singles[(number // 10 * 7 + turn - 2) % len(singles)]
            effects = [(name, law)]
            textbook = law == next(iter(EFFECTS[name].laws))
            group = "one effect" if textbook else "one effect, another law"
        else:
            pair = rng.choice(len(names), size=2, replace=False)
            effects = [(names[int(k)], None) for k in pair]
            group = "two effects"
        yield {
            "number": number,
            "group": group,
            "motor": motors[number % len(motors)],
            "effects": effects,
            "kind": KINDS[(number // 10) % 3] if not effects else "white",
        }


def tried(item: dict[str, Any], rows: int) -> dict[str, Any]:
    """One campaign: what was hidden, what was named, and how long it took.

    Args:
        item: An item of `plan`.
        rows: Samples a run.
    """
    requests = [EffectRequest(name=name, law=law) for name, law in item["effects"]]
    measured = make_campaign(
        item["motor"], requests, seed=item["number"], rows=rows, noise=Noise(kind=item["kind"])
    )
    campaign = campaign_of(
        [run_of(r, f"training_{k}.csv") for k, r in enumerate(measured.training, 1)],
        [run_of(r, f"validation_{k}.csv") for k, r in enumerate(measured.validation, 1)],
    )
    began = time.perf_counter()
    outcome = search(fit_declared(campaign.training, "zoh"), campaign)
    return item | {
        "named": [found.name for found in outcome.effects],
        "alternatives": sorted({a.name for f in outcome.effects for a in f.alternatives}),
        "seconds": round(time.perf_counter() - began, 2),
    }


def _table(done: Sequence[dict[str, Any]]) -> list[str]:
    lines = ["| campaigns | number | exact | held |", "|---|---|---|---|"]
    for group in sorted({d["group"] for d in done}):
        some = [d for d in done if d["group"] == group]
        exact = [sorted(d["named"]) == sorted(n for n, _ in d["effects"]) for d in some]
        held = [{n for n, _ in d["effects"]} <= {*d["named"], *d["alternatives"]} for d in some]
        shares = f"{100 * np.mean(exact):.0f} % | {100 * np.mean(held):.0f} %"
        lines.append(f"| {group} | {len(some)} | {shares} |")
    lines += ["", "| hidden | number | named (times) |", "|---|---|---|"]
    for name in CATALOGUE:
        some = [d for d in done if [n for n, _ in d["effects"]] == [name]]
        answers: dict[str, int] = {}
        for d in some:
            answer = " + ".join(sorted(d["named"])) or "nothing"
            answers[answer] = answers.get(answer, 0) + 1
        if some:
            text = ", ".join(f"{a} ({c})" for a, c in sorted(answers.items(), key=lambda x: -x[1]))
            lines.append(f"| `{name}` | {len(some)} | {text} |")
    seconds = np.median([d["seconds"] for d in done])
    return [*lines, "", f"Median time of the search: {seconds:.1f} s."]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is missing from the log and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--campaigns", type=int, default=400)
    parser.add_argument("--rows", type=int, default=1500)
    parser.add_argument("--log", type=Path, default=Path("out/attribution.jsonl"))
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/attribution.md"))
    chosen = parser.parse_args(arguments)
    chosen.log.parent.mkdir(parents=True, exist_ok=True)
    done = []
    if chosen.log.exists():
        done = [json.loads(line) for line in chosen.log.read_text().splitlines() if line]
    known = {d["number"] for d in done}
    for item in plan(chosen.campaigns):
        if item["number"] in known:
            continue
        outcome = tried(item, chosen.rows)
        done.append(outcome)
        with chosen.log.open("a", encoding="utf-8") as log:
            log.write(json.dumps(outcome) + "\n")
        print(json.dumps(outcome), flush=True)  # noqa: T201
    text = "\n".join(
        [
            "# Attribution of hidden effects",
            "",
            f"Made by `python -m benchmarks.attribution --campaigns {chosen.campaigns} "
            f"--rows {chosen.rows}`: motors of the bench simulator, 5 training and 2 validation "
            "runs each, sizes in the middle of each effect's typical range.",
            "",
            *_table(done),
            "",
        ]
    )
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(text, encoding="utf-8")
    print(text)  # noqa: T201


if __name__ == "__main__":
    main()
