"""Checks of recordings: what each finding is found on, and that clean recordings have none."""

import json
import pickle

import deadtime as dtm
import numpy as np
import pytest
from deadtime.estimation import OutputError
from flights import flight_path
from hypothesis import given, strategies as st

TS = 0.065
LOOP = dtm.ControlLoop(dtm.Integrator(0.85), dtm.P(1.6), delay=0.3, sample_time=TS, limit=1.0)
KNOWN = LOOP.replace(delay=None, gain=1.0)
COLUMNS = ("time", "reference", "output", "command")


def flown(loop=LOOP, noise=0.005, seed=0):
    """A step of 1 m, with sensor noise in the loop."""
    step = dtm.Experiment.step(8.0, rest=1.04, sample_time=loop.sample_time or TS)
    return step.run(loop, noise=noise, seed=seed)


def rows(recording, chosen):
    return dtm.Recording(*(getattr(recording, name)[chosen] for name in COLUMNS))


def changed(recording, **columns):
    return dtm.Recording(**({name: getattr(recording, name) for name in COLUMNS} | columns))


def without_command(recording):
    return dtm.Recording(recording.time, recording.reference, recording.output)


def found(recording, loop=KNOWN, window=None):
    """The check, and its findings by code without the note on even stamps."""
    check = recording.check(loop, window)
    codes = {one.code: one for one in check.findings if one.code != "stamps_nominal"}
    assert check.refused == any(one.severity == "refused" for one in check.findings)
    return check, codes


FLOWN = flown()


# --- clean recordings ---------------------------------------------------------------------------


def test_a_clean_recording_has_one_note_on_its_even_stamps():
    check, codes = found(FLOWN)
    assert not codes
    assert [one.severity for one in check.findings] == ["note"]
    assert (check.law, check.stamps, check.rate_ratio, check.clock_ratio) == (
        "exact", "nominal", 1, 1.0
    )  # fmt: skip
    assert check.row_time == pytest.approx(TS)
    assert check.saturated == pytest.approx(np.mean(np.abs(FLOWN.command) == 1.0))
    assert check.limit_seen == 1.0
    assert not check.holes
    assert not check.repeated.size


@given(
    st.floats(0.02, 0.5),
    st.floats(0.3, 2.0),
    st.floats(0.0, 0.6),
    st.sampled_from([None, 0.3, 1.0]),
    st.sampled_from([0.01, TS, 1 / 30]),
    st.sampled_from([0.0, 0.001, 0.005, 0.02]),
    st.booleans(),
    st.integers(0, 1000),
)
def test_clean_recordings_of_any_loop_have_no_warning(
    share, gain, delay, limit, sample_time, noise, in_loop, seed
):
    # A well damped loop, whose command reaches its limit for a part of the step at most.
    Kp = min(4.0, share / (gain * (delay + 2.0 * sample_time)))
    loop = dtm.ControlLoop(
        dtm.Integrator(gain), dtm.P(Kp), delay=delay, sample_time=sample_time, limit=limit
    )
    step = dtm.Experiment.step(8.0, rest=1.04, sample_time=sample_time)
    check = step.run(loop, noise, seed, noise_in_loop=in_loop).check(loop.replace(delay=None))
    assert [str(one) for one in check.findings if one.severity != "note"] == []
    assert check.law != "differs"


# --- time of the rows ---------------------------------------------------------------------------


def test_lost_rows_are_counted_wherever_they_are():
    kept = np.delete(np.arange(len(FLOWN)), [25, 40, 41])
    check, codes = found(rows(FLOWN, kept))
    assert [(hole.before, hole.after, hole.missing) for hole in check.holes] == [
        (24, 25, 1), (38, 39, 2)
    ]  # fmt: skip
    assert codes["rows_lost"].severity == "warning"
    assert "3 rows are missing" in codes["rows_lost"].message
    assert check.row_time == pytest.approx(TS)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
def test_the_time_between_rows_is_found_among_lost_ones(share):
    random = np.random.default_rng(3)
    kept = np.sort(random.permutation(len(FLOWN))[: int((1.0 - share) * len(FLOWN))])
    check, _ = found(rows(FLOWN, kept))
    inner = kept[-1] - kept[0] + 1 - kept.size
    assert sum(hole.missing for hole in check.holes) == inner
    assert (check.rate_ratio, check.law) == (1, "exact")


def test_a_hole_in_the_rise_is_a_warning_and_one_at_rest_a_note():
    check, codes = found(rows(FLOWN, np.r_[0:20, 35 : len(FLOWN)]))
    assert check.holes == ((19, 20, 15),)
    assert codes["hole"].severity == "warning"
    assert "1.04 s" in codes["hole"].message
    assert "change is 0.65" in codes["hole"].effect
    _, codes = found(rows(FLOWN, np.r_[0:80, 110 : len(FLOWN)]))
    assert codes["hole"].severity == "note"


def test_a_hole_with_a_whole_response_in_it_is_a_warning():
    # At rest before it and after it, under another reference.
    _, codes = found(rows(FLOWN, np.r_[0:14, 100 : len(FLOWN)]))
    assert codes["hole"].severity == "warning"


def test_rows_that_repeat_while_the_output_moves_are_counted():
    twice = np.arange(len(FLOWN))
    again = np.arange(20, 60, 4)
    twice[again] = again - 1
    stale = changed(FLOWN, output=FLOWN.output[twice], command=FLOWN.command[twice])
    check, codes = found(stale)
    assert codes["rows_repeated"].severity == "warning"
    assert set(check.repeated) <= set(again)
    assert check.repeated.size >= 8
    # A repeated output under a new command is no repeated row.
    assert "rows_repeated" not in found(changed(FLOWN, output=FLOWN.output[twice]))[1]


def test_an_output_that_was_rounded_does_not_repeat():
    for seed in range(20):
        flight = flown(noise=0.002, seed=seed)
        rounded = changed(flight, output=flight.output.round(3), command=flight.command.round(3))
        check, codes = found(rounded)
        assert not codes, codes
        assert check.law == "exact"


def test_stamps_that_jitter_are_a_warning_by_their_size():
    error = np.random.default_rng(1).normal(0.0, 1.0, len(FLOWN))
    check, codes = found(changed(FLOWN, time=FLOWN.time + 0.01 * error))
    assert check.stamps == "jittered"
    assert check.jitter == pytest.approx(0.0141, rel=0.2)
    assert codes.keys() == {"jitter"}
    assert codes["jitter"].severity == "warning"
    assert not check.holes
    check, codes = found(changed(FLOWN, time=FLOWN.time + 0.001 * error))
    assert codes["jitter"].severity == "note"
    assert found(changed(FLOWN, time=FLOWN.time + 0.0002 * error))[0].stamps == "even"


# --- the clock ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds")])
@pytest.mark.parametrize("loop", [KNOWN, KNOWN.replace(sample_time=0.5 * TS)])
def test_another_unit_of_time_is_refused_by_name(factor, unit, loop):
    check, codes = found(changed(FLOWN, time=factor * FLOWN.time), loop)
    assert check.refused
    assert f"The time stamps are probably {unit}" in codes["time_unit"].message
    assert f"{factor:.0f} times too long" in codes["time_unit"].effect
    _, codes = found(FLOWN, loop.replace(sample_time=factor * loop.sample_time))
    assert f"sample_time is in {unit}" in codes["time_unit"].message


def test_a_slow_log_or_controller_is_not_another_unit_of_time():
    # One row a second of a slow loop that is sampled every millisecond.
    time = np.arange(200.0)
    reference = np.where(time < 20.0, 0.0, 1.0)
    slow = KNOWN.replace(Kp=0.05, sample_time=None, delay=2.0)
    run = slow.simulate(time, reference, reference_time=time)
    flight = dtm.Recording(time, reference, run.outputs, run.inputs)
    assert found(flight, slow.replace(sample_time=1e-3))[1].keys() == {"lower_rate"}
    # A thousand rows for each sample of a slow controller.
    slow = slow.replace(sample_time=1.0)
    time = np.arange(60_000) * 1e-3
    reference = np.where(time < 20.0, 0.0, 1.0)
    run = slow.simulate(time, reference, reference_time=time)
    flight = dtm.Recording(time, reference, run.outputs, run.inputs)
    _, codes = found(flight, slow)
    assert codes["other_rate"].severity == "note"


def test_another_unit_of_time_is_seen_from_the_gains():
    loop = KNOWN.replace(sample_time=None)
    assert "time_unit" in found(changed(FLOWN, time=1e3 * FLOWN.time), loop)[1]
    assert "time_unit" in found(changed(FLOWN, time=1e-3 * FLOWN.time), loop)[1]
    assert "time_unit" not in found(FLOWN, loop)[1]


@pytest.mark.parametrize(
    ("ratio", "severity"),
    [(1.0005, None), (1.002, "warning"), (0.99, "refused"), (1.01, "refused")],
)
def test_two_clocks_are_told_by_their_ratio(ratio, severity):
    check, codes = found(changed(FLOWN, time=ratio * FLOWN.time))
    assert (codes["two_clocks"].severity if codes else None) == severity
    assert check.clock_ratio == pytest.approx(ratio if severity else 1.0)


@pytest.mark.parametrize("every", [2, 3])
def test_a_recording_at_a_lower_rate_is_a_warning(every):
    check, codes = found(rows(FLOWN, slice(None, None, every)))
    assert codes.keys() == {"lower_rate"}
    assert codes["lower_rate"].severity == "warning"
    assert (check.rate_ratio, check.clock_ratio) == (every, 1.0)
    assert f"{1e3 * 0.5 * (every - 1) * TS:.4g} ms" in codes["lower_rate"].effect


def test_a_wrong_sample_time_is_refused_where_the_command_shows_it():
    for wrong in (0.05, 0.1):
        _, codes = found(FLOWN, KNOWN.replace(sample_time=wrong))
        assert codes["sample_time"].severity == "refused"
        assert "sample_time=0.065" in codes["sample_time"].message
        _, codes = found(without_command(FLOWN), KNOWN.replace(sample_time=wrong))
        assert codes["other_rate"].severity == "warning"


def test_rows_between_the_samples_are_accepted_with_the_command():
    time = np.arange(1000) * 0.008
    reference = np.where(time < 1.0, 0.0, 1.0)
    run = LOOP.simulate(time, reference, reference_time=time)
    flight = dtm.Recording(time, reference, run.outputs, run.inputs)
    assert found(flight)[1]["other_rate"].severity == "note"
    assert found(without_command(flight))[1]["other_rate"].severity == "warning"
    random = np.random.default_rng(0).normal(0.0, 0.1, time.size)
    _, codes = found(changed(flight, command=random))
    assert codes["sample_time"].severity == "refused"


def test_a_sample_time_that_was_not_told_is_seen():
    untold = KNOWN.replace(sample_time=None)
    check, codes = found(FLOWN, untold)
    assert check.sample_time_seen == pytest.approx(TS)
    assert codes["sample_time_seen"].severity == "warning"
    # The law of a continuous loop without noise holds on its rows, too.
    time = np.arange(800) * 0.01
    reference = np.where(time < 1.0, 0.0, 1.0)
    run = untold.replace(delay=0.3).simulate(time, reference, reference_time=time)
    check, codes = found(dtm.Recording(time, reference, run.outputs, run.inputs), untold)
    assert codes["sample_time_seen"].severity == "note"
    assert found(without_command(FLOWN), untold)[0].sample_time_seen is None


# --- the command --------------------------------------------------------------------------------


def test_a_command_that_is_one_row_late_or_early_is_told():
    late = changed(rows(FLOWN, slice(1, None)), command=FLOWN.command[:-1])
    early = changed(rows(FLOWN, slice(None, -1)), command=FLOWN.command[1:])
    for flight, law, effect in ((late, "late", "too short"), (early, "early", "too long")):
        check, codes = found(flight)
        assert check.law == law
        assert codes.keys() == {f"command_{law}"}
        assert effect in codes[f"command_{law}"].effect


@pytest.mark.parametrize("law", ["late", "early"])
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_a_late_or_early_command_is_moved_and_said(law, noise):
    """The delay came out one row, 65 ms, too short or too long, and was called right."""
    flight = flown(noise=noise)
    if law == "late":
        flight = changed(rows(flight, slice(1, None)), command=flight.command[:-1])
    else:
        flight = changed(rows(flight, slice(None, -1)), command=flight.command[1:])
    fit = dtm.estimate_delay(flight, KNOWN, method=OutputError())
    assert fit.delay == pytest.approx(LOOP.delay, abs=0.005)
    low, high = fit.ci()
    assert noise == 0.0 or low < LOOP.delay < high
    assert f"the command was logged one row {law}" in fit.message
    assert "shifted by 65 ms" in fit.summary()


def test_noise_of_the_recording_alone_leaves_the_law_approximate():
    step = dtm.Experiment.step(8.0, rest=1.04)
    check, codes = found(step.run(LOOP, 0.005, noise_in_loop=False))
    assert check.law == "approximate"
    assert codes.keys() == {"command_approximate"}
    assert check.limit_seen == 1.0


@pytest.mark.parametrize(
    ("change", "loop", "code", "words"),
    [
        ({"command": -FLOWN.command}, KNOWN, "command_sign", "-1 times"),
        ({"command": 100.0 * FLOWN.command}, KNOWN, "command_unit", "centimetres"),
        (
            {"reference": 1e3 * FLOWN.reference, "output": 1e3 * FLOWN.output},
            KNOWN,
            "command_unit",
            "millimetres",
        ),
        ({"command": np.degrees(FLOWN.command)}, KNOWN, "command_unit", "degrees"),
        ({}, KNOWN.replace(limit=0.8), "limit_exceeded", "reaches 1, although limit=0.8"),
        ({}, KNOWN.replace(limit=1.2), "limit_seen", "limit=1"),
        ({"reference": FLOWN.output}, KNOWN, "setpoint_copied", "equals the output"),
        ({"output": 0.0 * FLOWN.output}, KNOWN, "output_constant", "did not move"),
        ({"command": np.zeros(len(FLOWN))}, KNOWN, "command_constant", "the command is 0"),
    ],
)
def test_what_contradicts_the_loop_is_refused_by_name(change, loop, code, words):
    check, codes = found(changed(FLOWN, **change), loop)
    assert check.refused
    assert codes[code].severity == "refused"
    assert words in codes[code].message
    assert check.findings[0].severity == "refused"


@pytest.mark.parametrize(
    ("change", "loop", "code", "words"),
    [
        ({}, KNOWN.replace(limit=None), "limit_seen", "no limit was given: give limit=1"),
        ({}, KNOWN.replace(Kp=1.2), "command_gain", "the controller was 1.6 instead of Kp=1.2"),
        ({"command": FLOWN.command + 0.05}, KNOWN.replace(limit=None), "command_offset", "+0.05"),
        ({"command": np.sin(FLOWN.time)}, KNOWN, "command_differs", "explains"),
        ({"output": 100.0 * FLOWN.output}, KNOWN, "output_range", "Check the units"),
    ],
)
def test_what_only_some_fits_can_use_is_a_warning(change, loop, code, words):
    check, codes = found(changed(FLOWN, **change), loop)
    assert not check.refused
    assert codes[code].severity == "warning"
    assert words in codes[code].message
    assert codes[code].effect


def test_single_commands_of_another_row_are_counted():
    command = FLOWN.command.copy()
    command[[30, 34, 38]] = FLOWN.command[[29, 33, 37]]
    check, codes = found(changed(FLOWN, command=command))
    assert check.law == "exact"
    assert "in 3 of 124 rows" in codes["command_strays"].message


def test_the_law_of_other_controllers_is_unknown():
    for controller in (dtm.PI(1.2, 0.1), dtm.PV(1.2, 0.1, dtm.DerivativeFilter(20.0))):
        loop = LOOP.replace(controller=controller)
        check, codes = found(flown(loop), loop)
        assert check.law == "unknown"
        assert not codes


def test_a_relay_is_not_taken_for_a_wrong_controller():
    run = dtm.Experiment.relay(10.0, 0.5).run(LOOP, noise=0.002)
    check, codes = found(run, KNOWN.replace(limit=0.5))
    assert codes.keys() == {"relay"}
    assert not check.refused


# --- excitation ---------------------------------------------------------------------------------


def test_a_window_without_a_step_is_refused_unless_the_command_is_logged():
    _, codes = found(without_command(FLOWN), window=(4.5, None))
    assert codes["no_step"].severity == "refused"
    _, codes = found(FLOWN, window=(4.5, None))
    assert codes["no_step"].severity == "warning"


def test_a_command_at_its_limit_throughout_is_refused():
    slow = LOOP.replace(limit=0.05)
    check, codes = found(flown(slow), KNOWN.replace(limit=0.05), window=(1.2, 6.0))
    assert check.saturated == 1.0
    assert codes["saturated"].severity == "refused"


def test_a_plant_without_its_controller_is_told():
    copied = changed(FLOWN, reference=FLOWN.command)
    _, codes = found(copied)
    assert codes["reference_is_command"].severity == "note"


# --- the result ---------------------------------------------------------------------------------


def test_a_check_is_text_values_and_a_value():
    check = rows(FLOWN, slice(None, None, 2)).check(KNOWN)
    told = json.loads(json.dumps(check.to_dict()))
    assert told["refused"] is False
    assert told["findings"][0]["code"] == "lower_rate"
    assert told["rate_ratio"] == 2
    assert str(check).splitlines()[0].startswith("62 rows 130 ms apart, none missing")
    assert check.summary("warning").startswith("warning: the controller samples every")
    assert check.summary("refused") == ""
    assert repr(check) == "<RecordingCheck: 62 rows, 1 warning, 1 note>"
    assert pickle.loads(pickle.dumps(check)) == check
    assert check != FLOWN.check(KNOWN)


def test_a_window_is_checked_alone():
    bad = FLOWN.command.copy()
    bad[:30] = np.sin(np.arange(30))
    flight = changed(FLOWN, command=bad)
    assert flight.check(KNOWN, (2.0, 8.0)).law == "exact"
    assert flight.check(KNOWN).law == "differs"
    with pytest.raises(dtm.RecordingError, match="at least 8"):
        flight.check(KNOWN, (2.0, 2.1))


def test_only_a_loop_can_be_checked_against():
    with pytest.raises(TypeError, match="ControlLoop, not Integrator"):
        FLOWN.check(dtm.Integrator())


@given(st.integers(8, 40), st.integers(0, 10**6), st.booleans(), st.booleans())
def test_any_recording_is_checked(size, seed, logged, sampled):
    random = np.random.default_rng(seed)
    scale = 10.0 ** random.integers(-8, 8, 4)
    time, reference, output, command = scale[:, None] * random.choice([0, 1, -0.3], (4, size))
    time = np.cumsum(scale[0] * random.choice([1e-3, 1.0, 1e3], size))
    flight = dtm.Recording(time, reference, output, command if logged else None)
    check = flight.check(KNOWN if sampled else KNOWN.replace(sample_time=None, limit=None))
    assert "nan" not in str(check)
    json.dumps(check.to_dict(), allow_nan=False)


# --- recordings of flights ----------------------------------------------------------------------


@pytest.mark.parametrize(("name", "Kp"), [("0_5_1_0", 0.5), ("2_4_0_25", 2.4)])
@pytest.mark.parametrize("window", [None, (13, 25.5)])
def test_the_height_recordings_repeat_rows(name, Kp, window):
    flight = dtm.read_recording(
        flight_path(f"ardrone2_height_step_{name}.csv"),
        time="t_s", reference="ref_m", output="height_m",
    )  # fmt: skip
    check, codes = found(flight, LOOP.replace(Kp=Kp), window)
    assert codes.keys() == {"rows_repeated"}
    assert 0.05 < check.repeated_share < 0.2
    # The height of a row that was read twice makes up for it in the next one.
    change = np.diff(flight.window(*(window or (None, None))).output)
    after = check.repeated[~np.isin(check.repeated + 1, check.repeated)]
    after = after[after + 1 < change.size]
    assert np.median(np.abs(change[after])) > 1.3 * np.median(np.abs(change[after + 1]))


def test_the_simulated_copter_is_clean_once_its_limit_is_given():
    flight = dtm.read_recording(
        flight_path("ardupilot_sitl_guided_heights.csv"),
        time="t", reference="ref", output="h", command="u",
    )  # fmt: skip
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.05, limit=1.0)
    check, codes = found(flight, loop)
    assert (check.law, check.rate_ratio, codes) == ("exact", 1, {})
    assert found(flight, loop.replace(limit=None))[1].keys() == {"limit_seen"}
    assert found(flight, loop.replace(sample_time=None))[0].sample_time_seen == pytest.approx(0.05)


def test_a_sweep_of_a_plant_is_not_a_closed_loop():
    columns = {"time": "t_s", "reference": "roll_torque_setpoint", "output": "roll_rate_rad_s"}
    path = flight_path("px4_sitl_roll_rate_sweep.csv")
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=0.004)
    check, codes = found(dtm.read_recording(path, **columns), loop)
    assert codes["output_range"].severity == "warning"
    flight = dtm.read_recording(path, **columns, command="roll_torque_setpoint")
    check, codes = found(flight, loop)
    assert check.law == "differs"
    assert codes.keys() == {"output_range", "reference_is_command"}
