"""Recordings of real flights, read from a folder beside the project."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "flights"


def flight_path(name):
    path = FOLDER / name
    if not path.exists():
        pytest.skip(f"the recording {name} is not beside the project")
    return path
