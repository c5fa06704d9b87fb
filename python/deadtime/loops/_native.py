"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    DeviationFigures as DeviationFigures,
    HeldPlane as HeldPlane,
    LinearLoop as LinearLoop,
    Loop as Loop,
    LoopResponse as LoopResponse,
    MapBoundary as MapBoundary,
    MapCells as MapCells,
    canonical_form as canonical_form,
    deviation_figures as deviation_figures,
    driven_loop as driven_loop,
    feedback_polynomials as feedback_polynomials,
    held_response as held_response,
    on_samples as on_samples,
    plant_polynomials as plant_polynomials,
    rate_limited as rate_limited,
    sampled_filter as sampled_filter,
    sweep_deviations as sweep_deviations,
)
