"""Optional packages, imported where they are used."""

from __future__ import annotations

import importlib
from typing import Any

from deadtime._base.errors import MissingExtraError


def library(module: str, purpose: str, installs: str) -> Any:
    """Import an optional module for `purpose`; `installs` is what to give pip where it is missing.

    Raises
    ------
    MissingExtraError
        With the line that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{purpose} needs {module.partition('.')[0]}, which is not installed. This "
            f"command installs it: pip install {installs}"
        ) from error
