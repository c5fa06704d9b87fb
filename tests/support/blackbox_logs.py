"""An encoder of Blackbox logs: frames as a firmware would write them, from rows that are known."""

from dataclasses import dataclass, field

MARK = "H Product:Blackbox flight data recorder by Nicholas Sherlock\n"
SIGNED, UNSIGNED, NEGATIVE_14, TAGGED_8, TAGGED_3, TAGGED_4, NULL, VARIABLE_3 = (
    0,
    1,
    3,
    6,
    7,
    8,
    9,
    10,
)
GROUPS = {TAGGED_8: 8, TAGGED_3: 3, TAGGED_4: 4, VARIABLE_3: 3}


def wrapped(value, bits=32):
    """The low bits of an integer, with a sign."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def unsigned(value):
    value &= 0xFFFFFFFF
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def signed(value):
    value = wrapped(value)
    return unsigned((value << 1) ^ (value >> 31))


def fits(value, bits):
    return -(1 << (bits - 1)) <= value < 1 << (bits - 1)


def tagged_8(values):
    if len(values) == 1:
        return signed(values[0])
    tags = sum(1 << k for k, value in enumerate(values) if value)
    return bytes([tags]) + b"".join(signed(value) for value in values if value)


def tagged_4(values):
    tags, halves = 0, []
    for k, value in enumerate(values):
        count = next(n for n in (0, 1, 2, 4) if value == 0 or (n and fits(value, 4 * n)))
        tags |= (0, 1, 2, 0, 3)[count] << 2 * k
        halves += [value >> 4 * (count - 1 - n) & 15 for n in range(count)]
    halves += [0] * (len(halves) % 2)
    pairs = zip(halves[::2], halves[1::2], strict=True)
    return bytes([tags]) + bytes(high << 4 | low for high, low in pairs)


def in_bytes(values):
    tags, out = 0b11 << 6, b""
    for k, value in enumerate(values):
        count = next(n for n in (1, 2, 3, 4) if fits(value, 8 * n))
        tags |= (count - 1) << 2 * k
        out += (value & (1 << 8 * count) - 1).to_bytes(count, "little")
    return bytes([tags]) + out


def tagged_3(values):
    a, b, c = values
    if all(fits(value, 2) for value in values):
        return bytes([(a & 3) << 4 | (b & 3) << 2 | c & 3])
    if all(fits(value, 4) for value in values):
        return bytes([0b01 << 6 | a & 15, (b & 15) << 4 | c & 15])
    if all(fits(value, 6) for value in values):
        return bytes([0b10 << 6 | a & 63, b & 63, c & 63])
    return in_bytes(values)


def variable_3(values):
    a, b, c = values
    if all(fits(value, 2) for value in values):
        return bytes([(a & 3) << 4 | (b & 3) << 2 | c & 3])
    if fits(a, 5) and fits(b, 5) and fits(c, 4):
        bits = 0b01 << 14 | (a & 31) << 9 | (b & 31) << 4 | c & 15
        return bits.to_bytes(2, "big")
    if fits(a, 8) and fits(b, 7) and fits(c, 7):
        bits = 0b10 << 22 | (a & 255) << 14 | (b & 127) << 7 | c & 127
        return bits.to_bytes(3, "big")
    return in_bytes(values)


def encoded(encodings, values):
    """Values, each with its encoding; neighbours with one that groups are grouped."""
    out, k = b"", 0
    while k < len(values):
        code = encodings[k]
        run = next((n for n in range(k, len(values)) if encodings[n] != code), len(values)) - k
        count = min(run, GROUPS.get(code, 1))
        part = [wrapped(value) for value in values[k : k + count]]
        if code == NULL:
            assert part == [0]
        elif code == NEGATIVE_14:
            out += unsigned(-part[0] & 0x3FFF)
        else:
            write = {
                SIGNED: lambda part: signed(part[0]),
                UNSIGNED: lambda part: unsigned(part[0]),
                TAGGED_8: tagged_8,
                TAGGED_4: tagged_4,
                TAGGED_3: tagged_3,
                VARIABLE_3: variable_3,
            }[code]
            out += write(part)
        k += count
    return out


@dataclass
class Log:
    """A log with the fields ``loopIteration`` and ``time`` first, and others after them.

    `fields` holds, of each further field, its name, whether it is signed, and predictor and
    encoding in I and in P frames.
    """

    fields: list
    revision: str = "Betaflight 4.5.1 (77d01ba3b) STM32F7X2"
    interval: int = 32
    logged: str = "1"
    lines: dict = field(default_factory=dict)
    slow: list = field(default_factory=list)
    gps: list = field(default_factory=list)
    home: list = field(default_factory=list)
    constants: dict = field(default_factory=dict)

    def __post_init__(self):
        first = [
            ("loopIteration", 0, (0, UNSIGNED), (6, NULL)),
            ("time", 0, (0, UNSIGNED), (2, SIGNED)),
        ]
        self.fields = [*first, *self.fields]
        self.names = [name for name, *_ in self.fields]
        self.history = None
        self.coordinates = None

    def head(self):
        text = MARK + "H Data version:2\n"
        columns = list(zip(*self.fields, strict=True))

        def line(letter, what, values):
            return f"H Field {letter} {what}:{','.join(map(str, values))}\n"

        text += line("I", "name", columns[0]) + line("I", "signed", columns[1])
        for letter, kind in (("I", 2), ("P", 3)):
            text += line(letter, "predictor", [codes[0] for codes in columns[kind]])
            text += line(letter, "encoding", [codes[1] for codes in columns[kind]])
        for letter, fields in (("S", self.slow), ("G", self.gps), ("H", self.home)):
            if fields:
                names, signs, codes = zip(*fields, strict=True)
                text += line(letter, "name", names) + line(letter, "signed", signs)
                text += line(letter, "predictor", [code[0] for code in codes])
                text += line(letter, "encoding", [code[1] for code in codes])
        lines = {
            "Firmware type": "Cleanflight",
            "Firmware revision": self.revision,
            "Craft name": "made",
            "I interval": self.interval,
            "P interval": self.logged,
            **self.constants,
            **self.lines,
        }
        return (text + "".join(f"H {name}:{value}\n" for name, value in lines.items())).encode()

    def is_logged(self, iteration):
        some, _, every = self.logged.rpartition("/")
        some = int(some or 1)
        return (iteration % self.interval + some - 1) % int(every) < some

    def left_out(self, iteration):
        k = 0
        while not self.is_logged(iteration + 1 + k):
            k += 1
        return k

    def prediction(self, code, k, row):
        before, earlier = self.history or (None, None)
        constants = self.constants
        return {
            0: lambda: 0,
            1: lambda: before[k],
            2: lambda: 2 * before[k] - earlier[k],
            3: lambda: int((before[k] + earlier[k]) / 2),
            4: lambda: constants["minthrottle"],
            5: lambda: row[self.names.index("motor[0]")],
            6: lambda: before[k] + 1 + self.left_out(before[k]),
            8: lambda: 1500,
            9: lambda: constants["vbatref"],
            11: lambda: int(constants["motorOutput"].split(",")[0]),
        }[code]()

    def main(self, row):
        """A main frame: an I frame where it is due, or nothing came before it."""
        intra = self.history is None or row[0] % self.interval == 0
        codes = [field[2 if intra else 3] for field in self.fields]
        differences = [
            value - self.prediction(code[0], k, row)
            for k, (value, code) in enumerate(zip(row, codes, strict=True))
        ]
        frame = (b"I" if intra else b"P") + encoded([code[1] for code in codes], differences)
        self.history = (row, row if intra else self.history[0])
        return frame

    def slow_frame(self, values):
        return b"S" + encoded([code[1] for _, _, code in self.slow], values)

    def home_frame(self, values):
        self.coordinates = values
        return b"H" + encoded([code[1] for _, _, code in self.home], values)

    def gps_frame(self, values):
        differences, axis = [], 0
        for value, (_, _, code) in zip(values, self.gps, strict=True):
            prediction = 0
            if code[0] == 10:
                prediction = self.history[0][1]
            elif code[0] == 7:
                prediction = self.coordinates[axis]
                axis += 1
            differences.append(value - prediction)
        return b"G" + encoded([code[1] for _, _, code in self.gps], differences)


END = b"E\xffEnd of log\0"


def rate_log(**changes):
    """A log with the fields of a rate loop, encoded as Betaflight does."""
    fields = [
        *((f"axisP[{k}]", 1, (0, SIGNED), (1, SIGNED)) for k in range(3)),
        *((f"axisI[{k}]", 1, (0, SIGNED), (1, TAGGED_3)) for k in range(3)),
        *((f"axisD[{k}]", 1, (0, SIGNED), (1, SIGNED)) for k in range(2)),
        *((f"axisF[{k}]", 1, (0, SIGNED), (1, SIGNED)) for k in range(3)),
        *((f"rcCommand[{k}]", int(k < 3), (0, SIGNED), (1, TAGGED_4)) for k in range(4)),
        *((f"setpoint[{k}]", 1, (0, SIGNED), (1, TAGGED_4)) for k in range(4)),
        ("vbatLatest", 0, (9, NEGATIVE_14), (1, TAGGED_8)),
        ("amperageLatest", 1, (0, SIGNED), (1, TAGGED_8)),
        ("rssi", 0, (0, UNSIGNED), (1, TAGGED_8)),
        *((f"gyroADC[{k}]", 1, (0, SIGNED), (3, SIGNED)) for k in range(3)),
        *((f"debug[{k}]", 1, (0, SIGNED), (3, SIGNED)) for k in range(4)),
        ("motor[0]", 0, (11, UNSIGNED), (3, SIGNED)),
        *((f"motor[{k}]", 0, (5, SIGNED), (3, SIGNED)) for k in range(1, 4)),
    ]
    slow = [
        ("flightModeFlags", 0, (0, UNSIGNED)),
        ("stateFlags", 0, (0, UNSIGNED)),
        *((name, 0, (0, TAGGED_3)) for name in ("failsafePhase", "rxSignalReceived", "valid")),
    ]
    settings = {
        "fields": fields,
        "slow": slow,
        "constants": {"minthrottle": 1070, "vbatref": 1650, "motorOutput": "158,2047"},
        "lines": {
            "gyro_scale": "0x3f800000",
            "looptime": 125,
            "pid_process_denom": 2,
            "rollPID": "45,80,30",
        },
    }
    return Log(**settings | changes)


def rate_rows(count, random, step=1, period=250, start=5_000_000):
    """Rows of `rate_log`: `step` iterations apart, `period` µs each."""
    rows = []
    for number in range(count):
        iteration = number * step
        time = start + iteration * period + int(random.integers(-3, 4))
        row = [iteration, time]
        row += [int(value) for value in random.normal(0, 60, 11)]
        row += [int(value) for value in random.integers(-500, 500, 3)] + [1000 + number % 500]
        row += [int(value) for value in random.normal(0, 300, 3)] + [number % 1000]
        row += [1650 - number % 40, int(random.integers(-5, 600)), 1023]
        row += [int(value) for value in random.normal(0, 300, 3)]
        row += [int(value) for value in random.integers(-32768, 32768, 4)]
        row += [int(value) for value in random.integers(158, 2048, 4)]
        rows.append(row)
    return rows
