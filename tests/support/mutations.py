"""Damaged copies of small files: bytes changed, lost, doubled and moved."""


def mutated(data, rng):
    """A copy with one to eight damages; half of them are cut off as well."""
    found = bytearray(data)
    for _ in range(rng.integers(1, 9)):
        if not found:
            break
        at = int(rng.integers(len(found)))
        size = int(rng.integers(1, 64))
        match rng.integers(7):
            case 0:
                found[at] = int(rng.integers(256))
            case 1:
                found[at] ^= 1 << int(rng.integers(8))
            case 2:
                found[at] = int(rng.choice([0, 1, 127, 128, 255]))
            case 3:
                del found[at : at + size]
            case 4:
                found[at:at] = found[at : at + size]
            case 5:
                found[at:at] = rng.bytes(size)
            case 6:
                other = int(rng.integers(len(found)))
                found[at : at + size] = found[other : other + size]
    if rng.random() < 0.5:
        del found[int(rng.integers(len(found) + 1)) :]
    return bytes(found)
