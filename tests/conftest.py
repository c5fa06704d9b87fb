"""Settings of the property-based tests."""

import os

from hypothesis import settings

# A shared machine is slow now and then, which is no failure; and a landing that was right must not
# fail on the next run, so that the search for new examples is left to those who run it by hand.
settings.register_profile("default", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "default")
