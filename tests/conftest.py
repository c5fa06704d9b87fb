"""Settings of the property-based tests, and what several test files share."""

import gc
import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers

# Before NumPy is loaded. The matrices of the tests are small, and beside other workers the threads
# of BLAS wait for each other: 30 times four operations on 120 rows took 10 s of processor time
# instead of 0.2 s.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shared machine is slow now and then, which is no failure. The same examples every time: a change
# must not fail on what it did not touch. `pytest --hypothesis-profile=search` looks for new ones.
# Newer versions also draw constants of the modules that are loaded, which differ from run to run.
if hasattr(providers, "_get_local_constants"):
    providers._get_local_constants = lambda: providers._local_constants

settings.register_profile("default", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("search", deadline=None)
settings.load_profile("default")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect without a search for garbage: it finds none, and takes a fifth of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Flights of a firmware first: each takes minutes of real time, and hardly any work."""
    items.sort(key=lambda item: item.get_closest_marker("flight") is None)


@pytest.fixture
def listens_to_ctrl_c():
    """SIGINT raises KeyboardInterrupt, also in a run that was started in the background.

    A shell has its background jobs ignore SIGINT, and Python then leaves it ignored.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def own_folder(request):
    """Links to vehicles keep the old values of parameters in the working directory."""
    # Asked for here, because a folder for each of all other tests takes seconds.
    if request.node.path.parent.name in ("links", "flights"):
        request.getfixturevalue("monkeypatch").chdir(request.getfixturevalue("tmp_path"))
