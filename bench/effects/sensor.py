"""Sensor and logging errors: offsets, delays, low-pass filters, wrong inter-sample hold."""

from __future__ import annotations

from bench.effects.effect import BenchEffect, Law, Setup

__all__ = ["SENSOR"]

_RATED = {"current": "rated_current", "voltage": "rated_voltage", "speed": "rated_speed"}


def _offset(channel: str, drift: float) -> Law:
    """Offset of a channel; with drift, it varies from run to run about its mean."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        offset = setup.sign * size * getattr(setup.motor, _RATED[channel])
        setup.offsets[channel] = offset
        last = max(len(setup.runs) - 1, 1)
        for number, run in enumerate(setup.runs):
            run.offset_scale = 1.0 + drift * (2.0 * number / last - 1.0)
        return {"offset": offset, "drift": drift}

    return law


def _offset_effect(channel: str) -> BenchEffect:
    return BenchEffect(
        f"{channel}_offset", "sensor", (), f"rated {channel}", (0.003, 0.05),
        {"constant": _offset(channel, 0.0), "drifting": _offset(channel, 0.1)},
    )  # fmt: skip


def _delay(channel: str) -> Law:
    """Delay of one channel."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        time = 10.0 * size * setup.motor.sample_interval
        setup.delays[channel] = time
        return {"time": time, "samples": 10.0 * size}

    return law


def _filter(channel: str, order: int) -> Law:
    """First-order or Butterworth low-pass filter of equal delay at low frequency."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        time = 10.0 * size * setup.motor.sample_interval / (1.0 if order == 1 else 2.0**0.5)
        setup.plant[f"{channel}_filter"] = time
        setup.plant[f"{channel}_filter_order"] = float(order)
        return {"time": time, "order": float(order)}

    return law


def _difference(setup: Setup, size: float) -> dict[str, float]:
    """Speed from the difference of the angle over a window: a moving average of equal delay."""
    setup.difference_time = 20.0 * size * setup.motor.sample_interval
    return {"window": setup.difference_time}


def _other_hold(setup: Setup, size: float) -> dict[str, float]:
    """FOH where ZOH is declared, and vice versa."""
    del size
    setup.is_linear = not setup.is_linear
    return {"is_linear": float(setup.is_linear)}


SENSOR = (
    _offset_effect("current"),
    _offset_effect("voltage"),
    _offset_effect("speed"),
    BenchEffect(
        "channel_delay", "sensor", ("time",), "ten sample intervals", (0.03, 0.3),
        {"speed": _delay("speed"), "current": _delay("current"), "voltage": _delay("voltage")},
    ),
    BenchEffect(
        "speed_filter", "sensor", ("speed",), "a time constant of ten sample intervals",
        (0.03, 0.4),
        {
            "one_pole": _filter("speed", 1),
            "butterworth": _filter("speed", 2),
            "difference": _difference,
        },
    ),
    BenchEffect(
        "current_filter", "sensor", ("current",), "a time constant of ten sample intervals",
        (0.03, 0.4), {"one_pole": _filter("current", 1), "butterworth": _filter("current", 2)},
    ),
    BenchEffect(
        "input_hold", "sensor", ("voltage",), "nothing: it is there or it is not", (1.0, 1.0),
        {"other": _other_hold},
    ),
)  # fmt: skip
