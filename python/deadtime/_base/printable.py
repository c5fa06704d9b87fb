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


#: Most characters of an error: what a user gave may stand in it, of any length.
LONGEST_ERROR = 600


def one_line(text: str) -> str:
    r"""The text as one line that a terminal shows; a long one loses its middle.

    Examples
    --------
    >>> one_line("no such\nfile")
    'no such file'
    >>> len(one_line("x" * 5000))
    600
    """
    line = printable(" ".join(text.split()))
    if len(line) <= LONGEST_ERROR:
        return line
    end = LONGEST_ERROR // 3
    return f"{line[: LONGEST_ERROR - end - 3]} … {line[-end:]}"
