"""Test bench simulator: motors with hidden effects, recorded as a real bench would log them.

    >>> from bench import make_campaign
    >>> campaign = make_campaign("servo_150w", effects=["coulomb_friction"], seed=3, rows=500)
    >>> list(campaign.training[0].frame.columns)[:3]
    ['time_s', 'voltage_V', 'current_A']

The bench shares no code with the identification that it tests.
"""

from __future__ import annotations

from bench.campaign import BenchRun, Campaign, EffectRequest, make_campaign
from bench.effects import EFFECTS
from bench.motors import MOTORS, Motor, motor, random_motor
from bench.sensors import NOISELESS, Noise

__all__ = [
    "EFFECTS",
    "MOTORS",
    "NOISELESS",
    "BenchRun",
    "Campaign",
    "EffectRequest",
    "Motor",
    "Noise",
    "make_campaign",
    "motor",
    "random_motor",
]
