"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    LOAD_SLACK as LOAD_SLACK,
    Candidates as Candidates,
    FoundGains as FoundGains,
    GainSearch as GainSearch,
    Loop as Loop,
    RobustGains as RobustGains,
    half_rule as half_rule,
    lasting_load as lasting_load,
    noise_gain as noise_gain,
    proved_step as proved_step,
    robust_gains as robust_gains,
    tuning_rules as tuning_rules,
)
