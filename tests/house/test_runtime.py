"""Calls into the kernel: threads, interpreter lock, fork, Ctrl-C, progress."""

import inspect
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import deadtime as dtm
import pytest


def judge(cells, **options):
    """Prove a map cell by cell: 20 a side take milliseconds, 200 a second, 2000 minutes."""
    Kp, Kv = dtm.parameters("Kp Kv")
    ranges = {"Kp": (0.1, 6.0), "Kv": (-0.9, 0.9)}
    family = dtm.s + (Kp + Kv * dtm.s) * dtm.delay(0.36)
    return dtm.stability_map(family, ranges, shape=(cells, cells), proof="cells", **options)


def run_python(code, **environment):
    environment = {**os.environ, **environment}
    program = f"import deadtime as dtm\n{inspect.getsource(judge)}\n{textwrap.dedent(code)}"
    return subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment,
        check=False,
    )


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="counts threads as Linux does")
def test_the_number_of_threads_is_the_argument_then_the_environment():
    code = """
        import time
        from pathlib import Path

        def started(**options):
            judge(60, **options)
            for _ in range(1000):
                names = [path.read_text() for path in Path("/proc/self/task").glob("*/comm")]
                found = sum(name.startswith("deadtime") for name in names)
                if found == len(names) - 1:
                    break
                time.sleep(0.01)  # a thread takes its name only once it runs
            return found

        print(started())
    """
    with_argument = code.replace("started()", "started(threads=3)")
    assert run_python(code, DEADTIME_NUM_THREADS="2").stdout.split() == ["2"]
    assert run_python(with_argument, DEADTIME_NUM_THREADS="2").stdout.split() == ["3"]
    both = run_python(code, DEADTIME_NUM_THREADS="1", RAYON_NUM_THREADS="4")
    assert both.stdout.split() == ["1"]
    rayon = run_python(code, DEADTIME_NUM_THREADS="", RAYON_NUM_THREADS="4")
    assert rayon.stdout.split() == ["4"]


@pytest.mark.parametrize("value", ["two", "-1", "1.5"])
def test_invalid_environment_variables_are_named(value):
    result = run_python("judge(20)", DEADTIME_NUM_THREADS=value)
    assert result.returncode != 0
    assert "DEADTIME_NUM_THREADS" in result.stderr
    assert value in result.stderr


def test_zero_threads_are_refused():
    with pytest.raises(ValueError, match="threads=0"):
        judge(20, threads=0)


def test_a_forked_child_works_and_does_not_hang():
    # The threads of the pool do not exist in the child; waiting for them would not end.
    result = run_python(
        """
        import os, sys, warnings
        warnings.simplefilter("ignore")
        judge(20)
        child = os.fork()
        if child == 0:
            judge(20)
            os._exit(7)
        _, status = os.waitpid(child, 0)
        judge(20)
        print(os.waitstatus_to_exitcode(status))
        """
    )
    assert result.stdout.strip() == "7", result.stderr


def test_a_fork_in_the_middle_of_a_computation_does_not_hang():
    result = run_python(
        """
        import os, threading, warnings
        warnings.simplefilter("ignore")
        begun, forked = threading.Event(), threading.Event()

        def progress(done):
            begun.set()
            if forked.is_set():
                raise StopIteration

        def work():
            try:
                judge(2000, progress=progress)
            except StopIteration:
                pass

        busy = threading.Thread(target=work)
        busy.start()
        begun.wait()
        child = os.fork()
        if child == 0:
            judge(20)
            os._exit(7)
        _, status = os.waitpid(child, 0)
        forked.set()
        busy.join()
        print(os.waitstatus_to_exitcode(status))
        """
    )
    assert result.stdout.strip() == "7", result.stderr


def test_ctrl_c_while_the_kernels_are_loaded_interrupts_the_import_and_no_more():
    result = run_python(
        """
        import signal
        import numpy.lib

        signal.signal(signal.SIGINT, signal.default_int_handler)
        version = numpy.lib.NumpyVersion

        def interrupted(text):
            signal.raise_signal(signal.SIGINT)
            return version(text)

        numpy.lib.NumpyVersion = interrupted
        try:
            from deadtime import _deadtime
        except KeyboardInterrupt:
            print("interrupted")
        numpy.lib.NumpyVersion = version
        print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)
        from deadtime import _deadtime
        print(_deadtime.lambertw0_number(0.0))
        """
    )
    assert result.stderr == ""
    assert result.stdout.split() == ["interrupted", "True", "0.0"]


@pytest.mark.usefixtures("listens_to_ctrl_c")
def test_ctrl_c_stops_a_long_call():
    # It takes 0.2 s on an idle machine; the bound here only distinguishes it from not stopping.
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        judge(2000)
    assert time.monotonic() - start < 30.0


def test_two_python_threads_run_two_kernels_at_once():
    # Each call waits for progress of the other, so they end only if they run at the same time.
    started = [threading.Event(), threading.Event()]
    outcomes = []

    def call(index):
        def progress(done):
            started[index].set()
            if started[1 - index].is_set():
                raise StopIteration

        try:
            judge(2000, threads=2, progress=progress)
        except StopIteration:
            outcomes.append("together")
        else:
            outcomes.append("alone")

    threads = [threading.Thread(target=call, args=(index,)) for index in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes == ["together", "together"]


def test_the_interpreter_runs_on_while_a_kernel_works():
    worker = threading.Thread(target=judge, args=(200,))
    worker.start()
    ticks = 0
    while worker.is_alive():
        ticks += 1
        time.sleep(0.001)
    # With the lock held, this loop would run only a few times.
    assert ticks > 50


def test_an_error_of_the_progress_callback_comes_through():
    def progress(done):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        judge(2000, progress=progress)
