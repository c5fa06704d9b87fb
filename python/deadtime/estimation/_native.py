"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    FlightLikelihood,
    OnlineBank,
    PlantNumbers,
    RowLikelihood,
    RowNoise,
    whitened_columns,
)

__all__ = [
    "FlightLikelihood",
    "OnlineBank",
    "PlantNumbers",
    "RowLikelihood",
    "RowNoise",
    "whitened_columns",
]
