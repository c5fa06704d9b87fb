"""Estimate on every row, and print how often answers are reliable, wrong, wide and named."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from reality.table import cells, pool_of, titles

from strangers.demands import WRONG_POOLED, missed
from strangers.estimates import Estimate, estimates
from strangers.rows import Row
from strangers.sizes import size_of
from strangers.truth import QUANTITIES

#: Largest error of a named size, relative.
SIZE_ERROR = 0.25

#: Runs that a process makes at once.
BATCH = 10

#: Causes that are one name, for stiction of every size and for small play.
ALIKE = {"play", "stiction"}

#: Names of the one limit that is nearer.
LIMITS = {"unequal limits", "lower limit"}

#: Names of a limit of the acceleration.
SLOPES = {"slope limit", "rate limit"}

#: Faults that are none of the plant, in which a name is a false one.
DISTURBANCES = ("wind", "wave", "drift")


def summary(row: Row, found: Sequence[Estimate]) -> dict[str, Any]:
    """The numbers of a row: counts, and medians over the reliable answers."""
    verdicts = Counter(one.verdict for one in found)
    reliable = [one for one in found if one.reliable]
    out: dict[str, Any] = {"row": row.name, "runs": len(found)}
    out |= {name: verdicts[name] for name in ("reliable", "indication", "none", "failed")}
    for quantity in QUANTITIES:
        out[f"wrong {quantity}"] = sum(one.wrong(quantity) for one in found)
        widths = [one.width(quantity) for one in reliable]
        out[f"width {quantity}"] = float(np.nanmedian(widths)) if widths else math.nan
    return out | names(row, found) | {"seconds": sum(one.seconds for one in found) / len(found)}


def names(row: Row, found: Sequence[Estimate]) -> dict[str, Any]:
    """Runs that name one cause, the right one, its size; and those that leave it among others."""
    # A limit that the plant has is no fault.
    own = SLOPES if "acceleration" in row.kind.numbers else set()
    found = [
        replace(one, causes=[cause for cause in one.causes if cause["name"] not in own])
        for one in found
    ]
    naming = [one for one in found if one.causes]
    out = dict.fromkeys(("named", "right", "size right", "either", "false"), 0)
    if row.fault is None or row.fault.name in DISTURBANCES:
        return out | {"false": len(naming)}
    for one in naming:
        cause = one.causes[0]
        called, right = {cause["name"], *cause["others"]}, accepted(row)
        if not (len(called) == 1 or called <= right):
            out["either"] += bool(called & right)
            continue
        out["named"] += 1
        if called <= right:
            out["right"] += 1
            out["size right"] += abs(abs(cause["size"]) - one.size) <= SIZE_ERROR * one.size
    return out


def accepted(row: Row) -> set[str]:
    """The names that are right for the fault of a row."""
    if row.fault is None or not row.fault.cause:
        return set()
    if row.fault.name == "stiction" or (row.fault.name == "play" and row.size == "small"):
        return ALIKE
    return LIMITS if row.fault.name == "unequal limits" else {row.fault.cause}


#: Title, key, width and digits of each column, by groups.
COLUMNS: dict[str, list[tuple[str, str, int, int]]] = {
    "verdict:": [
        ("runs", "runs", 6, 0),
        ("reliable", "reliable", 9, 0),
        ("indic.", "indication", 7, 0),
        ("none", "none", 5, 0),
        ("failed", "failed", 7, 0),
    ],
    "reliable and wrong:": [
        ("gain", "wrong gain", 8, 0),
        ("delay", "wrong delay", 6, 0),
        ("largest", "wrong largest gain", 8, 0),
    ],
    "width over right plant's:": [
        ("gain", "width gain", 12, 2),
        ("delay", "width delay", 7, 2),
        ("largest", "width largest gain", 8, 2),
    ],
    "causes:": [
        ("named", "named", 8, 0),
        ("right", "right", 6, 0),
        ("size", "size right", 5, 0),
        ("either", "either", 7, 0),
        ("false", "false", 6, 0),
    ],
    " ": [("s", "seconds", 6, 1)],
}


def header() -> str:
    """Two lines: the groups, and the columns."""
    return f"{titles(COLUMNS, '', 38)}  misses"


def line(row: dict[str, Any]) -> str:
    """A row of the table."""
    text = f"{row['row']:38}{cells(COLUMNS, row)}"
    return f"{text}  {', '.join(row['missed'])}".rstrip()


def pooled(rows: Sequence[Row], found: Sequence[dict[str, Any]]) -> list[str]:
    """Of each plant, the share of all runs that are wrong; without rows whose plant changes."""
    out = []
    for kind in dict.fromkeys(row.kind.name for row in rows):
        some = [
            one
            for row, one in zip(rows, found, strict=True)
            if row.kind.name == kind and not (row.fault and row.fault.moving)
        ]
        runs = sum(one["runs"] for one in some)
        if runs:
            shares = [100.0 * sum(one[f"wrong {q}"] for one in some) / runs for q in QUANTITIES]
            text = ", ".join(f"{q} {s:.1f}" for q, s in zip(QUANTITIES, shares, strict=True))
            misses = "; misses" if max(shares) > 100.0 * WRONG_POOLED else ""
            out.append(f"{kind:38}{runs:6d} runs, reliable and wrong in %: {text}{misses}")
    return out


def print_strangers(
    rows: list[Row], runs: int | None, seed: int, processes: int, file: Path | None
) -> None:
    """Measure and print, in batches on all processes; write every estimate to `file`."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")  # the processes are enough
    pool = pool_of(processes)
    everything: list[Estimate] = []
    found: list[dict[str, Any]] = []
    clean: dict[str, dict[str, Any]] = {}
    begin = time.perf_counter()
    try:
        waiting = []
        for row in rows:
            noted(f"size of {row.name}")
            size = size_of(row.kind, row.fault, row.size)["size"] if row.fault else 0.0
            number = row.runs if runs is None else runs
            batches = [range(i, min(i + BATCH, number)) for i in range(0, number, BATCH)]
            waiting.append([pool.submit(estimates, row, size, seed, batch) for batch in batches])
        print(header())
        for row, parts in zip(rows, waiting, strict=True):
            own = collected(row, parts)
            everything += own
            found.append(summary(row, own))
            if row.fault is None:
                clean[row.kind.name] = found[-1]
            found[-1]["missed"] = missed(row, found[-1], clean.get(row.kind.name))
            print(line(found[-1]), flush=True)
        print(*pooled(rows, found), f"{time.perf_counter() - begin:.0f} s", sep="\n")
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    finally:
        pool.shutdown(cancel_futures=True)
        if file is not None:
            plain = finite([one.as_plain() for one in everything])
            file.write_text(json.dumps(plain, indent=1) + "\n", encoding="utf-8")


def collected(row: Row, parts: list[Future[list[Estimate]]]) -> list[Estimate]:
    """Estimates of all parts, with the progress on a terminal."""
    found: list[Estimate] = []
    for i, part in enumerate(parts):
        noted(f"{row.name}: {i}/{len(parts)}")
        found += part.result()
    return found


def noted(text: str) -> None:
    """Say on a terminal what is being done."""
    if sys.stderr.isatty():
        print(f"\r{text}\x1b[K\r", end="", file=sys.stderr, flush=True)


def finite(value: Any) -> Any:
    """The same with None for numbers that are not finite, which JSON does not have."""
    if isinstance(value, dict):
        return {name: finite(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
