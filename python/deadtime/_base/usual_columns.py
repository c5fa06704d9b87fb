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

#: How many of a unit of time make a second, by what a name of a column says of it.
SECOND_IN: Mapping[str, float] = {
    **dict.fromkeys(("", "s", "sec", "secs", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 1e3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microseconds"), 1e6),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanoseconds"), 1e9),
    **dict.fromkeys(("min", "mins", "minutes"), 1.0 / 60.0),
    **dict.fromkeys(("h", "hr", "hours"), 1.0 / 3600.0),
}
