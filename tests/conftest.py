"""Tests take the time they take: no deadline fails on a slow or busy machine."""

from hypothesis import settings

settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")
