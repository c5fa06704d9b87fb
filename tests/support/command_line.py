"""The command `deadtime`, run in this process, because starting a process takes longer."""

import io
import json
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from unittest.mock import patch

from deadtime._cli.app import run as run_command


def run(*arguments, cwd="."):
    """Exit code and output of a command; `test_cli_failures` runs real processes."""
    command = ["deadtime", *map(str, arguments)]
    out, err = io.StringIO(), io.StringIO()
    with (
        chdir(cwd),
        patch.object(sys, "argv", command),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            run_command()
            code = 0
        except SystemExit as ended:
            code = ended.code or 0
    return subprocess.CompletedProcess(command, code, out.getvalue(), err.getvalue())


def found(*arguments, cwd="."):
    """The output of a command with `--json`."""
    result = run(*arguments, "--json", cwd=cwd)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def one_clear_line(result):
    """The standard error of a command that failed: not empty, and no traceback."""
    assert result.returncode not in (0, None)
    assert "Traceback" not in result.stderr
    assert result.stderr.strip(), "nothing was said"
    assert result.stdout == ""
    return result.stderr.strip()
