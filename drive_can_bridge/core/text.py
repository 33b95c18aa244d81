# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Text that others bring, before it reaches a log, diagnostics or a terminal.

A name with a line feed in it forges a line of the log, one with escape sequences writes elsewhere
on the screen, and one of two megabytes fills both.
"""

from collections.abc import Sequence

#: characters of what users or the bus bring
TEXT_MAX = 256
_CUT = '…'


def printable(text: str, limit: int | None = TEXT_MAX) -> str:
    r"""
    Return a text with everything escaped that is not printable, cut to ``limit`` characters.

    :param limit: None: as long as it is.

    >>> printable('gain\n[ERROR] \x1b[2Jno\x9b1m')
    'gain\\n[ERROR] \\x1b[2Jno\\x9b1m'
    """
    if limit is not None and len(text) > limit:
        # what is cut off has not to be looked at: an escaped text is never shorter
        text = text[:limit] + _CUT
    if not text.isprintable():
        text = ''.join(each if each.isprintable() else
                       each.encode('unicode_escape', 'surrogatepass').decode('ascii')
                       for each in text)
    return text if limit is None or len(text) <= limit else text[:limit - 1] + _CUT


def column_lines(headings: Sequence[str], rows: Sequence[Sequence[str]], *,
                 numbers: Sequence[str] = ()) -> list[str]:
    """
    Write a table as lines of columns; nothing is cut.

    :param numbers: headings of columns that are aligned to the right.
    """
    widths = [max(map(len, column)) for column in zip(headings, *rows)]
    return ['  '.join(cell.rjust(width) if heading in numbers else cell.ljust(width)
                      for cell, width, heading in zip(row, widths, headings, strict=True)).rstrip()
            for row in (headings, *rows)]
