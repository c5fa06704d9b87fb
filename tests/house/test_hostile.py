"""Invalid arguments: each is refused by name, none hangs or gives a wrong result."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import deadtime as dtm
import numpy as np
import pytest
from command_line import found, one_clear_line, run, run_elsewhere

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36)
SAMPLED = LOOP.replace(sample_time=0.065)


@pytest.mark.parametrize("loop", [LOOP, SAMPLED])
@pytest.mark.parametrize("bad", ["abc", None, [0.0, 1j], np.array([0, 1j]), [[0], [1, 2]]])
def test_times_and_references_are_real_numbers(loop, bad):
    with pytest.raises((TypeError, ValueError), match="time"):
        loop.simulate(bad)
    with pytest.raises((TypeError, ValueError), match="reference"):
        loop.simulate([0.0, 1.0], bad)


def test_command_histories_are_real_numbers():
    with pytest.raises(TypeError, match="command_history"):
        SAMPLED.simulate([0.0, 1.0], command_history=["x"])


@pytest.mark.parametrize("kind", [dtm.P, dtm.Integrator, dtm.delay])
def test_text_is_no_number(kind):
    with pytest.raises(TypeError, match="'2'"):
        kind("2")


def test_whole_numbers_beyond_the_range_of_doubles_are_refused():
    with pytest.raises(ValueError, match="Kp"):
        dtm.P(10**400)


@pytest.mark.parametrize("loop", [LOOP, SAMPLED])
@pytest.mark.parametrize("n", ["x", 2.5, None])
def test_the_number_of_poles_is_whole(loop, n):
    with pytest.raises(TypeError, match="whole number"):
        loop.rightmost(n)


@pytest.mark.parametrize(
    "bad",
    [
        {"settling": -1.0},
        {"settling": "a"},
        {"rise": (0.9, 0.1)},
        {"rise": (0.1, np.nan)},
        {"steady_state": np.nan},
    ],
)
def test_metrics_of_a_response_have_sensible_bounds(bad):
    response = LOOP.simulate(np.linspace(0.0, 10.0, 101))
    with pytest.raises((TypeError, ValueError), match=next(iter(bad))):
        response.info(**bad)


@pytest.mark.parametrize("num", [1.0, None])
def test_polynomials_are_sequences(num):
    with pytest.raises(TypeError, match="num="):
        dtm.RationalPlant(num, [1.0, 1.0])
    with pytest.raises(TypeError, match="lags="):
        dtm.FactoredPlant(num)


@pytest.mark.parametrize("name", ["", "a b", "s", "lambda", 3])
def test_parameters_made_one_by_one_have_names_too(name):
    with pytest.raises((TypeError, ValueError), match=r"name|'s'"):
        dtm.roots.Parameter(name)


def test_algebra_takes_numbers_in_arrays_of_no_dimension():
    (K,) = dtm.parameters("K")
    assert K * np.array(2.0) == 2.0 * K
    assert K / np.array(2.0) == 0.5 * K


@pytest.mark.parametrize("one", [dtm.s + 1, dtm.parameters("K")[0]])
def test_attributes_of_frozen_objects_cannot_be_deleted(one):
    with pytest.raises(AttributeError, match="cannot be changed"):
        del one._native


@pytest.mark.parametrize("threads", [-1, 10**6, 10**30, 2.5, "2"])
def test_numbers_of_threads_that_no_machine_has(threads):
    # A million threads once made the whole machine unusable.
    A, B = dtm.parameters("A B")
    ranges = {"A": (0, 1), "B": (0, 1)}
    with pytest.raises((TypeError, ValueError), match="threads="):
        dtm.stability_map(dtm.s + A + B * dtm.delay(1.0), ranges, (2, 2), threads=threads)
    with pytest.raises((TypeError, ValueError), match="threads="):
        dtm.lambertw([1.0], threads=threads)


@pytest.mark.parametrize(("gain", "delay"), [(1e300, 0.36), (1e-300, 0.36), (2.0, 1e-200)])
def test_numbers_near_the_ends_of_double_precision_do_not_hang(gain, delay):
    # The bisection for the bound of the roots did not end if a product overflowed.
    code = (
        "import deadtime as dtm\n"
        f"try: print(dtm.ControlLoop(dtm.Integrator(), dtm.P({gain}), delay={delay}).rightmost())\n"
        "except ValueError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.strip()


def test_a_refused_abscissa_says_the_true_reason():
    # The message once said that it is a constant, or that it needs more lines.
    loops = {
        omega: LOOP.replace(controller=dtm.PV(2.0, 0.3, filter=dtm.DerivativeFilter(omega)))
        for omega in (1e20, 1e100, 1e153)
    }
    ideal = LOOP.replace(controller=dtm.PV(2.0, 0.3)).spectral_abscissa()
    # As long as omega squared does not overflow, such a filter has no effect.
    assert abs(loops[1e20].spectral_abscissa() - ideal) < 1e-13
    assert abs(loops[1e100].spectral_abscissa() - ideal) < 1e-13
    with pytest.raises(ValueError, match="differ too much for double precision"):
        loops[1e153].spectral_abscissa()
    with pytest.raises(ValueError, match="constant"):
        (0.0 * dtm.s + 1.0).spectral_abscissa()


# Recordings


def table(tmp_path, rows, head="time,reference,output"):
    file = tmp_path / "flight.csv"
    file.write_text("\n".join([head, *rows]))
    return file


def rows(sample="{t},{r},{y}", step=0.1, size=1.0):
    return [
        sample.format(t=step * k, r=size * (k > 9), y=size * max(0, k - 13) / 40) for k in range(60)
    ]


@pytest.mark.parametrize(
    ("sample", "head", "words"),
    [
        ("0,{t};0;0", "time;reference;output", "decimal point"),
        ("0,{t},0,5,0,5", "time,reference,output", "6 cells, but there are 3 column names"),
        ("{t},{r},1_000", "time,reference,output", "'1_000'"),
    ],
)
def test_ambiguous_cells_of_a_table_are_refused(tmp_path, sample, head, words):
    listed = [one.replace("0.", "") for one in rows(sample)] if "0,{t}" in sample else rows(sample)
    with pytest.raises(dtm.RecordingError, match=words):
        dtm.read_recording(table(tmp_path, listed, head))


def test_values_whose_squares_overflow_are_refused(tmp_path):
    with pytest.raises(dtm.RecordingError, match="another unit"):
        dtm.read_recording(table(tmp_path, rows(size=1e300)))


def test_complex_recordings_are_refused():
    times = np.arange(10.0)
    with pytest.raises(dtm.RecordingError, match="complex"):
        dtm.Recording(times, times, times * 1j)


def test_fits_that_would_take_minutes_are_refused():
    times = np.arange(60_000) * 1e-3
    step = (times > 1.0).astype(float)
    with pytest.raises(dtm.RecordingError, match="60000 samples"):
        dtm.estimate_delay(dtm.Recording(times, step, step), LOOP)
    hours = np.arange(60) * 1e5
    flight = dtm.Recording(hours, (hours > 1e6) * 1.0, (hours > 2e6) * 1.0)
    with pytest.raises(dtm.NotIdentifiableError, match="time stamps"):
        dtm.estimate_delay(flight, SAMPLED)


@pytest.mark.parametrize("kind", ["noise", "wrong sign"])
def test_outputs_that_do_not_respond_to_a_step_are_refused(kind):
    # A gain at the bound of its search was once returned with verdict="reliable".
    times = np.arange(150) * 0.065
    step = (times > 1.0).astype(float)
    output = {
        "noise": np.random.default_rng(1).standard_normal(150),
        "wrong sign": -SAMPLED.simulate(times, step, reference_time=times).outputs,
    }[kind]
    with pytest.raises(dtm.NotIdentifiableError, match="the search ends at its bound"):
        dtm.estimate_delay(dtm.Recording(times, step, output), SAMPLED.replace(delay=None))


# Commands


#: Commands that would take minutes, and words of what refuses them.
SLOW = {
    "simulate --kp 2 --delay 0.36 --duration inf": "--duration=inf",
    "simulate --kp 2 --delay 1e-6": "--delay is 1e-06 s",
    "simulate --kp 2 --delay 0.36 --kv 0.1 --filter 1e6": "one over --filter",
    "simulate --kp 2 --delay 0.36 --sample-time 1e-9": "--sample-time",
    "simulate --kp 2 --delay 0.36 --duration 1e300": "--delay is 0.36 s",
    "design --delay 0.36 --lag 1e-9": "--lag is 1e-09 s",
}


def test_simulations_that_would_take_minutes_are_refused_on_one_line(tmp_path):
    for done, words in zip(
        run_elsewhere(*map(str.split, SLOW), cwd=tmp_path, timeout=60.0), SLOW.values(), strict=True
    ):
        assert done.returncode == 1
        assert words in (said := one_clear_line(done))
        assert "\n" not in said


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is sent as a signal")
@pytest.mark.usefixtures("listens_to_ctrl_c")
def test_ctrl_c_ends_a_command_with_one_line(tmp_path):
    slow = ["map", "--delay", "0.36", "--shape", "3000", "3000"]
    code = "import sys; from deadtime._cli import main; print('up', flush=True); main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *slow],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    assert process.stdout.readline() == "up\n"
    time.sleep(0.2)  # in any state: importing, reading options or counting
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said.splitlines()) == (130, ["deadtime: interrupted"])


def test_ctrl_c_during_an_import_ends_a_command_and_becomes_no_other_error(tmp_path):
    code = """
        import signal
        from deadtime._cli.interruption import ended_by_ctrl_c

        class Interrupted:
            def __set_name__(self, owner, name):
                signal.raise_signal(signal.SIGINT)

        signal.signal(signal.SIGINT, signal.default_int_handler)
        with ended_by_ctrl_c():
            pass
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        with ended_by_ctrl_c():
            class Owner:
                attribute = Interrupted()
    """
    program = [sys.executable, "-c", textwrap.dedent(code)]
    done = subprocess.run(program, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, done.stderr) == (130, "deadtime: interrupted\n")


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    where = tmp_path / "nowhere" / "step.csv"
    done = run("simulate", "--kp", 2, "--delay", 0.36, "--out", where)
    assert done.returncode == 1
    assert done.stderr == f"deadtime: {where}: No such file or directory\n"


def test_metrics_that_do_not_exist_are_words_in_print_and_null_in_json():
    slow = ["simulate", "--kp", 1e-6, "--delay", 0.36]
    printed = run(*slow)
    assert printed.returncode == 0
    assert "nan" not in printed.stdout
    assert "not within the simulated time" in printed.stdout
    assert found(*slow)["info"]["settling_time"] is None
