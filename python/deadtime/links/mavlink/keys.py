"""The signing key of a link, from a file."""

from __future__ import annotations

from pathlib import Path

from deadtime.links.mavlink.codec import KEY


def read_key(path: Path) -> bytes:
    r"""The key in a file: 32 bytes, or their 64 hexadecimal digits.

    Raises
    ------
    ValueError
        If the file holds neither.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "key")
    ...     written = path.write_text(bytes(range(32)).hex() + "\n")
    ...     read_key(path) == bytes(range(32))
    True
    """
    with path.open("rb") as file:
        content = file.read(4 * KEY)
    if len(content) == KEY:
        return content
    try:
        key = bytes.fromhex(content.decode("ascii"))
    except ValueError:
        key = b""
    if len(key) != KEY:
        raise ValueError(
            f"{path} contains no signing key: give {KEY} bytes, or their {2 * KEY} "
            "hexadecimal digits"
        )
    return key
