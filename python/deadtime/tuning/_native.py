"""The native classes that this package uses."""

from deadtime._deadtime import (
    Candidates as Candidates,
    Family as Family,
    LinearLoop as LinearLoop,
)
