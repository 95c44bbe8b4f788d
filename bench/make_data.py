"""Write the campaigns in ``data/``, or check that they are what this program generates.

python -m bench.make_data            write them
python -m bench.make_data --check    generate them again and compare every byte
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench.campaign import Campaign, EffectRequest, make_campaign
from bench.data_page import data_page

__all__ = ["RECIPES", "Recipe", "check", "main", "write_all"]

_DATA = Path(__file__).parent.parent / "data"
_SUMS = "SHA256SUMS"


@dataclass(frozen=True)
class Recipe:
    """Arguments that generate a published campaign.

    Args:
        motor: Name in `bench.motors.MOTORS`.
        seed: Seed of the campaign.
        effects: Effects that the nominal model lacks.
        options: Fields of `bench.options.BenchOptions`.
    """

    motor: str
    seed: int
    effects: tuple[EffectRequest, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)

    def make(self) -> Campaign:
        """Generate the campaign, which is the same each time."""
        return make_campaign(self.motor, self.effects, self.seed, **self.options)


RECIPES: dict[str, Recipe] = {
    "paper_motor": Recipe("paper_motor", 2014, options={"rows": 5000}),
    "clean_servo": Recipe("servo_150w", 11, options={"rows": 5000}),
    "brush_drop_servo": Recipe(
        "servo_150w", 23, (EffectRequest("brush_drop", 0.03, "knee"),), {"rows": 5000}
    ),
}


def _sums(folder: Path) -> str:
    """SHA-256 of each file, one line per file, in the format of ``sha256sum``."""
    files = sorted(
        path
        for name in RECIPES
        for path in (folder / name).iterdir()
        if path.suffix in {".csv", ".json"}
    )
    return "".join(
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(folder).as_posix()}\n"
        for path in files
    )


def write_all(folder: Path) -> None:
    """Write every campaign, the checksums and the page that documents them to a folder."""
    campaigns = {name: recipe.make() for name, recipe in RECIPES.items()}
    for name, campaign in campaigns.items():
        campaign.write(folder / name)
    sums = _sums(folder)
    (folder / _SUMS).write_text(sums, encoding="utf-8", newline="\n")
    (folder / "README.md").write_text(data_page(campaigns, sums), encoding="utf-8", newline="\n")


def check(folder: Path) -> list[str]:
    """Generate all campaigns again in a temporary folder and compare the files.

    Returns:
        Names of the files that differ or are missing.
    """
    with tempfile.TemporaryDirectory() as temporary:
        fresh = Path(temporary)
        write_all(fresh)
        made = sorted(path for path in fresh.rglob("*") if path.is_file())
        return [
            path.relative_to(fresh).as_posix()
            for path in made
            if not (folder / path.relative_to(fresh)).is_file()
            or (folder / path.relative_to(fresh)).read_bytes() != path.read_bytes()
        ]


def main(arguments: list[str] | None = None) -> int:
    """Entry point; the exit status is 1 if a check finds a difference."""
    parser = argparse.ArgumentParser(prog="python -m bench.make_data", description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    parser.add_argument("--data", type=Path, default=_DATA, help="folder of the campaigns")
    chosen = parser.parse_args(arguments)
    if not chosen.check:
        write_all(chosen.data)
        return 0
    different = check(chosen.data)
    sys.stdout.writelines(f"{name}: differs\n" for name in different)
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
