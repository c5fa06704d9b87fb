"""What is measured: each plant without a fault, and with four that were drawn by lot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from strangers.faults import FAULTS, Fault
from strangers.plants import KINDS, Kind

#: Seed of the lot, and faults of each plant.
LOT, EACH = 20261203, 4

#: Runs of a row without and with a fault.
CLEAN_RUNS, FAULTY_RUNS = 400, 100


@dataclass(frozen=True)
class Row:
    """A plant with one fault in one size, or none."""

    kind: Kind
    fault: Fault | None = None
    size: str = ""

    @property
    def name(self) -> str:
        return f"{self.kind.name}: {self.fault.name if self.fault else 'clean'} {self.size}".strip()

    @property
    def runs(self) -> int:
        return FAULTY_RUNS if self.fault else CLEAN_RUNS


def lot() -> dict[str, list[Fault]]:
    """The faults of each plant."""
    random = np.random.default_rng(LOT)
    out = {}
    for kind in KINDS.values():
        suited = [fault for fault in FAULTS.values() if fault.suits(kind)]
        out[kind.name] = [suited[i] for i in sorted(random.permutation(len(suited))[:EACH])]
    return out


def rows(faults: Mapping[str, Iterable[Fault]] | None = None) -> list[Row]:
    """All rows, those without faults first: with the faults of the lot, or other ones by plant.

    A column is shifted by one row, in no other size.
    """
    found = [Row(kind) for kind in KINDS.values()]
    for name, own in (faults or lot()).items():
        for fault in own:
            sizes = ("large",) if fault.name == "shifted column" else ("small", "large")
            found += [Row(KINDS[name], fault, size) for size in sizes]
    return found


def chosen(texts: Iterable[str]) -> list[Row]:
    """The rows whose name contains one of the texts; all for none.

    A text that no row of the lot contains is looked for in those of all faults.

    Raises
    ------
    ValueError
        If no row contains one.
    """
    by_lot = rows()
    out = [] if (texts := list(texts)) else by_lot
    suited = {k: [f for f in FAULTS.values() if f.suits(kind)] for k, kind in KINDS.items()}
    for text in texts:
        some = [row for row in by_lot if text in row.name]
        some = some or [row for row in rows(suited) if text in row.name]
        if not some:
            raise ValueError(f"no row {text!r}: there are {', '.join(row.name for row in by_lot)}")
        out += [row for row in some if row not in out]
    return sorted(out, key=lambda row: row.fault is not None)
