"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    LAG_FACTORS as LAG_FACTORS,
    LONGEST_DELAY as LONGEST_DELAY,
    ROUGH as ROUGH,
    SEARCHED_ROWS as SEARCHED_ROWS,
    SHORTEST_LAG as SHORTEST_LAG,
    FamilyCandidate as FamilyCandidate,
    FamilyFit as FamilyFit,
    FlightFit as FlightFit,
    FlightLikelihood as FlightLikelihood,
    FlightPlant as FlightPlant,
    FlightProfile as FlightProfile,
    OnlineBank as OnlineBank,
    PlantNumbers as PlantNumbers,
    RowLikelihood as RowLikelihood,
    RowNoise as RowNoise,
    excited_part as excited_part,
    fit_family as fit_family,
    whitened_columns as whitened_columns,
)
