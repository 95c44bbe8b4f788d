"""Effects outside the catalogue of the identification: negative controls for false claims.

These effects must never enter that catalogue, or the test for false claims would test nothing.
"""

from __future__ import annotations

from bench.effects.effect import BenchEffect, Law, Setup

__all__ = ["UNLISTED"]


def _rub(power: float) -> Law:
    """Friction of a part that expands and rubs above a speed w_0.

    The torque is T ((|w| - w_0)/(w_r - w_0))^n sign(w), with the rated speed w_r.
    """

    def law(setup: Setup, size: float) -> dict[str, float]:
        speed = setup.rng.uniform(0.3, 0.5) * setup.motor.rated_speed
        torque = size * setup.motor.rated_torque
        setup.plant["rub"], setup.plant["rub_speed"] = torque, speed
        setup.plant["rub_power"] = power
        return {"torque_at_rated_speed": torque, "from_speed": speed, "power": power}

    return law


def _ripple(second: bool, square: bool) -> Law:
    """Load torque of a fixed frequency in time: a pump or a mill on the same frame."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        slow = setup.motor.time_constants[1]
        frequency = setup.rng.uniform(0.05, 0.25) / slow
        torque = size * setup.motor.rated_torque
        setup.plant["ripple"], setup.plant["ripple_frequency"] = torque, frequency
        setup.plant["ripple_frequency_2"] = 2.7 * frequency if second else 0.0
        setup.plant["ripple_square"] = float(square)
        return {"torque": torque, "frequency_hz": frequency}

    return law


def _load_friction(power: float) -> Law:
    """Dry friction that grows with the transmitted torque, as in a worm gear."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        setup.plant["load_friction"] = size
        setup.plant["load_friction_power"] = power
        return {"coefficient": size, "power": power}

    return law


def _bristle(static: float) -> Law:
    """LuGre friction: bristles bend before they slide, so friction lags a reversal by an angle."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        motor = setup.motor
        level = size * motor.rated_torque
        reach = motor.rated_speed * motor.time_constants[1]
        setup.plant["bristle_level"] = level
        setup.plant["bristle_deflection"] = setup.rng.uniform(0.03, 0.1) * reach
        setup.plant["bristle_static"] = static
        return {"level": level, "deflection": float(setup.plant["bristle_deflection"])}

    return law


def _run_in(field: str) -> Law:
    """Running-in of new bearings: friction that decays over the running time of the campaign."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        total = sum(run.duration for run in setup.runs)
        setup.plant[field] = size * setup.motor.rated_torque
        setup.plant["run_in_time"] = 0.35 * total
        elapsed = 0.0
        for run in setup.runs:
            run.overrides["elapsed_before"] = elapsed
            elapsed += run.duration
        return {"torque": float(setup.plant[field]), "time": 0.35 * total}

    return law


def _square_loss(power: float) -> Law:
    """Voltage loss with a power of the current: a poor contact that heats at once."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        setup.plant["square_loss"] = size * setup.motor.rated_voltage
        setup.plant["square_loss_power"] = power
        return {"voltage_at_rated_current": size * setup.motor.rated_voltage, "power": power}

    return law


def _dead_zone(width: float) -> Law:
    """Dead zone of the drive at small voltages, with a hard or a soft edge."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        voltage = size * setup.motor.rated_voltage
        setup.plant["dead_zone"] = voltage
        setup.plant["dead_zone_width"] = width * voltage
        return {"voltage": voltage, "width": width * voltage}

    return law


def _backlash(angle: float) -> Law:
    """Half of the inertia behind a gear with backlash.

    The gap is 10 size angle w_r tau [rad], where w_r tau is the angle turned at rated speed within
    the slow time constant.
    """

    def law(setup: Setup, size: float) -> dict[str, float]:
        motor, share = setup.motor, 0.5
        load = share * motor.J
        reduced = load * (1.0 - share)
        resonance = 1.2 / motor.sample_interval
        gap = 10.0 * size * angle * motor.rated_speed * motor.time_constants[1]
        setup.plant["load_inertia"] = load
        setup.plant["shaft_stiffness"] = reduced * resonance**2
        setup.plant["shaft_damping"] = 0.6 * resonance * reduced
        setup.plant["shaft_backlash"] = gap
        return {"load_inertia": load, "backlash_rad": gap}

    return law


def _commutation(power: float) -> Law:
    """Voltage loss with current times a power of speed: slow commutation."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        voltage = size * setup.motor.rated_voltage
        setup.plant["commutation_loss"] = voltage
        setup.plant["commutation_power"] = power
        return {"voltage_at_rated": voltage, "power": power}

    return law


def _hum(drift: float) -> Law:
    """Supply hum downstream of the voltage sensor; its frequency may drift."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        frequency = setup.rng.uniform(0.05, 0.3) / setup.motor.time_constants[1]
        setup.plant["hum"] = size * setup.motor.rated_voltage
        setup.plant["hum_frequency"] = frequency
        setup.plant["hum_drift"] = drift * frequency / setup.duration
        return {
            "voltage": size * setup.motor.rated_voltage,
            "frequency_hz": frequency,
            "drift_hz_per_s": float(setup.plant["hum_drift"]),
        }

    return law


def _hot_friction(power: float) -> Law:
    """Dry friction that grows with temperature: a bearing that loses its clearance."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        setup.plant["hot_friction"] = size * setup.motor.rated_torque
        setup.plant["hot_friction_power"] = power
        return {"torque_at_100_degC": size * setup.motor.rated_torque, "power": power}

    return law


def _angle_rub(width: float) -> Law:
    """Dry friction in one sector of a revolution: a bent shaft that touches."""

    def law(setup: Setup, size: float) -> dict[str, float]:
        setup.plant["angle_rub"] = size * setup.motor.rated_torque
        setup.plant["angle_rub_width"] = width
        setup.plant["angle_rub_at"] = setup.rng.uniform(0.0, 6.28)
        return {"torque": size * setup.motor.rated_torque, "width": width}

    return law


def _unlisted(
    name: str, equation: str, drivers: tuple[str, ...], means: str, laws: dict[str, Law]
) -> BenchEffect:
    return BenchEffect(name, equation, drivers, means, (0.03, 0.2), laws, is_listed=False)


UNLISTED = (
    _unlisted("rub_above_speed", "mechanical", ("speed",), "rated torque at rated speed",
              {"linear": _rub(1.0), "square": _rub(2.0)}),
    _unlisted("time_ripple", "mechanical", ("time",), "rated torque",
              {"sine": _ripple(False, False), "two_sines": _ripple(True, False),
               "square": _ripple(False, True)}),
    _unlisted("load_dependent_friction", "mechanical", ("current", "speed"),
              "rated torque at rated torque",
              {"linear": _load_friction(1.0), "square": _load_friction(2.0)}),
    _unlisted("bristle_friction", "mechanical", ("speed",), "rated torque",
              {"plain": _bristle(0.0), "stiction": _bristle(0.4)}),
    _unlisted("run_in", "mechanical", ("time", "speed"), "rated torque at rated speed",
              {"viscous": _run_in("run_in_viscous"), "dry": _run_in("run_in_dry")}),
    _unlisted("square_voltage_loss", "electrical", ("current",), "rated voltage at rated current",
              {"square": _square_loss(2.0), "power_2.5": _square_loss(2.5)}),
    _unlisted("dead_zone", "electrical", ("voltage",), "rated voltage",
              {"hard": _dead_zone(0.0), "soft": _dead_zone(1.0)}),
    _unlisted("backlash", "mechanical", ("speed", "position"), "ten times the angle of a start",
              {"play": _backlash(0.1), "more_play": _backlash(0.3)}),
    _unlisted("commutation_loss", "electrical", ("current", "speed"),
              "rated voltage at rated current and speed",
              {"linear": _commutation(1.0), "square": _commutation(2.0)}),
    _unlisted("supply_hum", "electrical", ("time",), "rated voltage", 
              {"sine": _hum(0.0), "drifting": _hum(0.2)}),
    _unlisted("hot_friction", "mechanical", ("temperature", "speed"), "rated torque at 100 degC",
              {"linear": _hot_friction(1.0), "square": _hot_friction(2.0)}),
    _unlisted("angle_rub", "mechanical", ("position", "speed"), "rated torque",
              {"narrow": _angle_rub(0.3), "broad": _angle_rub(0.6)}),
)  # fmt: skip
