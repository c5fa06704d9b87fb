"""Estimates do not depend on the unit of the output."""

import deadtime as dtm
import pytest
from step_recordings import record_step

#: Recordings that each method can read.
CASES = {
    "output_error": {},
    "waveform": {},
    "grid": {},
    "graphical": {},
    "cta": {"ts": None, "dt": 0.02, "limit": None},
    "decay": {"Kp": 0.5, "duration": 12.0},
}


@pytest.mark.parametrize("method", CASES)
@pytest.mark.parametrize("exponent", [-60, -30, 30])
def test_a_delay_is_the_same_in_every_unit(method, exponent):
    # A tolerance in the unit of the output ended the searches early for outputs of 1e-7 and less.
    unit = 2.0**exponent  # every digit stays
    recording, loop = record_step(noise=0.002, **CASES[method])
    signals = (recording.reference, recording.output, recording.command)
    scaled = dtm.Recording(recording.time, *(unit * signal for signal in signals))
    plain = dtm.estimate_delay(recording, loop, method=method)
    limit = None if loop.limit is None else unit * loop.limit
    fit = dtm.estimate_delay(scaled, loop.replace(limit=limit), method=method)
    assert fit.delay == pytest.approx(plain.delay, abs=1e-6)
    if plain.calibrated:
        assert fit.ci() == pytest.approx(plain.ci(), abs=1e-5)
