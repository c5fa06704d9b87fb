"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    BlackboxFrames as BlackboxFrames,
    blackbox_frames as blackbox_frames,
)
