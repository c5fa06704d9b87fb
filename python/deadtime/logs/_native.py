"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    BlackboxFrames,
    blackbox_frames,
)

__all__ = [
    "BlackboxFrames",
    "blackbox_frames",
]
