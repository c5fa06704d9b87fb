"""What a notebook shows of a result: its picture, with its text below."""

from __future__ import annotations

import base64
import html
import io
from typing import TYPE_CHECKING, Any

from deadtime._base.drawing import Figure, new_figure
from deadtime._base.errors import MissingExtraError

#: Dots per inch of a picture; one of 7 by 4 inches takes 20 to 60 kB.
_DOTS = 100

_SHOWN = """<figure style="margin: 0">
<img alt="" src="data:image/png;base64,{picture}" style="max-width: 100%; background: white">
<figcaption><pre>{words}</pre></figcaption>
</figure>"""


class Pictured:
    """Base of results that a notebook shows by a picture.

    Without matplotlib, and for a result without a picture, it shows the text alone.
    """

    if TYPE_CHECKING:
        plot: Any

    def _picture(self) -> Figure | None:
        """A figure of no window; None where there is nothing to draw."""
        figure, axes = new_figure()
        self.plot(axes)
        return figure

    def _repr_html_(self) -> str | None:
        try:
            figure = self._picture()
        except MissingExtraError:
            return None
        if figure is None:
            return None
        data = io.BytesIO()
        figure.savefig(data, format="png", dpi=_DOTS)
        words = getattr(self, "summary", self.__repr__)()
        picture = base64.b64encode(data.getvalue()).decode("ascii")
        return _SHOWN.format(words=html.escape(words), picture=picture)
