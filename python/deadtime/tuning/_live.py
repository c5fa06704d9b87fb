"""The explorer of a designed loop for a page."""

from __future__ import annotations

from deadtime._base.explorer import Explorer
from deadtime.tuning._result import Design


def live_design(design: Design) -> Explorer | None:
    """The explorer of the designed loop; None where it has no such loop."""
    try:
        return design.explore()
    except ValueError:
        return None
