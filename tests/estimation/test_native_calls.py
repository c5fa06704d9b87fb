"""A fit is few calls of the kernel, not one for each step of a search."""

import sys

import deadtime as dtm
from deadtime.estimation import OutputError
from step_recordings import record_step


def test_a_fit_of_a_named_plant_is_a_few_native_calls():
    recording, loop = record_step(0.31, 0.85, noise=0.005, seed=3)
    called = []

    def note(_, event, function):
        owner = type(getattr(function, "__self__", None)).__module__
        if event == "c_call" and "deadtime._deadtime" in (owner, function.__module__):
            called.append(function.__name__)

    sys.setprofile(note)
    try:
        alone = OutputError(rivals=False)
        fit = dtm.estimate_delay(recording, loop.replace(delay=None), method=alone)
    finally:
        sys.setprofile(None)
    assert fit.method == "output_error"
    # Least squares, noise, profile, interval, tests, what would have been seen; and rows.
    assert len(called) <= 16, called
