"""The page of a proposal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from deadtime._base.page import page
from deadtime.loops import explorer_of
from deadtime.tuning.proposal._plots import figure_of

if TYPE_CHECKING:
    from deadtime._base.explorer import Explorer
    from deadtime.tuning.proposal._proposal import Proposal

CAPTION = (
    "Predicted under the gains above. The band holds all plants that the recording leaves "
    "possible, and twice the noise that the plant leaves unexplained on either side."
)


def render(proposal: Proposal) -> str:
    """The page as text."""
    settings = proposal.settings
    assert settings is not None
    source = proposal.fit.recording.source or "a recording"
    return page(
        "tuning/proposal/page.html",
        title=f"Gains from {source}",
        described=proposal.fit.headline(),
        verdict=proposal.headline(),
        lines=settings.lines,
        notes=[_rounding(settings.rounding), *settings.notes],
        source=settings.source,
        expected=[*proposal.expected(), *proposal.remarks],
        figure=figure_of(proposal),
        caption=CAPTION,
        explorer=_explored(proposal),
    )


def _rounding(share: float) -> str:
    return f"Rounding to the digits of the form changes no gain by more than {100.0 * share:.2g} %."


def _explored(proposal: Proposal) -> Explorer | None:
    """The explorer of the proposed loop; None where it has no such loop."""
    low, high = proposal.fit.ci(0.95, "delay")
    try:
        return explorer_of(
            proposal.loop.specification, interval=(low, high) if low < high else None
        )
    except ValueError:
        return None
