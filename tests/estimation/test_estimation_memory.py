"""The memory of every estimation method is proportional to the rows of a recording."""

import tracemalloc

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import Frequency
from deadtime.estimation._estimate import METHODS
from deadtime.estimation._native import arx_losses
from step_recordings import record_step

KNOWN = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), sample_time=0.065, limit=1.0)

#: Bytes per row, about 250 doubles: a square matrix of the rows would take 12 kB per row.
MOST = 2000


def suitable_recording(method, rows):
    """A recording with this many rows that suits a method, and the method with its options."""
    truth = KNOWN.replace(delay=0.36)
    if method == "relay":
        return dtm.Experiment.relay(0.065 * rows, 0.5).run(truth, noise=0.005), KNOWN, method
    if method == "frequency":
        experiment = dtm.Experiment.multisine(0.3, 6.5, lines=8, periods=rows // 100)
        return experiment.run(truth, noise=0.005), KNOWN, Frequency(period=6.5)
    special = {
        "cta": {"Kp": 2.0, "ts": None, "limit": None, "noise_in_loop": False, "dt": 8.0 / rows},
        "decay": {"Kp": 0.6},
        "decrement": {"Kp": 3.0, "limit": None},
    }.get(method, {})
    duration = 7.0 if "dt" in special else 0.065 * rows - 1.0
    recording, known = record_step(noise=0.005, rest=1.0, duration=duration, **special)
    return recording, known, method


def peak(method, rows):
    recording, known, method = suitable_recording(method, rows)
    tracemalloc.start()
    dtm.estimate_delay(recording, known, method=method)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


@pytest.mark.parametrize("method", METHODS)
def test_memory_grows_linearly_with_the_rows(method):
    # A full singular value decomposition would take 20 GB for 50 000 rows, and an ARX scan must
    # not keep one copy of the command for each delay.
    peak(method, 400)  # Modules imported by the first call count only once.
    assert (peak(method, 1600) - peak(method, 400)) / 1200 < MOST


def test_the_losses_of_an_arx_scan_are_those_of_least_squares_at_every_delay():
    random = np.random.default_rng(3)
    command = random.normal(size=400)
    output = np.cumsum(np.concatenate([np.zeros(7), command])[:401]) * 0.1
    output += random.normal(0.0, 0.2, output.size)
    losses, best, none = arx_losses(output, command, (2, 2), (0, 240))
    assert losses.size == 240

    def late(samples):
        return np.concatenate([np.zeros(samples), command])[: output.size]

    past = [np.concatenate([np.zeros(lag), output])[: output.size] for lag in (1, 2)]
    for place in range(0, losses.size, 7):
        columns = np.stack([*past, late(place + 1), late(place + 2)], axis=1)
        left = output - columns @ np.linalg.lstsq(columns, output, rcond=None)[0]
        assert losses[place] == pytest.approx(float(left @ left), rel=1e-7)
    assert best < none
