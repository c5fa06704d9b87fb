"""Exit codes of the commands; 0 is an answer, an error is 1."""

from __future__ import annotations

#: The recording does not determine what was asked for: the verdict is "none".
NONE = 3

#: A defect: that of an error within a program, as `sysexits.h` has it.
DEFECT = 70
