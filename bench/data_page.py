"""Page that documents the campaigns in ``data/``, generated from their true values."""

from __future__ import annotations

from collections.abc import Mapping

from bench.campaign import Campaign

__all__ = ["data_page"]

_HEAD = """\
# Campaigns

Each folder is one campaign on one motor: five training runs and two validation runs, in the order
in which they were recorded, 25 to 120 degC, as a bench would log them.
They are simulated, so the truth is known.
It stands beside them in `truth.json`, which nothing in the identification reads.

    motorid fit data/paper_motor/training_*.csv \\
        --validation data/paper_motor/validation_*.csv --out out

## How they were made

`python -m bench.make_data` writes this folder, this page included.
`python -m bench.make_data --check` makes everything again and compares every byte.
The bench simulator shares no code with the identification and carries the hidden plant by another
kind of step, Dormand-Prince 5(4).
The drive limits its voltage so that the current settles below three times the rated one.
Between samples the voltage is held.
Current and speed carry white noise and the resolution of their converters, the voltage a little of
both, the thermometer 0.1 K of each.
The temperature moves between the runs and within each.
Runs begin in motion.

## What is in them
"""

_TAIL = """
## Licence

MIT, as the rest of the project (see `LICENSE`).

## Sums

`sha256sum --check SHA256SUMS` in this folder checks them.

"""


def _number(value: float) -> str:
    return f"{value:.4g}"


def _section(name: str, campaign: Campaign) -> str:
    """Tables and sentences of one campaign."""
    truth, motor = campaign.truth, campaign.motor
    units = {"Ra25": "ohm", "alpha_Ra": "1/K", "Kt25": "N m/A", "alpha_Kt": "1/K",
             "J": "kg m^2", "b": "N m s/rad", "L": "H"}  # fmt: skip
    lines = [
        f"### {name}",
        "",
        f"Motor `{motor.name}`, {_number(motor.rated_voltage)} V, "
        f"{_number(motor.rated_current)} A, {_number(motor.rated_speed)} rad/s; "
        f"{truth['runs'][0]['rows']} rows a run every {_number(1e3 * motor.sample_interval)} ms; "
        f"seed {truth['seed']}.",
        "",
        "| parameter | truth | unit |",
        "|---|---|---|",
        *(f"| `{key}` | {_number(value)} | {units[key]} |" for key, value in
          truth["parameters"].items()),
        f"| noise of `current_A` | {_number(truth['noise']['current_A'])} | A |",
        f"| noise of `speed_rad_s` | {_number(truth['noise']['speed_rad_s'])} | rad/s |",
        "",
    ]  # fmt: skip
    if not truth["effects"]:
        lines.append("The declared model is exactly right: nothing is missing.")
    for effect in truth["effects"]:
        values = ", ".join(f"{key} {_number(value)}" for key, value in effect["values"].items())
        lines.append(
            f"The declared model lacks `{effect['name']}` ({effect['equation']}): {values} in SI, "
            f"{_number(100 * effect['size'])} % of {effect['size_means']}."
        )
    lines += ["", "| run | excitation | temperature |", "|---|---|---|"]
    for run in truth["runs"]:
        low, high = run["temperature_degC"]
        lines.append(f"| `{run['file']}` | {run['excitation']} | {low:.1f} to {high:.1f} degC |")
    return "\n".join(lines) + "\n"


def data_page(campaigns: Mapping[str, Campaign], sums: str) -> str:
    """Markdown text of ``data/README.md``.

    Args:
        campaigns: Campaigns by name of their folder.
        sums: Text of ``SHA256SUMS``.
    """
    sections = "\n".join(_section(name, campaign) for name, campaign in campaigns.items())
    table = ["| file | sha256 |", "|---|---|"]
    for line in sums.splitlines():
        told, name = line.split("  ")
        table.append(f"| `{name}` | `{told}` |")
    return _HEAD + "\n" + sections + _TAIL + "\n".join(table) + "\n"
