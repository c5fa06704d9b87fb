"""Texts from elsewhere, made fit for a terminal: it obeys characters that it does not show."""


def printable(text: str) -> str:
    r"""The text with every character escaped that is not shown, but for ends of lines and tabs.

    Examples
    --------
    >>> print(printable("a\x1b[2Jb"))
    a\x1b[2Jb
    """
    return "".join(
        each if each.isprintable() or each in "\n\t" else ascii(each)[1:-1] for each in text
    )
