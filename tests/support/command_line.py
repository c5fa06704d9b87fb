"""The command `deadtime`, run in this process: starting one costs more than most of them take."""

import io
import json
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from unittest.mock import patch

from deadtime._cli.app import run as run_command


def run(*arguments, cwd="."):
    """What a process of its own would end with; the real ones are in `test_cli_failures`."""
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
    """What a command says with `--json`."""
    result = run(*arguments, "--json", cwd=cwd)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def one_clear_line(result):
    """What a command that failed says on standard error: something, and no traceback."""
    assert result.returncode not in (0, None)
    assert "Traceback" not in result.stderr
    assert result.stderr.strip(), "nothing was said"
    assert result.stdout == ""
    return result.stderr.strip()
