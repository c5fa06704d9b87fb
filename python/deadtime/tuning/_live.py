"""The part of a page in which a designed loop is looked at live."""

from __future__ import annotations

from deadtime.tuning._result import Design


def live_section(design: Design) -> list[str]:
    """Heading and explorer of the designed loop; nothing where the explorer has no such loop."""
    try:
        frame = design.explore().frame
    except ValueError:
        return []
    return ["<h2>The designed loop, live</h2>", frame]
