"""Settings of the property-based tests, and what several test files share."""

import os
import signal

import pytest
from hypothesis import settings

# A shared machine is slow now and then, which is no failure; and a landing that was right must not
# fail on the next run, so that the search for new examples is left to those who run it by hand.
settings.register_profile("default", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "default")


@pytest.fixture
def listens_to_ctrl_c():
    """SIGINT raises KeyboardInterrupt, also in a run that was started in the background.

    A shell has its background jobs ignore SIGINT, and Python then leaves it ignored.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
