"""Gains in the forms that people type in."""

from deadtime.tuning.forms._betaflight import (
    BIQUAD as BIQUAD,
    PT1 as PT1,
    PT2 as PT2,
    PT3 as PT3,
    pole_in_row as pole_in_row,
)
from deadtime.tuning.forms._classical import IdealForm, ParallelForm, SeriesForm, proportional_band
from deadtime.tuning.forms._convert import (
    LOOPS_OF_FORMS as LOOPS_OF_FORMS,
    Form,
    check_form as check_form,
    controller_of,
    settings_of,
)
from deadtime.tuning.forms._settings import Settings, one_pole_filter

__all__ = [
    "Form",
    "IdealForm",
    "ParallelForm",
    "SeriesForm",
    "Settings",
    "controller_of",
    "one_pole_filter",
    "proportional_band",
    "settings_of",
]
