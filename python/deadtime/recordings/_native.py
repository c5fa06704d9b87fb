"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    csv_columns as csv_columns,
    rate_limited as rate_limited,
)
