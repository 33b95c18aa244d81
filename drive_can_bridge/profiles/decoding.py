# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The text of a file that some program on some machine has written."""

import codecs

from drive_can_bridge.profiles.errors import ImportFailed

#: what is no table at all, by its first bytes
_OTHERS = (
    (b'PK\x03\x04', 'is a workbook or an archive; save its table as CSV'),
    (b'\xd0\xcf\x11\xe0', 'is an old workbook or document; save its table as CSV'),
    (b'%PDF', 'is a PDF; copy its table into a spreadsheet and save that as CSV'),
    (b'<?xml', 'is XML (an XDD, perhaps); what is read is EDS, DCF and CSV'),
)
#: marks at the beginning, longest first: UTF-32 begins like UTF-16
_MARKS = (
    (codecs.BOM_UTF32_LE, 'utf-32'), (codecs.BOM_UTF32_BE, 'utf-32'),
    (codecs.BOM_UTF8, 'utf-8-sig'), (codecs.BOM_UTF16_LE, 'utf-16'),
    (codecs.BOM_UTF16_BE, 'utf-16'),
)


def decoded(data: bytes) -> str:
    """
    Return the text of a file; line ends are those of Unix.

    Without a mark at its beginning a file that is valid UTF-8 is UTF-8, and any other one is what
    Windows writes in western Europe: cp1252, whose gaps are filled as latin-1 fills them.

    :raises ImportFailed: it is no text.
    """
    for head, what in _OTHERS:
        if data.startswith(head):
            raise ImportFailed(what)
    text = _decoded(data)
    if '\0' in text:
        raise ImportFailed('is no text: it contains NUL characters')
    return text.replace('\r\n', '\n').replace('\r', '\n')


def _decoded(data: bytes) -> str:
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            try:
                return data.decode(encoding)
            except UnicodeDecodeError as error:
                raise ImportFailed(f'begins like {encoding} text and is none: byte {error.start} '
                                   f'({error.reason})') from None
    try:
        return data.decode('utf-8')
    except UnicodeDecodeError:
        return ''.join(_WESTERN[byte] for byte in data)


def _western(byte: int) -> str:
    try:
        return bytes((byte,)).decode('cp1252')
    except UnicodeDecodeError:
        return chr(byte)


_WESTERN = tuple(_western(byte) for byte in range(256))
