"""Damaged copies of small files: bytes changed, lost, doubled, moved and cut off."""

from __future__ import annotations

import random
from collections.abc import Sequence

#: Largest size of a damaged file, bytes.
LARGEST = 4096


def mutated(
    data: bytes,
    draw: random.Random,
    words: Sequence[bytes] = (b"\0", b"\xff"),
    largest: int = LARGEST,
) -> bytes:
    """A copy with one to eight damages, of which one may be a word; the first bytes mostly stay."""
    found = bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 3, 5, 8))):
        start = 0 if draw.random() < 0.1 else min(8, len(found))
        at = draw.randint(start, len(found))
        length = draw.choice((1, 1, 2, 4, 8, 30, 60))
        match draw.randrange(9):
            case 0 if at < len(found):
                found[at] ^= 1 << draw.randrange(8)
            case 1:
                found[at : at + length] = draw.randbytes(length)
            case 2:
                found[at:at] = draw.randbytes(length)
            case 3:
                del found[at : at + length]
            case 4:
                found[at:at] = found[at : at + length]
            case 5:
                other = draw.randint(0, len(found))
                found[at : at + length] = found[other : other + length]
            case 6:
                found[at : at + draw.choice((0, 1, length))] = draw.choice(words)
            case 7:
                number = draw.choice((0, 1, 127, 128, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1))
                width = draw.choice((1, 2, 4))
                order = draw.choice(("little", "big"))
                found[at : at + width] = (number % 256**width).to_bytes(width, order)
            case 8:
                del found[at:]
    return bytes(found[:largest])
