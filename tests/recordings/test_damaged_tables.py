"""Damaged files: no crash, no hang, little memory, and one clear error."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SURVEY = Path(__file__).parents[1] / "support" / "damaged_files.py"

#: The library that reads the format, and how many damaged files are read in the survey.
FORMATS = {
    "text": (None, 2000),
    "mat": (None, 2000),
    "parquet": ("pyarrow", 500),
    "arrow": ("pyarrow", 500),
    "mat73": ("h5py", 500),
}

#: What a reader may take for a file of 4 kB, bytes.
MEMORY = 50_000_000 + 10 * 4096


def survey(kind, count):
    library = FORMATS[kind][0]
    if library:
        pytest.importorskip(library, reason=f"{library} reads such files")
    # A crash would end this process as well.
    done = subprocess.run(
        [sys.executable, str(SURVEY), kind, "--count", str(count), "--seed", "3"],
        capture_output=True, text=True, timeout=1200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["read"] + found["refused"] == count
    assert found["grown"] < MEMORY
    # Most changes are fatal, and some are not: the survey goes beyond the first bytes.
    assert found["read"] > 0.02 * count
    assert found["refused"] > 0.5 * count


@pytest.mark.parametrize("kind", FORMATS)
def test_a_few_damaged_files_are_read_or_refused(kind):
    survey(kind, 60)


@pytest.mark.survey
@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_files_are_read_or_refused(kind):
    survey(kind, FORMATS[kind][1])
