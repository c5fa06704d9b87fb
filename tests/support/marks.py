"""Marks that stand together."""

import pytest

#: The long form of a test whose short form is run by default: by .ci/nightly alone.
NIGHTLY = (pytest.mark.survey, pytest.mark.long)
