"""A child that is forked while a kernel runs can compute and ends normally."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a fork")

PROGRAM = """
import os
import sys
import warnings

warnings.simplefilter("ignore", DeprecationWarning)  # forking with threads about is what is tested
import deadtime as dtm
from deadtime import _deadtime

child = None


def progress(done):
    global child
    if child is None:
        child = os.fork()
        if child == 0:
            {act}


try:
    _deadtime.spin(0.3, 2, progress)
except BaseException as error:
    if child == 0:
        assert {expected}, repr(error)
        abs(dtm.lambertw([1.0, 2.0], threads=2))  # new threads of its own
        Kp, T = dtm.parameters("Kp T")
        ranges = {{"Kp": (0.1, 3.0), "T": (0.1, 0.5)}}
        dtm.stability_map(dtm.s + Kp * dtm.delay(T), ranges, shape=(9, 9))
        os._exit(7)
    raise
assert child > 0
ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
print("ended", ended)
"""


@pytest.mark.parametrize(
    ("act", "expected"),
    [
        ("pass", "'forked' in str(error)"),
        ("sys.exit(3)", "isinstance(error, SystemExit)"),
        ("dtm.lambertw([1.0]); raise OSError('own')", "isinstance(error, OSError)"),
    ],
)
def test_a_child_forked_in_a_progress_function_does_not_hang(act, expected):
    # It waited for ever for threads that a fork does not take along.
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(act=act, expected=expected)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "ended 7\n"
