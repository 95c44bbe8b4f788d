"""Campaigns of the bench simulator in one file, for motorid and for PySINDy.

python -m benchmarks.peers.campaigns out/peers/runs.npz --rows 10000 --effect brush_drop=0.03
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["CHANNELS", "load", "main"]

Array = NDArray[np.float64]

CHANNELS = ("time_s", "voltage_V", "current_A", "speed_rad_s", "temperature_degC")
_TRAINING = 4
PARAMETERS = ("Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L")


def load(path: Path) -> tuple[list[dict[str, Array]], list[dict[str, Array]], Array]:
    """Training runs, validation runs by channel, and the true values (7,)."""
    with np.load(path) as stored:
        runs = [
            dict(zip(CHANNELS, table, strict=True))
            for table in (stored[f"run{k}"] for k in range(int(stored["count"])))
        ]
        return runs[:_TRAINING], runs[_TRAINING:], stored["truth"]


def main() -> None:
    """Record a campaign of four training runs and one validation run."""
    from bench import make_campaign  # noqa: PLC0415  not installed beside the peers

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--rows", type=int, required=True, help="samples of all runs together")
    parser.add_argument("--effect", default="brush_drop=0.03", help="KIND=SIZE, or empty")
    parser.add_argument("--seed", type=int, default=3)
    chosen = parser.parse_args()
    pairs = [word.split("=") for word in chosen.effect.split(",") if word]
    recorded = make_campaign(
        "servo_150w",
        [(kind, float(size)) for kind, size in pairs],
        seed=chosen.seed,
        rows=chosen.rows // (_TRAINING + 1),
        training=_TRAINING,
        validation=1,
    )
    tables = {
        f"run{k}": np.stack([run.frame[name].to_numpy(float) for name in CHANNELS])
        for k, run in enumerate((*recorded.training, *recorded.validation))
    }
    truth = np.array([recorded.motor.parameters[name] for name in PARAMETERS])
    chosen.file.parent.mkdir(parents=True, exist_ok=True)
    tables |= {"count": np.array(len(tables)), "truth": truth}
    np.savez(chosen.file, **tables)  # type: ignore[arg-type]  # no table is named allow_pickle
    print("{}")


if __name__ == "__main__":
    main()
