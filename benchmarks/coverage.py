"""Coverage of the 90 % intervals on simulated campaigns.

    python -m benchmarks.coverage [--campaigns 60] [--rows 2500] [--out docs/benchmarks/coverage.md]

Random motors from 1 W to 10 kW are simulated by the independent bench simulator (`bench/`) with
white and coloured noise and noise with outliers, with zero- and first-order hold, and identified
from the runs alone.  The table gives the fraction of intervals from q05 to q95 that contain the
true parameter, the largest deviation in posterior standard deviations, and the noise ratio of the
validation runs.  The expected fraction is 0.90; its binomial standard deviation uses the number of
campaigns, because the parameters of one campaign are correlated.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from bench import BenchRun, Campaign, Noise, make_campaign
from identification import FitOptions, Run, identify

__all__ = ["Outcome", "main", "outcome_of", "run_of"]

KINDS: tuple[Literal["white", "coloured", "spiky"], ...] = ("white", "coloured", "spiky")


@dataclass(frozen=True)
class Outcome:
    """One campaign.

    Args:
        motor: Name of the motor.
        kind: Kind of the noise.
        hold: Behaviour of the voltage between samples.
        deviations: Parameter name to (mean - truth) / sd, of identified parameters [-].
        inside: Parameter name to True if the 90 % interval contains the true value.
        ratio: Larger validation noise ratio of the two channels [-].
        true_ratio: The same ratio with the true noise of the simulator [-].
        seconds: Computing time [s].
    """

    motor: str
    kind: str
    hold: str
    deviations: dict[str, float]
    inside: dict[str, bool]
    ratio: float
    true_ratio: float
    seconds: float


def run_of(recorded: BenchRun, name: str) -> Run:
    """Convert a recording of the bench simulator to a run of the reader."""
    frame = recorded.frame
    text = io.StringIO()
    frame.to_csv(text, index=False)

    def column(header: str) -> np.ndarray | None:
        return frame[header].to_numpy(float) if header in frame else None

    time_s, voltage, current, speed = (
        frame[header].to_numpy(float)
        for header in ("time_s", "voltage_V", "current_A", "speed_rad_s")
    )
    return Run(
        name=name,
        sha256=hashlib.sha256(text.getvalue().encode()).hexdigest(),
        time=time_s,
        voltage=voltage,
        current=current,
        speed=speed,
        temperature=column("temperature_degC"),
        position=column("position_rad"),
    )


def outcome_of(campaign: Campaign, kind: str, hold: str, seed: int) -> Outcome:
    """Identify one campaign and compare the result with the true parameters."""
    training = [run_of(r, f"training_{k}.csv") for k, r in enumerate(campaign.training, 1)]
    validation = [run_of(r, f"validation_{k}.csv") for k, r in enumerate(campaign.validation, 1)]
    began = time.perf_counter()
    result = identify(training, validation, FitOptions(seed=seed, effects=False)).result
    seconds = time.perf_counter() - began
    deviations, inside = {}, {}
    for name, entry in result["parameters"].items():
        truth = float(campaign.truth["parameters"][name])
        if entry["identified"]:
            deviations[name] = (entry["mean"] - truth) / entry["sd"]
            inside[name] = entry["q05"] <= truth <= entry["q95"]
    errors = result["errors"]["after"]["validation"]
    noise = campaign.truth["noise"]
    return Outcome(
        motor=campaign.motor.name,
        kind=kind,
        hold=hold,
        deviations=deviations,
        inside=inside,
        ratio=max(errors[c]["noise_ratio"] for c in ("current", "speed")),
        true_ratio=max(
            errors["current"]["rmse"] / noise["current_A"],
            errors["speed"]["rmse"] / noise["speed_rad_s"],
        ),
        seconds=seconds,
    )


def _table(outcomes: Sequence[Outcome]) -> list[str]:
    names = list(dict.fromkeys(name for o in outcomes for name in o.inside))
    lines = [
        "| parameter | identified in | coverage of the 90 % interval | largest deviation [sd] |",
        "|---|---|---|---|",
    ]
    for name in names:
        held = [o.inside[name] for o in outcomes if name in o.inside]
        worst = max(abs(o.deviations[name]) for o in outcomes if name in o.deviations)
        lines.append(
            f"| `{name}` | {len(held)} of {len(outcomes)} | {100 * np.mean(held):.1f} % "
            f"| {worst:.2f} |"
        )
    every = [value for o in outcomes for value in o.inside.values()]
    spread = 100 * np.sqrt(0.9 * 0.1 / len(outcomes))
    lines.append(
        f"| all | {len(every)} intervals | **{100 * np.mean(every):.1f} %** "
        f"(sampling error of one parameter: 90 ± {spread:.1f} %) "
        f"| {max(abs(v) for o in outcomes for v in o.deviations.values()):.2f} |"
    )
    lines += [
        "",
        "| noise | campaigns | coverage | validation noise ratio: median, largest |",
        "|---|---|---|---|",
    ]
    for kind in dict.fromkeys(o.kind for o in outcomes):
        some = [o for o in outcomes if o.kind == kind]
        held = [value for o in some for value in o.inside.values()]
        ratios = [o.ratio for o in some]
        lines.append(
            f"| {kind} | {len(some)} | {100 * np.mean(held):.1f} % "
            f"| {np.median(ratios):.3f}, {max(ratios):.3f} |"
        )
    return lines


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the campaigns and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--campaigns", type=int, default=60)
    parser.add_argument("--rows", type=int, default=2500)
    parser.add_argument("--first", type=int, default=1000, help="seed of the first motor")
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/coverage.md"))
    chosen = parser.parse_args(arguments)
    outcomes = []
    for k in range(chosen.campaigns):
        seed = chosen.first + k
        kind, hold = KINDS[k % 3], ("zoh", "foh")[(k // 3) % 2]
        campaign = make_campaign(
            seed, seed=seed, rows=chosen.rows, noise=Noise(kind=kind), hold=hold
        )
        outcome = outcome_of(campaign, kind, hold, seed)
        outcomes.append(outcome)
        worst = max(outcome.deviations, key=lambda n: abs(outcome.deviations[n]), default="")
        print(  # noqa: T201
            f"{k + 1:3d} {outcome.motor:24s} {kind:9s} {hold} "
            f"{sum(outcome.inside.values())}/{len(outcome.inside)} inside, worst {worst} "
            f"{outcome.deviations.get(worst, 0.0):+.2f} sd, ratio {outcome.ratio:.3f} "
            f"({outcome.true_ratio:.3f} of the true noise), {outcome.seconds:.1f} s",
            flush=True,
        )
    command = (
        f"python -m benchmarks.coverage --campaigns {chosen.campaigns} --rows {chosen.rows} "
        f"--first {chosen.first}"
    )
    text = "\n".join(
        [
            "# Coverage of the 90 % intervals",
            "",
            f"Made by `{command}`: random motors of the bench simulator, 5 training and 2 "
            f"validation runs of {chosen.rows} samples each; the fit uses only the runs.",
            "",
            *_table(outcomes),
            "",
        ]
    )
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_text(text, encoding="utf-8")
    print(text)  # noqa: T201


if __name__ == "__main__":
    main()
