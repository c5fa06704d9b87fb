"""The README's Python runs as it stands."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from flights import process_path
from made_processes import bump

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"


def test_the_python_of_the_readme_runs(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 3
    time, valve, level = bump()
    rows = np.column_stack([time, level, valve])
    np.savetxt(tmp_path / "bump.csv", rows, delimiter=",", header="time,PV,OP", comments="")
    result = subprocess.run(
        [sys.executable, "-c", "\n".join(blocks)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("reliable: dead time")
    assert "reliable: PI with Kp" in result.stdout
    assert "neutral" in result.stdout
    assert "-3.31678" in result.stdout


def test_the_first_command_of_the_readme_is_the_demo(tmp_path):
    first = re.search(r"```sh\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert first is not None
    assert first[1].rstrip().endswith("deadtime demo")
    assert run("demo", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_gains_of_the_bump_test_are_those_that_the_command_prints(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    begin = text.index("reliable: PI with Kp")
    shown = [line for line in text[begin : text.index("```", begin)].splitlines() if line.strip()]
    printed = run("tune", str(process_path("bump.csv"))).stdout.splitlines()
    for line in shown:
        start = line.removesuffix("…").removesuffix("...").rstrip()
        assert any(other.startswith(start) for other in printed), line
