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

warnings.simplefilter("ignore", DeprecationWarning)  # the test forks a process with threads
import deadtime as dtm

child = None
Kp, T = dtm.parameters("Kp T")
family, ranges = dtm.s + Kp * dtm.delay(T), {{"Kp": (0.1, 3.0), "T": (0.1, 0.5)}}


def progress(done):
    global child
    if child is None:
        child = os.fork()
        if child == 0:
            {act}


try:
    # Longer than it takes for progress to be reported.
    shape = (150, 150)
    dtm.stability_map(family, ranges, shape, proof="cells", threads=2, progress=progress)
except BaseException as error:
    if child == 0:
        assert {expected}, repr(error)
        abs(dtm.lambertw([1.0, 2.0], threads=2))  # new threads of its own
        dtm.stability_map(family, ranges, shape=(9, 9))
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
    # It once waited forever for threads that do not exist in the child.
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(act=act, expected=expected)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "ended 7\n"
