"""Natural scales of a campaign, from its signals and the current fit."""

from __future__ import annotations

import numpy as np

from identification.effects.effect import CampaignScales
from identification.effects.orders import HIGHEST_ORDER, orders_of
from identification.fit.solve import Fit
from identification.model.declared import DECLARED
from identification.model.excitation import sample_interval

__all__ = ["scales_of"]


def scales_of(fit: Fit) -> CampaignScales:
    """Scales of the campaign to which `fit` was fitted."""
    records = fit.simulator.records
    measured = np.concatenate([record.measured for record in records])
    voltage = np.concatenate([record.column("voltage") for record in records])
    size = np.sqrt(np.mean(measured**2, axis=0))
    size = np.where(size > 0, size, 1.0)
    return CampaignScales(
        records=tuple(records),
        current=float(size[0]),
        speed=float(size[1]),
        voltage=float(np.sqrt(np.mean(voltage**2))) or 1.0,
        torque=float(fit.by_name["Kt25"] * size[0]),
        interval=sample_interval(records),
        duration=float(max(record.time[-1] - record.time[0] for record in records)),
        values=fit.values[: len(DECLARED)],
        angle_logged=all(record.angle_logged for record in records),
        orders=orders_of(records, fit.residuals(), HIGHEST_ORDER),
    )
