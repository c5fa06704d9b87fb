"""Units of ArduPilot's rates, which its versions log in three of them."""

from __future__ import annotations

import numpy as np

from deadtime.logs._contents import LogContents
from deadtime.logs._names import UNITS

#: The units, and the column of the gyroscope that measures about each axis, in rad/s.
RATES = ("rad/s", "deg/s", "cdeg/s")
GYROSCOPE = {"roll": "GyrX", "pitch": "GyrY", "yaw": "GyrZ"}


def unit_of_rate(contents: LogContents, axis: str, topic: str, column: str, otherwise: str) -> str:
    """Unit of a rate, which its firmware logs in rad/s, degrees or hundredths of a degree.

    Logs without units of their own are told apart by the gyroscope, which is in rad/s.
    """
    rate, gyro = contents.topics.get(topic), contents.topics.get("IMU")
    name = GYROSCOPE[axis]
    if rate is None or gyro is None or column not in rate.columns or name not in gyro.columns:
        return otherwise
    with np.errstate(all="ignore"):  # damaged logs hold any number
        ratio = np.nanstd(rate.columns[column]) / np.nanstd(gyro.columns[name])
    if not (np.isfinite(ratio) and ratio > 0.0):
        return otherwise
    factors = {unit: 1.0 / UNITS[unit][1] for unit in RATES}
    return min(factors, key=lambda unit: abs(np.log(ratio / factors[unit])))
