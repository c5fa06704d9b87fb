"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    HeldPlane as HeldPlane,
    LinearLoop as LinearLoop,
    Loop as Loop,
    LoopResponse as LoopResponse,
    MapBoundary as MapBoundary,
    MapCells as MapCells,
    SampledCells as SampledCells,
    canonical_form as canonical_form,
    corner_range as corner_range,
    damping_range as damping_range,
    delay_range as delay_range,
    end_of_gain as end_of_gain,
    feedback_polynomials as feedback_polynomials,
    gain_range as gain_range,
    held_response as held_response,
    on_samples as on_samples,
    plant_polynomials as plant_polynomials,
    rate_limited as rate_limited,
    sampled_abscissa_grid as sampled_abscissa_grid,
    sampled_filter as sampled_filter,
)
