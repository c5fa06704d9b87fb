"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    csv_columns,
)

__all__ = [
    "csv_columns",
]
