"""What is demanded of a row, as shares of all runs and as widths."""

from __future__ import annotations

import math
from typing import Any

from strangers.rows import Row
from strangers.truth import QUANTITIES

#: Largest share of runs that are reliable and wrong: clean, faulty, and where the plant changes.
WRONG, WRONG_FAULTY, WRONG_MOVING = 45 / 400, 0.16, 0.20

#: The same over all rows of a plant whose plant does not change.
WRONG_POOLED = 0.07

#: Largest median width over that of the right plant, and of each size over that of the clean row.
WIDTH, WIDTHS = 1.6, {"small": 2.0, "large": 4.0}

#: Least share of reliable runs: clean rows of the family, clean rows outside and small faults.
RELIABLE, RELIABLE_ELSEWHERE = 0.90, 0.60

#: Least share of right names where one is given at the large size, and of right sizes among them.
NAMED, SIZED = 0.85, 0.80

#: Causes that are to be named so.
CAUSES = ("play", "dead zone", "unequal limits", "gain ramp", "load")

#: Largest share of false names: clean, and under disturbances.
FALSE, FALSE_DISTURBED = 0.03, 0.10


def missed(row: Row, found: dict[str, Any], clean: dict[str, Any] | None) -> list[str]:
    """The demands that a row misses; widths of faulty rows need the clean row of the plant."""
    runs, out = found["runs"], []
    most = WRONG_FAULTY if row.fault else WRONG
    if row.fault and row.fault.moving:
        most = WRONG_MOVING
    out += [f"wrong {each}" for each in QUANTITIES if found[f"wrong {each}"] > most * runs]
    if row.size != "large":
        least = RELIABLE if row.kind.family and not row.fault else RELIABLE_ELSEWHERE
        out += ["reliable"] if found["reliable"] < least * runs else []
    for each in QUANTITIES:
        width, key = found[f"width {each}"], f"width {each}"
        widest = WIDTH if not row.fault else math.inf
        if row.fault and clean is not None and not math.isnan(clean[key]):
            widest = WIDTHS[row.size] * clean[key]
        out += [key] if width > widest else []
    return out + names_missed(row, found)


def names_missed(row: Row, found: dict[str, Any]) -> list[str]:
    """The demands on names that a row misses."""
    out = []
    if row.size == "large" and row.fault and row.fault.cause in CAUSES:
        out += ["name"] if found["right"] < NAMED * found["named"] else []
        out += ["size"] if found["size right"] < SIZED * found["right"] else []
    most = FALSE_DISTURBED if row.fault else FALSE
    return out + (["false names"] if found["false"] > most * found["runs"] else [])
