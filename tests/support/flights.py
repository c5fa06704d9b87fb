"""Recordings of real flights and of processes, read from a folder beside the project."""

from pathlib import Path

import pytest

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def flight_path(name):
    return _path("flights", name)


def process_path(name):
    return _path("process", name)


def _path(kind, name):
    path = DATA / kind / name
    if not path.exists():
        pytest.skip(f"the recording {name} is not beside the project")
    return path
