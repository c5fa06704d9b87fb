"""Gains in the forms that people type in: numbers worked by hand, and round trips."""

import math
import re

import deadtime as dtm
import pytest
from deadtime.tuning import (
    LOOPS_OF_FORMS,
    IdealForm,
    ParallelForm,
    SeriesForm,
    controller_of,
    one_pole_filter,
    proportional_band,
    settings_of,
)

SMOOTH = one_pole_filter(20.0)

#: Controller, form, loop, lines that have to be among those written. Each number from the formula
#: of the firmware's source, by hand.
WRITTEN = [
    # Kc = 1.2, Ti = 1.2/0.03, Td = 6/1.2.
    (dtm.PID(1.2, 0.03, 6.0), "ideal", "", ["Kc = 1.2", "Ti = 40 s", "Td = 5 s"]),
    (dtm.PI(1.2, 0.03), "ideal", "", ["Kc = 1.2", "Ti = 40 s", "Td = 0 s"]),
    (dtm.PD(1.2, 6.0), "ideal", "", ["Kc = 1.2", "Ti = off", "Td = 5 s"]),
    # SeriesForm of K' = 1, Ti' = 30, Td' = 10: Kp = 1 + 10/30, Ki = 1/30, Kd = 10.
    (dtm.PID(4 / 3, 1 / 30, 10.0), "series", "", ["Kc = 1", "Ti = 30 s", "Td = 10 s"]),
    (dtm.PID(1.25, 0.5, 0.125), "parallel", "", ["Kp = 1.25", "Ki = 0.5", "Kd = 0.125"]),
    # ArduPilot: u = P e + I ∫ e + D de/dt in rad/s.
    (
        dtm.PID(0.135, 0.09, 0.0036, SMOOTH),
        "ardupilot",
        "roll rate",
        [
            "ATC_RAT_RLL_P,0.135",
            "ATC_RAT_RLL_I,0.09",
            "ATC_RAT_RLL_D,0.0036",
            "ATC_RAT_RLL_FLTD,20",
        ],
    ),
    (dtm.P(1.3), "ardupilot", "altitude", ["PSC_POSZ_P,1.3"]),
    (dtm.P(0.9), "ardupilot", "east position", ["PSC_POSXY_P,0.9"]),
    (dtm.P(4.5), "ardupilot", "pitch", ["ATC_ANG_PIT_P,4.5"]),
    (dtm.PI(2.0, 1.0), "ardupilot", "north velocity", ["PSC_VELXY_P,2", "PSC_VELXY_I,1"]),
    # 0.5 per cm/s² in thousandths of the throttle is 0.5 * 100 / 1000 per m/s².
    (dtm.PI(0.05, 0.1), "ardupilot", "vertical acceleration", ["PSC_ACCZ_P,0.5", "PSC_ACCZ_I,1"]),
    # PX4: u = K (P e + I ∫ e - D accel).
    (
        dtm.PV(0.15, 0.003, one_pole_filter(30.0)),
        "px4",
        "pitch rate",
        [
            "param set MC_PITCHRATE_K 1",
            "param set MC_PITCHRATE_P 0.15",
            "param set MC_PITCHRATE_D 0.003",
            "param set IMU_DGYRO_CUTOFF 30",
        ],
    ),
    (dtm.P(0.95), "px4", "north position", ["param set MPC_XY_P 0.95"]),
    (
        dtm.PI(4.0, 2.0),
        "px4",
        "vertical speed",
        ["param set MPC_Z_VEL_P_ACC 4", "param set MPC_Z_VEL_I_ACC 2"],
    ),
    # Betaflight: 45 * 0.032029 per deg/s is 1.441305 * 57.29578 = 82.5807 per rad/s; 80 * 0.244381
    # is 1120.16, 2.5 times that on yaw; 30 * 0.000529 is 0.909284, which is an F of
    # 0.01587/0.00013754 = 115.4.
    (
        dtm.PID(82.5807, 1120.16, 0.909284, SMOOTH),
        "betaflight",
        "roll rate",
        [
            "set p_roll = 45",
            "set i_roll = 80",
            "set d_roll = 30",
            "set d_min_roll = 30",
            "set f_roll = 115",
            "set dterm_lpf1_type = PT1",
            "set dterm_lpf1_static_hz = 20",
        ],
    ),
    (dtm.PI(82.5807, 2800.4), "betaflight", "yaw rate", ["set p_yaw = 45", "set i_yaw = 80"]),
    # A PT2 at 100 Hz is two poles at 155.377 Hz.
    (
        dtm.PV(82.5807, 0.909284, dtm.DerivativeFilter(2 * math.pi * 155.3774)),
        "betaflight",
        "pitch rate",
        ["set dterm_lpf1_type = PT2", "set dterm_lpf1_static_hz = 100"],
    ),
    (
        dtm.PV(82.5807, 0.909284, dtm.DerivativeFilter(2 * math.pi * 80.0, math.sqrt(0.5))),
        "betaflight",
        "pitch rate",
        ["set dterm_lpf1_type = BIQUAD", "set dterm_lpf1_static_hz = 80"],
    ),
]


@pytest.mark.parametrize(("controller", "form", "loop", "lines"), WRITTEN)
def test_gains_are_written_by_the_formula_of_the_source(controller, form, loop, lines):
    found = settings_of(controller, form, loop=loop)
    assert set(lines) <= set(found.lines)
    assert found.rounding < (0.01 if form == "betaflight" else 1e-3)


@pytest.mark.parametrize(("controller", "form", "loop", "lines"), WRITTEN)
def test_what_was_written_reads_back_as_the_controller(controller, form, loop, lines):
    found = settings_of(controller, form, loop=loop)
    back = controller_of("\n".join(found.lines), form, loop=loop)
    on_measurement = isinstance(controller, dtm.PV) and form in ("ideal", "series", "parallel")
    assert type(back) is (dtm.PD if on_measurement else type(controller))
    assert back.gains == found.controller.gains
    tolerance = 5e-3 if form == "betaflight" else 5e-4
    for name, gain in controller.gains.items():
        assert back.gains[name] == pytest.approx(gain, rel=tolerance)
    smooth = getattr(controller, "filter", None)
    if smooth is not None and form != "parallel":
        read = back.filter
        for omega in (1.0, 50.0, 300.0):
            kept, typed = (_of_filter(one, omega) for one in (smooth, read))
            assert abs(typed / kept - 1.0) < 0.01
    assert settings_of(back, form, loop=loop).values == found.values
    assert controller_of(found.values, form, loop=loop) == back


def _of_filter(smooth, omega):
    w, s = smooth.omega, 1j * omega
    return w**2 / (s**2 + 2 * smooth.damping * w * s + w**2)


@pytest.mark.parametrize("form", ["ardupilot", "px4", "betaflight"])
def test_every_loop_has_the_gains_it_says(form):
    for loop in LOOPS_OF_FORMS[form]:
        found = settings_of(dtm.P(82.5807 if form == "betaflight" else 1.5), form, loop=loop)
        assert controller_of(found.values, form, loop=loop).gains["Kp"] == pytest.approx(
            found.controller.gains["Kp"]
        )
        assert found.source.split()[0].lower() == form


def test_weights_of_the_set_point_and_the_tracking_time_are_typed():
    given = dtm.PID(1.0, 0.1, 2.0, weight=0.5, derivative_weight=0.0, anti_windup=7.0)
    found = settings_of(given, "ideal")
    assert found.lines[-3:] == ("b = 0.5", "c = 0", "Tt = 7 s")
    assert controller_of("\n".join(found.lines), "ideal") == given
    # PX4 takes the derivative of the measurement, which is a weight of zero: nothing to note.
    rate = dtm.PID(0.15, 0.2, 0.003, one_pole_filter(30.0), derivative_weight=0.0)
    found = settings_of(rate, "px4", loop="roll rate")
    assert not any("kick" in note for note in found.notes)
    assert found.controller.derivative_weight == 0.0
    # Half of the gain of D is half of its F: 115.4/2.
    half = dtm.PID(82.5807, 1120.16, 0.909284, SMOOTH, derivative_weight=0.5)
    found = settings_of(half, "betaflight", loop="roll rate")
    assert "set f_roll = 58" in found.lines
    assert found.controller.derivative_weight == pytest.approx(0.5, abs=0.01)


def test_the_series_form_multiplies_out_to_the_ideal_one():
    # (1 + 1/(12 s)) (1 + 3 s) = 1 + 3/12 + 1/(12 s) + 3 s.
    ideal = IdealForm.of(SeriesForm(2.0, 12.0, 3.0).controller())
    assert (ideal.Kc, ideal.Ti, ideal.Td) == pytest.approx((2.5, 15.0, 2.4))
    assert vars(SeriesForm.of(ideal.controller())) == pytest.approx(
        {"Kc": 2.0, "Ti": 12.0, "Td": 3.0}
    )
    assert ParallelForm.of(ideal.controller()).Ki == pytest.approx(2.0 / 12.0)


def test_a_filter_of_one_pole_is_one():
    smooth = one_pole_filter(20.0)
    for hertz, apart in ((0.5, 1e-3), (5.0, 0.02), (20.0, 0.05)):
        one_pole = 1.0 / (1.0 + 1j * hertz / 20.0)
        assert abs(_of_filter(smooth, 2 * math.pi * hertz) / one_pole - 1.0) < apart


def test_a_proportional_band_is_that_of_the_spans():
    assert proportional_band(1.8, (150.0, 100.0)) == pytest.approx(100.0 / (1.8 * 1.5))
    lines = settings_of(dtm.PI(2.0, 0.1), "ideal", spans=(100.0, 100.0)).lines
    assert lines[-1] == "PB = 50 %"


def test_names_follow_the_version():
    new = settings_of(dtm.P(1.2), "ardupilot", loop="altitude", version="ArduCopter V4.7.1")
    assert new.lines == ("PSC_D_POS_P,1.2",)
    moved = settings_of(dtm.PI(0.05, 0.1), "ardupilot", loop="vertical acceleration", version="4.7")
    assert moved.lines[:2] == ("PSC_D_ACC_P,0.05", "PSC_D_ACC_I,0.1")
    line = settings_of(dtm.P(80.0), "betaflight", loop="roll rate", version="2025.12").lines
    assert "set d_max_roll = 0" in line


@pytest.mark.parametrize(
    ("loop", "version", "named"),
    [
        ("yaw rate", "4.5", "ATC_RAT_YAW_FLTE"),
        ("vertical speed", "4.5", "PSC_VELZ_FLTE"),
        ("vertical speed", "4.7", "PSC_D_VEL_FLTE"),
        ("north velocity", "4.5", "PSC_VELXY_FLTE"),
        ("roll rate", "4.5", ""),
    ],
)
def test_a_filter_of_the_error_that_is_on_by_default_is_named(loop, version, named):
    notes = " ".join(settings_of(dtm.PI(0.05, 0.1), "ardupilot", loop=loop, version=version).notes)
    assert named in notes
    assert ("filters the error" in notes) == bool(named)


def test_files_of_ground_stations_are_read():
    text = "# written by\n1\t1\tMC_ROLLRATE_K\t2.0\t9\n1\t1\tMC_ROLLRATE_P\t0.1\t9\n"
    assert controller_of(text, "px4", loop="roll rate") == dtm.P(0.2)
    text = "PSC_POSZ_P       1.250000\nPSC_VELZ_P 5"
    assert controller_of(text, "ardupilot", loop="altitude") == dtm.P(1.25)


REFUSED = [
    (dtm.PI(1.0, 0.1), "ardupilot", "altitude", "no integral gain"),
    (dtm.PV(0.1, 0.003, SMOOTH), "ardupilot", "roll rate", "takes the derivative of the error"),
    (dtm.PI(0.1, 0.1, weight=0.5), "px4", "roll rate", "no weight of the set point"),
    (dtm.PI(82.0, 900.0, weight=0.5), "betaflight", "roll rate", "no weight of P"),
    (dtm.PI(1.0, 0.1, feed_forward=1.0), "ideal", "", "without feed-forward"),
    (dtm.PD(0.1, 0.003, dtm.DerivativeFilter(200.0)), "ardupilot", "roll rate", "has one pole"),
    (dtm.PD(0.1, 0.003, dtm.DerivativeFilter(200.0)), "px4", "roll rate", "has one pole"),
    (dtm.PD(82.0, 0.9, dtm.DerivativeFilter(200.0, 0.5)), "betaflight", "roll rate", "PT1"),
    (dtm.PID(1.0, 1.0, 1.0), "series", "", "Ti >= 4 Td"),
    (dtm.P(-1.0), "px4", "altitude", "positive"),
    (dtm.P(1e6), "betaflight", "roll rate", "whole number"),
    (dtm.PI(82.0, 1.0), "betaflight", "roll rate", "rounded to zero"),
    (dtm.P(1.0), "betaflight", "altitude", "the loops of betaflight"),
    (dtm.P(1.0), "ideal", "altitude", "does not belong to a vehicle"),
    (dtm.P(1.0), "inav", "altitude", "form='inav': give one of"),
]


@pytest.mark.parametrize(("controller", "form", "loop", "why"), REFUSED)
def test_what_a_form_cannot_express_is_refused(controller, form, loop, why):
    with pytest.raises(ValueError, match=re.escape(why)):
        settings_of(controller, form, loop=loop)


UNREADABLE = [
    ("ATC_RAT_RLL_I,0.1", "ardupilot", "roll rate", "ATC_RAT_RLL_P is missing"),
    ("nothing", "px4", "roll rate", "no line of the text"),
    ("set p_roll = 45\nset d_roll = 40\nset d_min_roll = 30", "betaflight", "roll rate", "moves"),
    ("set p_roll = many", "betaflight", "roll rate", "give a number"),
    ("Kc = 1\nTx = 3", "ideal", "", "not a parameter of the form"),
    ("Kc = 1.2\nTi = 40,5", "ideal", "", "Ti = 40,5: give one number in each line"),
    ("Kc = 1.2\nTi = 2 min", "ideal", "", "times in seconds"),
    ("Kc=2 Ti=10", "series", "", "one number in each line"),
    ("Kc = 2\nb = 0.5", "ideal", "", "a P has no b"),
    ("Kc = 2\nTi = 4 %", "ideal", "", "give Ti in another unit"),
]


@pytest.mark.parametrize(("text", "form", "loop", "why"), UNREADABLE)
def test_what_cannot_be_read_is_refused(text, form, loop, why):
    with pytest.raises(ValueError, match=re.escape(why)):
        controller_of(text, form, loop=loop)


def test_lines_of_a_faceplate_are_read_with_their_units():
    text = "Kc = 1.2\nTi = 40 s\nTd = off\nb = 0.5\nPB = 50 %"
    assert controller_of(text, "ideal") == dtm.PI(1.2, 0.03, weight=0.5)
    assert controller_of("Kc: 2\nTi: off", "ideal") == dtm.P(2.0)
    assert "-0" not in " ".join(settings_of(dtm.PI(-1.0, -0.1), "ideal").lines)
    with pytest.raises(ValueError, match=r"does not belong to a vehicle\. Leave version out"):
        settings_of(dtm.P(1.0), "ideal", version="4.7")


def test_notes_say_what_the_firmware_does_otherwise():
    px4 = settings_of(dtm.PID(0.15, 0.2, 0.003), "px4", loop="roll rate")
    assert any("does not respond to a step of the set point" in note for note in px4.notes)
    assert any("no filter of the derivative" in note for note in px4.notes)
    outside = settings_of(dtm.P(9.0), "ardupilot", loop="altitude")
    assert any("outside of the usual range" in note for note in outside.notes)
    coarse = settings_of(dtm.P(3.0), "betaflight", loop="roll rate")
    assert coarse.rounding > 0.2
    assert any("only whole numbers" in note for note in coarse.notes)


def test_the_head_of_a_blackbox_log_is_read():
    head = {"rollPID[0]": 45.0, "rollPID[1]": 80.0, "rollPID[2]": 30.0, "d_max[0]": 30.0}
    head |= {"dterm_lpf1_type": 2.0, "dterm_lpf1_static_hz": 100.0, "ff_weight[0]": 115.0}
    found = controller_of(head, "betaflight", loop="roll rate")
    assert found.gains == pytest.approx({"Kp": 82.5807, "Ki": 1120.16, "Kd": 0.909284}, rel=1e-5)
    assert found.filter.omega == pytest.approx(2 * math.pi * 155.3774)
