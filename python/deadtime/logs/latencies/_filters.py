"""Delays of the filters that a log's parameters name.

A filter delays what is slow against its corner by its group delay at zero frequency. For
1/((s/w0)^2 + 2 z s/w0 + 1) this is 2 z/w0, so 1/(2 pi f) for one pole at f, and sqrt(2)/(2 pi f)
for two of Butterworth. A notch (s^2 + w0^2)/(s^2 + s w0/Q + w0^2) delays by 1/(Q w0).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

from deadtime._base.digits import stated
from deadtime.tuning.forms import BIQUAD, PT1, PT2, PT3, pole_in_row

#: Motors of the usual vehicle: Betaflight's head does not name their number.
MOTORS = 4


class FilterDelay(NamedTuple):
    """The delay of one filter.

    Attributes
    ----------
    name : str
        For example ``"gyro low-pass"``.
    path : str
        ``"response"``: on all that the controller sees; ``"D"``: on its derivative alone.
    delay : float
        Group delay at low frequencies, s.
    source : str
        The parameters that tell, with their values.
    """

    name: str
    path: str
    delay: float
    source: str

    def line(self) -> str:
        """The filter in one line."""
        on = "" if self.path == "response" else f", on {self.path} alone"
        return f"{self.name}: {stated(self.delay, 0.0, 's')} ({self.source}){on}"


class Configured(Protocol):
    """What names filters: a log."""

    @property
    def autopilot(self) -> str:
        """Which autopilot it is."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Its parameters."""


def one_pole(corner: float) -> float:
    """Delay of a filter of one pole, s; its corner in Hz."""
    return 1.0 / (2.0 * math.pi * corner)


def two_poles(corner: float) -> float:
    """Delay of a Butterworth filter of two poles, s."""
    return math.sqrt(2.0) * one_pole(corner)


def notch(centre: float, quality: float) -> float:
    """Delay of a notch, s; its centre in Hz."""
    return 1.0 / (quality * 2.0 * math.pi * centre)


def poles_in_row(number: int, corner: float) -> float:
    """Delay of poles of one kind in a row whose corner together, at -3 dB, is `corner`."""
    return number * one_pole(pole_in_row(number, corner))


LOW_PASSES: Mapping[int, Callable[[float], float]] = {
    PT1: one_pole,
    BIQUAD: two_poles,
    PT2: lambda corner: poles_in_row(2, corner),
    PT3: lambda corner: poles_in_row(3, corner),
}


def filters_of(log: Configured) -> tuple[FilterDelay, ...]:
    """The filters on the rates that the parameters of a log name, with their delays.

    Parameters
    ----------
    log : Log
        Of PX4, ArduPilot, Betaflight or INAV.

    Returns
    -------
    tuple of FilterDelay
        Empty where the log holds no such parameters.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from deadtime.logs import filters_of
    >>> log = SimpleNamespace(autopilot="PX4", parameters={"IMU_GYRO_CUTOFF": 40.0})
    >>> [(part.name, round(part.delay, 5)) for part in filters_of(log)]
    [('gyro low-pass', 0.00563)]
    """
    readers = {
        "PX4": _px4, "ArduPilot": _ardupilot, "Betaflight": _betaflight, "INAV": _betaflight,
    }  # fmt: skip
    reader = readers.get(log.autopilot)
    return tuple(reader(log.parameters)) if reader else ()


def filter_lines(log: Configured) -> list[str]:
    r"""The filters of a log, one line each, and one of their sum on the gyro path.

    Parameters
    ----------
    log : Log
        Of PX4, ArduPilot, Betaflight or INAV.

    Returns
    -------
    list of str
        Empty where the log names no filter.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from deadtime.logs import filter_lines
    >>> parameters = {"IMU_GYRO_CUTOFF": 40.0, "IMU_DGYRO_CUTOFF": 30.0}
    >>> print("\n".join(filter_lines(SimpleNamespace(autopilot="PX4", parameters=parameters))))
    gyro low-pass: 5.627 ms (IMU_GYRO_CUTOFF 40)
    low-pass of the derivative: 7.503 ms (IMU_DGYRO_CUTOFF 30), on D alone
    gyro path together: 5.627 ms (1 filter)
    """
    found = filters_of(log)
    gyro = [part for part in found if part.path == "response"]
    lines = [part.line() for part in found]
    if gyro:
        most = "at most " if any(part.name.endswith("at most") for part in gyro) else ""
        total = stated(math.fsum(part.delay for part in gyro), 0.0, "s")
        count = f"{len(gyro)} filter{'s' if len(gyro) > 1 else ''}"
        lines.append(f"gyro path together: {most}{total} ({count})")
    return lines


def _px4(values: Mapping[str, float]) -> list[FilterDelay]:
    """IMU_GYRO_CUTOFF has two poles; IMU_DGYRO_CUTOFF has one where there are two notches."""
    # `VehicleAngularVelocity.hpp`: LowPassFilter2p before the second notch, AlphaFilter since.
    of_derivative = one_pole if "IMU_GYRO_NF0_FRQ" in values else two_poles
    found = _low_pass(values, "gyro low-pass", "response", "IMU_GYRO_CUTOFF", two_poles)
    found += _low_pass(values, "low-pass of the derivative", "D", "IMU_DGYRO_CUTOFF", of_derivative)
    found += _low_pass(values, "low-pass of the derivative", "D", "MC_DTERM_CUTOFF", two_poles)
    found += _notch(values, "notch", "IMU_GYRO_NF_FREQ", "IMU_GYRO_NF_BW")
    for k in (0, 1):
        found += _notch(values, f"notch {k + 1}", f"IMU_GYRO_NF{k}_FRQ", f"IMU_GYRO_NF{k}_BW")
    return found


def _ardupilot(values: Mapping[str, float]) -> list[FilterDelay]:
    """INS_GYRO_FILTER has two poles, the filters of the rate controller have one each."""
    found = _low_pass(values, "gyro low-pass", "response", "INS_GYRO_FILTER", two_poles)
    for prefix, which in (("INS_HNTCH", "harmonic notch"), ("INS_HNTC2", "second harmonic notch")):
        if values.get(f"{prefix}_ENABLE", 0.0) > 0.0:
            found += _harmonics(values, prefix, which)
    for axis, name in (("RLL", "roll"), ("PIT", "pitch"), ("YAW", "yaw")):
        for letter, what, path in (
            ("T", "target", f"the {name} target"),
            ("E", "error", f"the {name} error"),
            ("D", "derivative", "D"),
        ):
            parameter = f"ATC_RAT_{axis}_FLT{letter}"
            found += _low_pass(values, f"low-pass of the {name} {what}", path, parameter, one_pole)
    return found


def _betaflight(values: Mapping[str, float]) -> list[FilterDelay]:
    found = []
    for path, name, prefix, of_type in (
        ("response", "gyro low-pass", "gyro_lowpass", "gyro_lowpass_type"),
        ("response", "gyro low-pass 2", "gyro_lowpass2", "gyro_lowpass2_type"),
        ("response", "gyro low-pass", "gyro_lpf1", "gyro_lpf1_type"),
        ("response", "gyro low-pass 2", "gyro_lpf2", "gyro_lpf2_type"),
        ("D", "low-pass of the derivative", "dterm_lowpass", "dterm_filter_type"),
        ("D", "low-pass 2 of the derivative", "dterm_lowpass2", "dterm_filter2_type"),
        ("D", "low-pass of the derivative", "dterm_lpf1", "dterm_lpf1_type"),
        ("D", "low-pass 2 of the derivative", "dterm_lpf2", "dterm_lpf2_type"),
    ):
        kind = int(values.get(of_type, PT1))
        delay_of = LOW_PASSES.get(kind)
        dynamic = [f"{prefix}_dyn_hz[0]", f"{prefix}_dyn_hz[1]"]
        if delay_of is None:
            continue
        if values.get(dynamic[0], 0.0) > 0.0 and values.get(dynamic[1], 0.0) > 0.0:
            # The corner rises with the throttle: the longest delay is that of the lowest corner.
            low, high = (values[name] for name in dynamic)
            source = f"{prefix}_dyn_hz {low:g} to {high:g}, at {low:g}"
            found.append(FilterDelay(f"dynamic {name}", path, delay_of(low), source))
            continue
        found += _low_pass(values, name, path, f"{prefix}_hz", delay_of)
        found += _low_pass(values, name, path, f"{prefix}_static_hz", delay_of)
    notches = [(f"gyro notch {k + 1}", "response", "gyro_notch", f"[{k}]") for k in (0, 1)]
    for name, path, prefix, place in (
        *notches,
        ("notch of the derivative", "D", "dterm_notch", ""),
    ):
        ends = "hz", "cutoff"
        centre, cutoff = (values.get(f"{prefix}_{end}{place}", 0.0) for end in ends)
        if centre > cutoff > 0.0:
            quality = centre * cutoff / (centre**2 - cutoff**2)
            source = f"{prefix}_hz {centre:g}, {prefix}_cutoff {cutoff:g}"
            found.append(FilterDelay(name, path, notch(centre, quality), source))
    found += _rpm_notches(values)
    quality, lowest = values.get("dyn_notch_q", 0.0) / 100.0, values.get("dyn_notch_min_hz", 0.0)
    count = values.get("dyn_notch_count", 1.0)
    if quality > 0.0 and lowest > 0.0 and count > 0.0:
        source = f"dyn_notch_min_hz {lowest:g}, dyn_notch_q {100.0 * quality:g}, {count:g} notches"
        delay = count * notch(lowest, quality)
        found.append(FilterDelay("dynamic notch, at most", "response", delay, source))
    return found


def _rpm_notches(values: Mapping[str, float]) -> list[FilterDelay]:
    """Notches on the harmonics of each motor: slower motors delay more, down to the lowest."""
    for harmonics, quality, lowest in (
        ("rpm_filter_harmonics", "rpm_filter_q", "rpm_filter_min_hz"),
        ("gyro_rpm_notch_harmonics", "gyro_rpm_notch_q", "gyro_rpm_notch_min"),
    ):
        count, q, least = (values.get(name, 0.0) for name in (harmonics, quality, lowest))
        if values.get("dshot_bidir", 0.0) > 0.0 and count > 0.0 and q > 0.0 and least > 0.0:
            each = sum(notch(k * least, 0.01 * q) for k in range(1, int(count) + 1))
            source = f"{harmonics} {count:g}, {quality} {q:g}, {lowest} {least:g}, {MOTORS} motors"
            return [FilterDelay("rpm notches, at most", "response", MOTORS * each, source)]
    return []


def _harmonics(values: Mapping[str, float], prefix: str, name: str) -> list[FilterDelay]:
    """A notch of ArduPilot at each harmonic that its bits name, all of one relative width."""
    first = _notch(values, name, f"{prefix}_FREQ", f"{prefix}_BW")
    bits = int(values.get(f"{prefix}_HMNCS", 1.0))
    orders = [k + 1 for k in range(bits.bit_length()) if bits >> k & 1] or [1]
    found = []
    for order in orders if first else ():
        which = name if order == 1 else f"{name}, harmonic {order}"
        found.append(first[0]._replace(name=which, delay=first[0].delay / order))
    return found


def _notch(values: Mapping[str, float], name: str, centre: str, width: str) -> list[FilterDelay]:
    at, wide = values.get(centre, 0.0), values.get(width, 0.0)
    if not (at > 0.0 and wide > 0.0):
        return []
    source = f"{centre} {at:g}, {width} {wide:g}"
    return [FilterDelay(name, "response", notch(at, at / wide), source)]


def _low_pass(
    values: Mapping[str, float],
    name: str,
    path: str,
    parameter: str,
    delay_of: Callable[[float], float],
) -> list[FilterDelay]:
    corner = values.get(parameter, 0.0)
    if not corner > 0.0:
        return []
    return [FilterDelay(name, path, delay_of(corner), f"{parameter} {corner:g}")]
