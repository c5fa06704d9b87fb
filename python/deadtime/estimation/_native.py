"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    FamilyCandidate as FamilyCandidate,
    FamilyFit as FamilyFit,
    FlightLikelihood as FlightLikelihood,
    OnlineBank as OnlineBank,
    PlantNumbers as PlantNumbers,
    RowLikelihood as RowLikelihood,
    RowNoise as RowNoise,
    fit_family as fit_family,
    whitened_columns as whitened_columns,
)
