"""The README's Python runs as it stands."""

import re
import subprocess
import sys
from pathlib import Path

from command_line import run

README = Path(__file__).resolve().parents[2] / "README.md"


def test_the_python_of_the_readme_runs(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 2
    assert run("demo", cwd=tmp_path).returncode == 0
    result = subprocess.run(
        [sys.executable, "-c", "\n".join(blocks)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    assert "neutral" in result.stdout
    assert "-3.3168" in result.stdout or "-3.31678" in result.stdout
