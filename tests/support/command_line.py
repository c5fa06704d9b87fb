"""The command `deadtime`, run in this process, because starting a process takes longer."""

import io
import json
import os
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


#: Runs commands one after the other and prints what became of each.
PROGRAM = """
import json, sys

missing, commands = json.loads(sys.argv[1])
if missing:
    sys.modules[missing] = None
from command_line import run

print(json.dumps([vars(run(*one)) for one in commands]))
"""


def run_elsewhere(*commands, missing=None, cwd, timeout=120.0):
    """What became of commands in one process of their own, where a package may be missing."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps([missing, commands])],
        capture_output=True,
        text=True,
        timeout=timeout,
        check=True,
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    return [subprocess.CompletedProcess(**one) for one in json.loads(done.stdout)]


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
