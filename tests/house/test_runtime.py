"""Calls into the kernel: threads, interpreter lock, fork, Ctrl-C, progress."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import pytest
from deadtime import _deadtime as native


def run_python(code, **environment):
    environment = {**os.environ, **environment}
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment,
        check=False,
    )


def test_thread_count_takes_argument_then_environment():
    code = """
        from deadtime import _deadtime as native
        print(native.thread_count(), native.thread_count(3))
    """
    assert run_python(code, DEADTIME_NUM_THREADS="2").stdout.split() == ["2", "3"]
    both = run_python(code, DEADTIME_NUM_THREADS="1", RAYON_NUM_THREADS="4")
    assert both.stdout.split() == ["1", "3"]
    rayon = run_python(code, DEADTIME_NUM_THREADS="", RAYON_NUM_THREADS="4")
    assert rayon.stdout.split() == ["4", "3"]


@pytest.mark.parametrize("value", ["two", "-1", "1.5"])
def test_invalid_environment_variables_are_named(value):
    result = run_python(
        "from deadtime import _deadtime as n; n.thread_count()", DEADTIME_NUM_THREADS=value
    )
    assert result.returncode != 0
    assert "DEADTIME_NUM_THREADS" in result.stderr
    assert value in result.stderr


def test_zero_threads_are_refused():
    with pytest.raises(ValueError, match="threads=0"):
        native.thread_count(0)


def test_a_forked_child_works_and_does_not_hang():
    # The pool's threads do not exist in the child; using them would wait for ever.
    result = run_python(
        """
        import os, sys, warnings
        warnings.simplefilter("ignore")
        from deadtime import _deadtime as native
        native.spin(0.05)
        child = os.fork()
        if child == 0:
            native.spin(0.05)
            os._exit(7)
        _, status = os.waitpid(child, 0)
        native.spin(0.05)
        print(os.waitstatus_to_exitcode(status))
        """
    )
    assert result.stdout.strip() == "7", result.stderr


def test_a_fork_in_the_middle_of_a_computation_does_not_hang():
    result = run_python(
        """
        import os, threading, warnings
        warnings.simplefilter("ignore")
        from deadtime import _deadtime as native
        busy = threading.Thread(target=native.spin, args=(0.5,))
        busy.start()
        child = os.fork()
        if child == 0:
            native.spin(0.05)
            os._exit(7)
        _, status = os.waitpid(child, 0)
        busy.join()
        print(os.waitstatus_to_exitcode(status))
        """
    )
    assert result.stdout.strip() == "7", result.stderr


@pytest.mark.usefixtures("listens_to_ctrl_c")
def test_ctrl_c_stops_a_long_call():
    # The promise is 0.2 s on an idle machine; the bound here only tells stopping from not stopping.
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        native.spin(60.0)
    assert time.monotonic() - start < 30.0


def test_two_python_threads_run_two_kernels_at_once():
    # Each call waits for the other to have made progress: one after the other, they would never.
    started = [threading.Event(), threading.Event()]
    outcomes = []

    def call(index):
        def progress(done):
            started[index].set()
            if started[1 - index].is_set():
                raise StopIteration

        try:
            native.spin(20.0, 2, progress)
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
    worker = threading.Thread(target=native.spin, args=(0.5,))
    worker.start()
    ticks = 0
    while worker.is_alive():
        ticks += 1
        time.sleep(0.001)
    # holding the lock would leave this loop a handful of turns
    assert ticks > 50


def test_an_error_of_the_progress_callback_comes_through():
    def progress(done):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        native.spin(20.0, None, progress)
