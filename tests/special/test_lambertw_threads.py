"""Lambert W in threads: equal bits, callbacks, forks and Ctrl-C."""

import os
import subprocess
import sys
import textwrap
import threading
import time

import deadtime as dtm
import numpy as np
import pytest
from deadtime import _deadtime as native
from lambertw_points import LARGE, one_by_one, points, same_bits


def test_an_element_does_not_depend_on_its_neighbours():
    z, k = points(LARGE, 5), np.random.default_rng(6).integers(-4, 5, LARGE)
    whole = dtm.lambertw(z, k)
    for threads in (1, 2, 3):
        assert same_bits(dtm.lambertw(z, k, threads=threads), whole)
    generator = np.random.default_rng(7)
    for _ in range(30):
        start = generator.integers(LARGE)
        part = slice(start, start + generator.integers(1, 3_000), generator.integers(1, 4))
        assert same_bits(dtm.lambertw(z[part], k[part]), whole[part])
    some = generator.integers(0, LARGE, 200)
    assert same_bits(one_by_one(z[some], k[some]), whole[some])
    with np.errstate(all="ignore"):
        chunked = native.lambertw(z.astype(">c16"), k.astype(np.int8))
    assert same_bits(chunked, whole)


@pytest.mark.parametrize("name", ["lambertw0", "lambertwm1"])
def test_real_elements_do_not_depend_on_their_neighbours(name):
    function = getattr(dtm, name)
    x = np.random.default_rng(8).uniform(-0.4, 0.1, LARGE)
    whole = function(x)
    assert same_bits(function(x, threads=1), function(x, threads=2))
    assert same_bits(function(x[7:900:3]), whole[7:900:3])
    assert same_bits(np.array([function(value) for value in x[:100]]), whole[:100])
    narrow = x.astype(np.float32)
    assert same_bits(function(narrow), function(narrow.astype(float)).astype(np.float32))


def test_the_limit_of_threads_is_for_one_call():
    assert native.limit_threads(None) is None
    dtm.lambertw(points(3), threads=3)
    with pytest.raises(TypeError):
        dtm.lambertw("x", threads=3)
    for threads in (0, 10**6, 1.5):
        with pytest.raises((TypeError, ValueError), match="threads="):
            dtm.lambertw(1.0, threads=threads)
    assert native.limit_threads(5) is None
    assert native.limit_threads(None) == 5
    seen = []
    native.limit_threads(2)
    worker = threading.Thread(target=lambda: seen.append(native.limit_threads(None)))
    worker.start()
    worker.join()
    assert seen == [None]
    assert native.limit_threads(None) == 2


def test_python_threads_compute_at_once():
    z = points(20_000)
    exact, results = dtm.lambertw(z), [None] * 4

    def work(index):
        results[index] = dtm.lambertw(z)

    workers = [threading.Thread(target=work, args=(index,)) for index in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert all(same_bits(result, exact) for result in results)


def test_the_interpreter_runs_on_while_a_loop_works():
    worker = threading.Thread(target=dtm.lambertw, args=(points(2_000_000),), kwargs={"threads": 1})
    worker.start()
    ticks = 0
    while worker.is_alive():
        ticks += 1
        time.sleep(0.001)
    # With the lock held, this loop would run only a few times.
    assert ticks > 20


@pytest.mark.parametrize("threads", [1, 2])
def test_a_kernel_may_call_back_into_a_loop(threads):
    # NumPy detaches from the interpreter here while pyo3 believes the thread attached.
    z, results = points(LARGE), []

    def progress(done):
        if not results:
            results.append(dtm.lambertw(z, threads=threads))

    Kp, T = dtm.parameters("Kp T")
    ranges = {"Kp": (0.1, 3.0), "T": (0.1, 0.5)}
    family = dtm.s + Kp * dtm.delay(T)
    dtm.stability_map(family, ranges, (99, 99), proof="cells", threads=2, progress=progress)
    assert same_bits(results[0], dtm.lambertw(z))


def run_python(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, **environment},
        check=False,
    )


def test_a_forked_child_works_and_does_not_hang():
    result = run_python(
        """
        import os, sys, warnings
        warnings.simplefilter("ignore")
        import deadtime as dtm
        import numpy as np
        z = np.linspace(1, 2, 200_001) + 1j
        before = dtm.lambertw(z)
        child = os.fork()
        if child == 0:
            os._exit(7 if (dtm.lambertw(z) == before).all() else 1)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), (dtm.lambertw(z) == before).all())
        """
    )
    assert result.stdout.split() == ["7", "True"], result.stderr


def test_invalid_environment_variables_are_named():
    code = """
        import deadtime as dtm
        import numpy as np
        dtm.lambertw(np.ones(200_001))
    """
    result = run_python(code, DEADTIME_NUM_THREADS="two")
    assert "ValueError: DEADTIME_NUM_THREADS" in result.stderr


# --- stopping -----------------------------------------------------------------------------

# Seconds of work, of which Ctrl-C must spare us some.
LONG = {
    "in the pool": lambda: np.full(25_000_000, 1.0 + 1.0j),
    "in pieces, for a cast": lambda: np.full(25_000_000, 1),
    "many short loops": lambda: np.full((8_000_000, 4), 1.0 + 1.0j)[:, :3],
}


@pytest.mark.usefixtures("listens_to_ctrl_c")
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("kind", LONG)
def test_ctrl_c_stops_a_loop_and_leaves_nothing_behind(kind, threads):
    z = LONG[kind]()
    w = np.zeros(z.shape, complex)

    # Another process sends the signal: a thread of this one may wait for the interpreter lock.
    signalling = subprocess.Popen(["sh", "-c", f"sleep 0.2; kill -INT {os.getpid()}"])
    with pytest.raises(KeyboardInterrupt):
        dtm.lambertw(z, threads=threads, out=w)
    signalling.wait()
    assert (w == 0).any()
    # The next calls are whole.
    z = points(LARGE)
    assert same_bits(dtm.lambertw(z), dtm.lambertw(z, threads=1))
