"""What is loaded at the start, counted in modules and not in seconds."""

import subprocess
import sys

import pytest

#: What is slow to load and loaded where it is used.
SLOW = (
    "scipy.", "matplotlib.", "pydantic.", "rich.", "typer.", "jinja2.", "control.", "numpy.ma.",
)  # fmt: skip


def loaded(command):
    """Names of the modules that a new interpreter loads besides its own."""
    told = subprocess.run(
        [sys.executable, "-c", f"import sys; before = set(sys.modules); {command}; "
         "print(*sorted(set(sys.modules) - before))"],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return told.stdout.split()


def test_the_package_alone_loads_nothing_else():
    names = loaded("import deadtime")
    assert [name for name in names if name.startswith("deadtime")] == ["deadtime"]
    assert not [name for name in names if f"{name}.".startswith(("numpy.", *SLOW))]


@pytest.mark.parametrize(
    "name", ["ControlLoop", "TransferFunction", "QuasiPolynomial", "stability_map", "solve_dde"]
)
def test_nothing_slow_is_loaded_before_it_is_used(name):
    names = loaded(f"from deadtime import {name}")
    assert not [one for one in names if f"{one}.".startswith(SLOW)]
    # Packages and native module, a few of the standard library: numpy alone loads more.
    own = [one for one in names if one.startswith("deadtime")]
    assert len(own) < 120
    assert len(names) - len(own) < len(loaded("import numpy")) + 60
