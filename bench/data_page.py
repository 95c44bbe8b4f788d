"""Page that documents the campaigns in ``data/``, generated from their true values."""

from __future__ import annotations

from collections.abc import Mapping

from bench.campaign import Campaign

__all__ = ["data_page"]

_HEAD = """\
# Campaigns

Each folder contains one campaign of one motor: five training runs and two validation runs from 25
to 120 degC, in the order of recording and in the form in which a bench would log them.
The runs are simulated, so the true values are known.
They are in `truth.json`, which the identification does not read.

    motorid fit data/paper_motor/training_*.csv \\
        --validation data/paper_motor/validation_*.csv --out out

## Simulation

`python -m bench.make_data` writes this folder, including this page.
`python -m bench.make_data --check` generates everything again and compares every byte.
The bench simulator shares no code with the identification and integrates the hidden plant by
another method, Dormand-Prince 5(4).
The drive limits its voltage so that the steady current stays below three times the rated current.
The voltage is constant between samples (zero-order hold).
Current and speed have white noise and the resolution of their converters, the voltage has less of
both, and the thermometer 0.1 K of each.
The temperature varies between the runs and within each run.
The runs begin in motion.

## Campaigns
"""

_TAIL = """
## Licence

MIT, like the rest of the project (see `LICENSE`).

## Checksums

`sha256sum --check SHA256SUMS` in this folder compares the files with their checksums.

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
        f"{truth['runs'][0]['rows']} samples a run "
        f"every {_number(1e3 * motor.sample_interval)} ms; seed {truth['seed']}.",
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
        lines.append("The motor follows the nominal model exactly; it has no effect.")
    for effect in truth["effects"]:
        values = ", ".join(f"{key} {_number(value)}" for key, value in effect["values"].items())
        lines.append(
            f"The nominal model lacks `{effect['name']}` ({effect['equation']}): {values} in SI, "
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
