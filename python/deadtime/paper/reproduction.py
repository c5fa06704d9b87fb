"""`reproduce`: compute all tables and figures, and count the verdicts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from deadtime._base.drawing import Figure
from deadtime._base.progress import Stages, stage_report
from deadtime.paper.comparison import Comparison, Verdict
from deadtime.paper.figure2 import figure2
from deadtime.paper.figure3 import figure3
from deadtime.paper.figure10 import figure10
from deadtime.paper.figure11 import figure11
from deadtime.paper.figures6and7 import figure6, figure7
from deadtime.paper.figures8and9 import figure8, figure9
from deadtime.paper.gap import gap
from deadtime.paper.part import Part
from deadtime.paper.table1 import table1
from deadtime.paper.table2 import table2

#: The parts, in the order of the paper.
_IN_ORDER: tuple[Callable[[], Part], ...] = (
    *(table1, figure2, figure3, table2, figure6, figure7),
    *(gap, figure8, figure9, figure10, figure11),
)
PARTS: Mapping[str, Callable[[], Part]] = {part.__name__: part for part in _IN_ORDER}

TITLES: Mapping[str, str] = {
    "table1": "Table 1: delays of the Internet loop from its overshoots",
    "figure2": "Figure 2: the Internet loop, simulated and over a network",
    "figure3": "Figure 3: the critical gain at Td = 0.1 s",
    "table2": "Table 2: overshoot of the altitude loop",
    "figure6": "Figure 6: simulated altitude",
    "figure7": "Figure 7: the flights under proportional control",
    "gap": "0.3682 s and 0.3598 s: why the estimates differ",
    "figure8": "Figure 8: Kp = 4 and 5 at Td = 0.36 s, responses",
    "figure9": "Figure 9: Kp = 4 and 5 at Td = 0.36 s, roots",
    "figure10": "Figure 10: the rightmost root over the velocity gain",
    "figure11": "Figure 11: the flights under proportional-plus-velocity control",
}


@dataclass(frozen=True)
class Reproduction:
    """Parts of the paper, reproduced.

    Attributes
    ----------
    parts : mapping of str to object
        Results of the functions of this package, by their names.
    """

    parts: Mapping[str, Part]

    @property
    def comparisons(self) -> tuple[Comparison, ...]:
        """Every printed number beside the computed one, in the order of the paper."""
        return tuple(comparison for part in self.parts.values() for comparison in part.comparisons)

    def counts(self) -> dict[Verdict, int]:
        """Number of each verdict.

        Returns
        -------
        dict of Verdict to int
        """
        given = Counter(comparison.verdict for comparison in self.comparisons)
        return {verdict: given[verdict] for verdict in Verdict}

    def summary(self) -> str:
        """The verdicts in one sentence.

        Returns
        -------
        str
        """
        counts = self.counts()
        numbers = (Verdict.EXACT, Verdict.PARTLY, Verdict.DIFFERENT)
        statements = (Verdict.CONFIRMED, Verdict.CONTRADICTED)
        return (
            f"{sum(counts[kind] for kind in numbers)} printed numbers: {counts[Verdict.EXACT]} "
            f"reproduced to every digit, {counts[Verdict.PARTLY]} to fewer digits, "
            f"{counts[Verdict.DIFFERENT]} not. {sum(counts[kind] for kind in statements)} "
            f"statements: {counts[Verdict.CONFIRMED]} were confirmed, "
            f"{counts[Verdict.CONTRADICTED]} not supported. {counts[Verdict.MEASURED]} "
            "measurements cannot be compared."
        )

    def to_dict(self) -> dict[str, Any]:
        """The reproduction as plain values.

        Returns
        -------
        dict of str to object
        """
        return {
            "summary": self.summary(),
            "counts": {verdict.name.lower(): count for verdict, count in self.counts().items()},
            "parts": {
                name: {
                    "title": TITLES[name],
                    "comparisons": [comparison.to_dict() for comparison in part.comparisons],
                    "tables": [
                        {"title": grid.title, "heads": grid.heads, "rows": grid.rows}
                        for grid in part.grids()
                    ],
                    "findings": part.findings(),
                }
                for name, part in self.parts.items()
            },
        }

    def figures(self) -> dict[str, Figure]:
        """Draw the figures of the computed parts.

        Returns
        -------
        dict of str to matplotlib.figure.Figure

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        from deadtime.paper._plots import draw

        return {name: figure for name, part in self.parts.items() if (figure := draw(part))}


def reproduce(only: Iterable[str] | None = None, progress: Stages = False) -> Reproduction:
    """Reproduce the tables and figures of the paper.

    Parameters
    ----------
    only : iterable of str, optional
        Names of parts; all by default.
    progress : bool or callable
        Called with the title of each part before it is computed; True prints it on stderr.

    Returns
    -------
    Reproduction

    Raises
    ------
    ValueError
        If a part does not exist, or `only` is empty.

    Examples
    --------
    >>> from deadtime import paper
    >>> found = paper.reproduce(only=["table2", "gap"])
    >>> print(found.summary().split(".")[0])
    19 printed numbers: 19 reproduced to every digit, 0 to fewer digits, 0 not
    """
    report = stage_report(progress)
    names = list(PARTS) if only is None else list(dict.fromkeys(only))
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        raise ValueError(
            f"{', '.join(unknown)} cannot be reproduced: give some of {', '.join(PARTS)}"
        )
    if not names:
        raise ValueError(f"only is empty: give one or more of {', '.join(PARTS)}")
    parts = {}
    for name in PARTS:
        if name in names:
            report(TITLES[name])
            parts[name] = PARTS[name]()
    return Reproduction(parts)
