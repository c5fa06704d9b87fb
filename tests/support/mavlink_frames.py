"""Frames of MAVLink: their checksum, bit by bit, and damaged copies."""


def crc(data, extra):
    """CRC-16/MCRF4XX over the bytes of a frame after the first, and its CRC_EXTRA, bit by bit."""
    value = 0xFFFF
    for byte in (*data, extra):
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
    return value


def damaged(frame, numbers):
    """A copy with flipped, cut, or added bytes that no longer hold it."""
    while True:
        data = bytearray(frame)
        for _ in range(numbers.randint(1, 3)):
            what = numbers.random()
            place = numbers.randrange(len(data)) if data else 0
            if what < 0.7 and data:
                data[place] ^= 1 << numbers.randrange(8)
            elif what < 0.8:
                del data[place:]
            elif what < 0.9:
                data[place:place] = numbers.randbytes(numbers.randint(1, 4))
            else:
                data[place : place + 4] = numbers.randbytes(4)
        if frame not in data:
            return bytes(data)
