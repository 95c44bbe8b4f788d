"""Catalogue of all effects that the bench can add to a motor, by name."""

from __future__ import annotations

from bench.effects.effect import BenchEffect, Law, RunPlan, Setup
from bench.effects.electrical import ELECTRICAL
from bench.effects.friction import FRICTION
from bench.effects.load import LOAD
from bench.effects.sensor import SENSOR
from bench.effects.thermal import THERMAL
from bench.effects.unlisted import UNLISTED

__all__ = ["EFFECTS", "BenchEffect", "Law", "RunPlan", "Setup"]

EFFECTS: dict[str, BenchEffect] = {
    effect.name: effect for effect in (*FRICTION, *LOAD, *ELECTRICAL, *THERMAL, *SENSOR, *UNLISTED)
}
