"""A failed allocation is a `MemoryError` with the size, and the interpreter continues."""

import itertools
import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")

#: A call, the memory it may use in addition to that in use, MiB, and the words of its error.
CASES = {
    "a map": (
        "dtm.stability_map(dtm.s + Kp * dtm.delay(T), RANGES, shape=(7000, 7000))",
        120, "the map needs 233.650 MiB",
    ),
    "proved boxes": (
        "dtm.proved_boxes(dtm.s**2 + (Kp + Kv * dtm.s) * dtm.delay(T), WIDE, tol=1e-9, "
        "max_boxes=10**8)",
        # Either the list asks for more than there is, or the task finds memory scarce before.
        70, "MiB of memory, which is not available",
    ),
    "a robust map": (
        "dtm.robust_map(dtm.s + (Kp + Kv * dtm.s) * dtm.delay(T), {'Kp': (0.1, 3), 'Kv': (0, 1)}, "
        "{'T': (0.1, 0.2)}, shape=(7000, 7000))",
        120, "the map needs 186.920 MiB",
    ),
    "output times": ("LOOP.simulate(np.arange(10_000_000) * 1e-6)", 300, "the response needs"),
    "samples": (
        # The next piece of the response, or the memory that each step looks for.
        "LOOP.replace(sample_time=1e-6).simulate([0.0, 90.0])", 100, "of memory, which is not",
    ),
    "a sweep": (
        "dtm.sweep(LOOP, {'Kp': np.linspace(0.1, 3, 300)}, np.linspace(0, 10, 100_000), "
        "responses=True)",
        300, "the sweep needs 228.882 MiB",
    ),
    "values of a function": (
        "(dtm.s + dtm.delay(1.0))(ONES)", 200, "MiB",
    ),
    "Lambert W": ("dtm.lambertw(ONES)", 100, "MiB"),
    "a dense solution": (
        "dtm.solve_dde(lambda t, y, z: -z[0], (0, 1e6), np.ones(300), 1.0, dense_output=True, "
        "max_step=0.5)",
        80, "MiB",
    ),
    "values of a solution": (
        "dtm.solve_dde(lambda t, y, z: -z[0], (0, 3), np.ones(50), 1.0, dense_output=True)"
        ".sol(np.linspace(0, 3, 1_000_000))",
        120, "the array of values of the solution needs 381.470 MiB",
    ),
    "a strided array": ("LOOP.simulate(STRIDED)", 100, "needs 76.294 MiB"),
}  # fmt: skip

#: Calls with little memory left, whether threads run before or not; MiB.
LITTLE = (
    "SYSTEM.is_stable()",
    "SYSTEM.rightmost()",
    "SYSTEM.poles(re=(-1, 1), im=(-3, 3))",
    "dtm.sweep(LOOP, {'Kp': (0.1, 3, 2000)})",
    "dtm.solve_dde(lambda t, y, z: -z[0], (0, 100), np.ones(30), 1.0)",
    "dtm.stability_map(dtm.s + Kp * dtm.delay(T), RANGES, shape=(300, 300))",
)
LEFT = (1, 3, 8, 24)

#: Each case in a child of its own, which has loaded the package and started no threads.
PROGRAM = """
import json
import os
import re
import resource
import sys
import warnings
import numpy as np
import deadtime as dtm

Kp, Kv, T = dtm.parameters("Kp Kv T")
RANGES = {"Kp": (0.1, 3.0), "T": (0.1, 0.5)}
WIDE = {"Kp": (0.1, 30.0), "Kv": (-1, 30), "T": (0.1, 5)}
LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.8), delay=0.36, sample_time=0.065)
ONES = np.ones(10_000_000, dtype=complex)
STRIDED = np.linspace(0.0, 10.0, 20_000_001)[::2]


rng = np.random.default_rng(0)
SYSTEM = dtm.DelaySystem(
    {
        0.0: rng.normal(size=(60, 60)) / 60**0.5 - 2.0 * np.eye(60),
        1.0: 0.3 * rng.normal(size=(60, 60)) / 60**0.5,
    }
)


def limited(call, room, starts):
    if starts:
        dtm.lambertw(np.ones(100_000))  # starts the threads
    LOOP.simulate([0.0, 1.0])
    used = re.search(r"VmSize:\\s+(\\d+)", open("/proc/self/status").read())[1]
    most = int(used) * 1024 + room * 2**20
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        eval(call)
        said = "it had enough"
    except (MemoryError, ImportError, SystemError) as error:  # the last two: of an import
        said = str(error)
    if room < 48:
        # Python keeps what the call has used, and then there is too little for another one.
        resource.setrlimit(resource.RLIMIT_AS, before)
    print(json.dumps([said, dtm.lambertw(1.0).real, LOOP.simulate([0.0, 1.0]).outputs.size]))


warnings.simplefilter("ignore", DeprecationWarning)
for call, room, starts in json.loads(sys.argv[1]):
    child = os.fork()
    if child == 0:
        limited(call, room, starts)
        sys.stdout.flush()
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        print(json.dumps(["it ended", 0.0, 0]), flush=True)
"""


def said_by(calls):
    """What each call said, and whether the interpreter went on."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(calls)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={**os.environ, "DEADTIME_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "1"},
    )
    return list(map(json.loads, done.stdout.splitlines()))


@pytest.fixture(scope="module")
def outcomes():
    calls = [(call, room, True) for call, room, _ in CASES.values()]
    return dict(zip(CASES, said_by(calls), strict=True))


@pytest.mark.parametrize("case", CASES)
def test_memory_that_runs_out_ends_the_call_alone(case, outcomes):
    # A failed allocation in Rust once ended the whole process with SIGABRT.
    said, *alive = outcomes[case]
    assert CASES[case][2] in said
    assert alive == [0.5671432904097838, 2]


def test_little_memory_ends_no_process():
    # The smallest allocations and the stacks of threads failed: SIGABRT, and an OSError.
    calls = list(itertools.product(LITTLE, LEFT, (False, True)))
    for call, (said, *alive) in zip(calls, said_by(calls), strict=True):
        assert said != "it ended", call
        assert alive == [0.5671432904097838, 2], call
