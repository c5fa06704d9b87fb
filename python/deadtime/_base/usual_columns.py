"""What the columns of a recording are usually called, for readers and for the explorer."""

from __future__ import annotations

from collections.abc import Mapping

#: Usual names of each signal, the likelier ones first, in small letters and without units.
USUAL: Mapping[str, tuple[str, ...]] = {
    "time": (
        *("time", "t", "sec", "secs", "seconds", "second", "elapsed", "timestamp", "time_stamp"),
        *("datetime", "date_time", "date", "clock"),
    ),
    "reference": ("reference", "ref", "sp", "setpoint", "set_point", "target", "desired", "r"),
    "output": (
        *("output", "pv", "y", "process_value", "process_variable", "measured", "measurement"),
        "height",
    ),
    "command": (
        *("command", "cmd", "op", "mv", "co", "u", "controller_output", "manipulated_variable"),
        *("control", "actuator", "valve"),
    ),
}

#: What a name may end in besides: a unit.
UNITS = ("s", "m", "deg", "rad", "c", "k", "pct", "v", "mps", "degps", "radps")

#: Units of a time stamp that is read as it is.
SECONDS = ("", "s", "sec", "seconds")
