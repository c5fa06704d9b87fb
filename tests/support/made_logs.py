"""Log files with known content, written as their formats are documented."""

import struct

import numpy as np

KINDS = {
    "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d", "n": "4s",
    "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "q": "q",
    "Q": "Q",
}  # fmt: skip


class DataFlash:
    """A binary DataFlash log; `data` are its bytes."""

    def __init__(self):
        self.data = b""
        self.forms = {}
        self.define("FMT", 0x80, "BBnNZ", "Type,Length,Name,Format,Columns")

    def define(self, name, number, form, columns, length=None):
        self.forms[name] = (number, struct.Struct("<" + "".join(KINDS[k] for k in form)))
        size = 3 + self.forms[name][1].size if length is None else length
        texts = (name.encode(), form.encode(), columns.encode())
        self.add("FMT", number, size, *texts)

    def add(self, name, *values):
        number, packed = self.forms[name]
        values = [one.encode() if isinstance(one, str) else one for one in values]
        self.data += b"\xa3\x95" + bytes([number]) + packed.pack(*values)

    def add_rows(self, name, *columns):
        """Many messages of numbers, one for each row of these columns."""
        number, packed = self.forms[name]
        first = b"\xa3\x95" + bytes([number])
        self.data += b"".join(first + packed.pack(*row) for row in zip(*columns, strict=True))

    def units(self, labels, factors, forms):
        """The tables of newer logs: labels and factors by letter, letters by type."""
        self.define("UNIT", 0x81, "QbZ", "TimeUS,Id,Label")
        self.define("MULT", 0x82, "Qbd", "TimeUS,Id,Mult")
        self.define("FMTU", 0x83, "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
        for letter, label in labels.items():
            self.add("UNIT", 0, ord(letter), label)
        for letter, factor in factors.items():
            self.add("MULT", 0, ord(letter), factor)
        for name, (unit, factor) in forms.items():
            self.add("FMTU", 0, self.forms[name][0], unit, factor)


def copter(rows=200, period=0.02):
    """A DataFlash log of a copter whose roll follows its setpoint three rows late."""
    log = DataFlash()
    log.define("MSG", 1, "QZ", "TimeUS,Message")
    log.define("PARM", 2, "QNf", "TimeUS,Name,Value")
    log.define("MODE", 3, "QMB", "TimeUS,Mode,ModeNum")
    log.define("EV", 4, "QB", "TimeUS,Id")
    log.define("ATT", 5, "Qcccc", "TimeUS,DesRoll,Roll,DesPitch,Pitch")
    log.add("MSG", 0, "ArduCopter V4.5.7 (01234567)")
    log.add("MSG", 0, "Frame: QUAD/X")
    log.add("PARM", 0, "ATC_RAT_RLL_P", 0.135)
    log.add("PARM", 0, "BATT_CAPACITY", 5000.0)
    log.add("MODE", 1000, 2, 2)
    log.add("EV", 1000, 10)
    log.add("EV", 2000, 28)
    for k in range(rows):
        at = 10_000 + round(k * period * 1e6)
        log.add("ATT", at, 1000 * (k % 50 < 25), 1000 * ((k - 3) % 50 < 25), 100, 100)
    return log


def as_text(lines):
    return "\n".join(lines).encode() + b"\n"


class ULogFile:
    """A ULog file; `data` are its bytes."""

    def __init__(self, start=1_000_000):
        self.data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", start)
        self.message("B", bytes(40))
        self.numbers = {}

    def message(self, kind, body):
        self.data += struct.pack("<HB", len(body), ord(kind)) + body

    def info(self, kind, key, value):
        named = f"{kind} {key}".encode()
        self.message("I", bytes([len(named)]) + named + value)

    def parameter(self, name, value):
        named = f"float {name}".encode()
        self.message("P", bytes([len(named)]) + named + struct.pack("<f", value))

    def topics(self, formats):
        """Formats of topics, all of floats: name to columns. Before any message."""
        for name, columns in formats.items():
            fields = "".join(f"float {column};" for column in columns)
            self.message("F", f"{name}:uint64_t timestamp;{fields}".encode())
        for number, name in enumerate(formats):
            self.numbers[name] = number
            self.message("A", struct.pack("<BH", 0, number) + name.encode())

    def add(self, name, seconds, *values):
        stamp = struct.pack("<HQ", self.numbers[name], round(seconds * 1e6))
        self.message("D", stamp + np.asarray(values, "<f4").tobytes())

    def add_rows(self, name, seconds, values):
        """Many messages of a topic; values of shape (n, columns)."""
        kind = [("size", "<u2"), ("kind", "S1"), ("topic", "<u2"), ("stamp", "<u8")]
        rows = np.empty(len(seconds), [*kind, ("values", "<f4", values.shape[1])])
        rows["size"], rows["kind"] = rows.dtype.itemsize - 3, b"D"
        rows["topic"], rows["stamp"] = self.numbers[name], np.rint(1e6 * seconds)
        rows["values"] = values
        self.data += rows.tobytes()

    def dropout(self, milliseconds):
        self.message("O", struct.pack("<H", milliseconds))


class Tlog:
    """A tlog with the packets of pymavlink; `data` are its bytes."""

    def __init__(self, system=1, component=1, dialect=None):
        from pymavlink.dialects.v20 import ardupilotmega

        self.dialect = dialect or ardupilotmega
        self.link = self.dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self.data = b""

    def add(self, received, message, old=False):
        """A message that the ground station got at this time, s since 1970."""
        packet = message.pack(self.link, force_mavlink1=old)
        self.link.seq = (self.link.seq + 1) % 256
        self.data += struct.pack(">Q", round(received * 1e6)) + bytes(packet)


#: Truth of the rate loop in `flown_copter`: delay from the controller's command, lag, gain.
DELAY, LAG, GAIN = 0.012, 0.030, 8.0


def flown_copter(
    seconds=12.0, rate=200, noise=0.02, delay=DELAY, seed=4, steps=True, Kp=0.9, parameters=()
):
    """A DataFlash log in which the roll rate follows doublets under a P controller.

    The vehicle is gain/(s (lag s + 1)) behind a delay, exact where that is a multiple of 0.5 ms.
    """
    random = np.random.default_rng(seed)
    log = DataFlash()
    log.define("MSG", 1, "QZ", "TimeUS,Message")
    log.define("PARM", 2, "QNf", "TimeUS,Name,Value")
    log.define("MODE", 3, "QMB", "TimeUS,Mode,ModeNum")
    log.define("EV", 4, "QB", "TimeUS,Id")
    log.define("RATE", 5, "Qfff", "TimeUS,RDes,R,ROut")
    log.add("MSG", 0, "ArduCopter V4.5.7 (01234567)")
    log.add("MSG", 0, "Frame: QUAD/X")
    own = (("INS_GYRO_FILTER", 20.0), ("SCHED_LOOP_RATE", float(rate)))
    for name, value in (*own, *parameters):
        log.add("PARM", 0, name, value)
    log.add("MODE", 1000, 2, 2)
    log.add("EV", 1000, 10)
    log.add("EV", 2000, 28)
    step = 5e-4
    late, every = round(delay / step), round(1.0 / (rate * step))
    decay = np.exp(-step / LAG)
    told = np.zeros(round(seconds / step))
    torque, velocity, sent = 0.0, 0.0, 0.0
    for k in range(told.size):
        at = k * step
        if k % every == 0:
            asked = 40.0 * np.sign(np.sin(2.0 * np.pi * at / 1.1)) * (steps and at > 1.0)
            seen = np.degrees(velocity) + np.degrees(noise) * random.standard_normal()
            sent = Kp * np.radians(asked - seen)
            log.add("RATE", 10_000 + round(at * 1e6), asked, seen, sent)
        told[k] = sent
        arrived = told[k - late] if k >= late else 0.0
        velocity += GAIN * (arrived * step + (torque - arrived) * LAG * (1.0 - decay))
        torque = arrived + (torque - arrived) * decay
    return log
