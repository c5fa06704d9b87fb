"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    LinearLoop as LinearLoop,
    LoopResponse as LoopResponse,
    MapBoundary as MapBoundary,
    MapCells as MapCells,
    corner_range as corner_range,
    damping_range as damping_range,
    delay_range as delay_range,
    end_of_gain as end_of_gain,
    fixed_step_run as fixed_step_run,
    gain_range as gain_range,
    held_boundaries as held_boundaries,
    held_map as held_map,
    held_response as held_response,
    loop_sensitivities as loop_sensitivities,
    on_samples as on_samples,
    rate_limited as rate_limited,
    sweep_abscissae as sweep_abscissae,
    sweep_decay as sweep_decay,
    sweep_metrics as sweep_metrics,
    sweep_responses as sweep_responses,
)
