"""Results as plain values, for JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

#: Version of what is written as JSON: a new one where a key goes or changes its meaning.
SCHEMA = 1


def json_text(schema: str, found: Mapping[str, Any]) -> str:
    """Values as JSON, the name of their schema first; numbers that are not finite become null."""
    named = {"schema": f"deadtime.{schema}/{SCHEMA}", **found}
    return json.dumps(plain(named), indent=2, ensure_ascii=False, allow_nan=False)


def plain_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Convert the fields of a result, by their names, to types of JSON."""
    return {name: plain(value) for name, value in fields.items()}


def plain(value: Any) -> Any:
    """Convert to types of JSON; numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return {"re": plain(value.real), "im": plain(value.imag)}
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value
