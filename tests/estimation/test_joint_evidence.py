"""Several recordings of one plant without a loop: common numbers, own start, level and noise."""

import deadtime as dtm
import made_records as made
import numpy as np
import pytest
from deadtime.estimation import _native
from family_survey import fit, holds
from flights import flight_path
from made_processes import DEAD, GAIN, SLOW, bump


def recordings(noises=(0.1, 0.4)):
    out = []
    for seed, noise in enumerate(noises):
        time, command, output = bump(seed, rows=250, noise=noise)
        # Another clock, another level.
        out.append(dtm.Recording(time + 50.0 * seed, None, output + 10.0 * (seed + 1), command))
    return out


@pytest.fixture(scope="module")
def together():
    return dtm.estimate_delay(recordings())


def test_the_numbers_are_those_of_one_plant(together):
    assert (together.verdict, together.best.name) == ("reliable", "lag")
    for name, truth in (("delay", DEAD), ("gain", GAIN), ("lag", SLOW)):
        low, high = together.ci(0.999, name)
        assert low < truth < high


def test_each_recording_has_its_own_noise_and_residuals(together):
    assert len(together.runs) == 2
    for run, noise, recording in zip(together.runs, (0.1, 0.4), recordings(), strict=True):
        assert run.noise_std == pytest.approx(noise, rel=0.15)
        np.testing.assert_allclose(run.fitted + run.residuals, recording.output, rtol=1e-12)
    words = together.summary()
    assert "of recording 1" in words
    assert "of recording 2" in words


def test_a_second_recording_makes_intervals_narrower(together):
    shares = []
    for recording in recordings():
        alone = dtm.estimate_delay(recording)
        for name in ("delay", "lag"):
            narrow, wide = together.ci(0.95, name), alone.ci(0.95, name)
            shares.append((narrow[1] - narrow[0]) / (wide[1] - wide[0]))
    assert max(shares) < 1.2
    assert np.mean(shares) < 0.9


def test_a_noisy_recording_beside_a_good_one_does_no_harm():
    good, bad = recordings((0.05, 5.0))
    alone, both = dtm.estimate_delay(good), dtm.estimate_delay([good, bad])
    widths = [high - low for low, high in (alone.ci(), both.ci())]
    assert widths[1] < 1.2 * widths[0]


def test_one_recording_in_a_list_is_that_recording():
    time, command, output = bump(3)
    recording = dtm.Recording(time, None, output, command)
    assert dtm.estimate_delay([recording]).intervals == dtm.estimate_delay(recording).intervals


def test_likelihoods_of_independent_records_add():
    records = [made.slow_window(seed) for seed in (0, 1)]
    options = {"plant": "lag", "noise": "white", "largest_delay": 1.0}
    alone = [fit(record, **options).candidates[0] for record in records]
    rows = [(one.time, one.command, one.output, 0, None, 0.0) for one in records]
    both = _native.fit_family(rows, **options).candidates[0]
    assert both.deviance > sum(one.deviance for one in alone) - 1e-6
    assert both.deviance < sum(one.deviance for one in alone) + 40.0
    # Information adds: the delay of both is known about as well as the mean of two.
    errors = [one.errors[0] for one in alone]
    expected = np.hypot(*np.reciprocal(errors)) ** -1
    assert both.errors[0] / np.sqrt(both.dispersion) == pytest.approx(expected, rel=0.4)
    assert holds([0.29, 0.31], both.values[0])


def test_lists_that_do_not_match_are_refused():
    two = recordings()
    with pytest.raises(ValueError, match="2 recordings and 1 of `window`"):
        dtm.estimate_delay(two, window=[(0, 100)])
    with pytest.raises(ValueError, match="2 recordings and 3 of `controller`"):
        dtm.estimate_delay(two, controller=[dtm.P(1.0)] * 3)
    with pytest.raises(TypeError, match="recording must be a Recording, not int"):
        dtm.estimate_delay([two[0], 3])


@pytest.mark.survey
def test_the_recorded_heights_are_one_servo():
    names = ("0_5_1_0", "2_4_0_25")
    flights = [
        dtm.read_recording(
            flight_path(f"ardrone2_height_step_{name}.csv"),
            time="t_s",
            reference="ref_m",
            output="height_m",
        )
        for name in names
    ]
    gains = [dtm.P(0.5), dtm.P(2.4)]
    fitted = dtm.estimate_delay(flights, controller=gains, limit=1.0, window=(13, 25.5))
    assert fitted.best.name == "integrator, two lags, zero"
    assert all(run.noise_std < 0.0065 for run in fitted.runs)
    assert fitted.candidates[1].behind > 10.0
