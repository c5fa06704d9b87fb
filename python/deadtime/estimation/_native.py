"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    FlightLikelihood as FlightLikelihood,
    OnlineBank as OnlineBank,
    PlantNumbers as PlantNumbers,
    RowLikelihood as RowLikelihood,
    RowNoise as RowNoise,
    whitened_columns as whitened_columns,
)
