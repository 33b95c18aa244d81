# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The formats of trace files: their suffixes, how they begin, and what each of them loses.

Formats are python-can's, by suffix, and those of Wireshark.
"""

from collections.abc import Callable
from pathlib import Path
import re
from typing import NamedTuple

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.frame import (
    EXTENDED_IDENTIFIER_MAX, Record, RecordKind, STANDARD_IDENTIFIER_MAX)
from drive_can_bridge.trace.captures import BEGINNINGS
from drive_can_bridge.trace.measured import BEGINNINGS as MEASURED_BEGINNINGS

Complain = Callable[[str], None]
#: bytes of a classical frame, and of one of CAN FD, at most
CLASSICAL_MAX, _LENGTH_MAX = 8, 64
#: bytes of a frame that no classical one has
FD_LENGTHS = (12, 16, 20, 24, 32, 48, 64)
#: s since 1970: the end of the year 9999. Beyond, a float soon makes two frames one
TIME_MAX = 253_402_300_800.0
#: suffixes of candump's texts, and of PEAK's
_CANDUMP = ('.log', '.txt', '.candump')
PEAK = '.trc'
BINARY = ('.blf', '.db', '.mf4', '.pcap', '.pcapng')
#: what the formats cannot hold
LOSSES = {
    '.csv': ('which bus a frame was on', 'its direction', 'that a frame is one of CAN FD'),
    '.db': ('which bus a frame was on', 'its direction', 'that a frame is one of CAN FD'),
    '.trc': ('error frames', 'remote frames', 'CAN FD frames', 'the names of buses'),
    '.asc': ('the details of error frames', 'the names of buses'),
    '.blf': ('the names of buses',),
}
#: a format without buses holds those of one only
ONE_BUS = ('.csv', '.db')
WRITABLE = ('.asc', '.blf', '.csv', '.db', '.log', '.trc')
_TEXTS = (*_CANDUMP, PEAK, '.asc', '.csv')
READABLE = tuple(sorted((*_TEXTS, *BINARY)))


class _Head(NamedTuple):
    """The beginning of a format, and the name of a file that begins otherwise."""

    pattern: re.Pattern[bytes]
    otherwise: str


#: bytes that a pattern of a binary format looks at, at most
_MAGIC = 16
HEADS = {
    '.asc': _Head(re.compile(rb'\s*(?:date|base|begin|no|internal|//|\d+\.\d+\s)', re.IGNORECASE),
                  'this is no .asc trace of Vector: it begins with neither "date" nor "base"'),
    '.csv': _Head(re.compile(rb'timestamp,arbitration_id,'),
                  'this is no .csv trace of python-can: its first line is not '
                  '"timestamp,arbitration_id,…"'),
    '.trc': _Head(re.compile(rb'\s*(?:;|\d+\)?\s)'),
                  'this is no .trc trace of PEAK: its first line is neither a comment (;) nor a '
                  'numbered entry'),
    '.blf': _Head(re.compile(b'LOGG'), 'this is no .blf trace of Vector'),
    '.db': _Head(re.compile(b'SQLite format 3'), 'this is no .db trace of python-can'),
    '.mf4': _Head(re.compile(MEASURED_BEGINNINGS), 'this is no .mf4 trace (ASAM MDF 4)'),
    '.pcap': _Head(re.compile(BEGINNINGS), 'this is no capture of Wireshark'),
    '.pcapng': _Head(re.compile(BEGINNINGS), 'this is no capture of Wireshark'),
}
#: first lines of texts that have a suffix of ours, and what makes a trace of them that is read
STRANGERS = (
    (re.compile(r'\W*\*{3}BUSMASTER'), 'this is a .log of BUSMASTER, which editcap (of Wireshark) '
     'turns into a .pcapng: editcap FILE.log FILE.pcapng'),
    (re.compile(r'Time Stamp,ID,Extended,'), 'this is a .csv of SavvyCAN (GVRET), which SavvyCAN '
     'saves as a .log of candump'),
    (re.compile(r'//-+\s+Microchip'), 'this is a .log of Microchip (CAN BUS Analyzer), which '
     'SavvyCAN reads, and saves as a .log of candump'),
    (re.compile(r'[0-9]+\.[0-9]+ [0-9]?(?:CXX|[RT](?:11|29)) '), 'this is a trace of OVMS (CRTD), '
     'which SavvyCAN reads, and saves as a .log of candump'),
    (re.compile(r'@ TEXT @'), 'this is a .trc of CAN Bus Analyzer, which SavvyCAN reads, and '
     'saves as a .log of candump'),
)


class UnknownFormat(ValueError):
    """No reader or writer for this suffix."""


def check_readable(path: Path) -> tuple[str, bool]:
    """
    Check that there is a trace that can be read, before anything else is started.

    :return: the suffix of the format, and whether the file is packed.
    :raises UnknownFormat: no format has this suffix.
    :raises OSError: the file cannot be read.
    """
    packed = path.suffix.lower() == '.gz'
    suffix = Path(path.stem).suffix.lower() if packed else path.suffix.lower()
    if suffix not in (_TEXTS + (() if packed else BINARY)):
        raise UnknownFormat(command_sentences.unknown_suffix(
            path=path, suffix=suffix or '(none)', known=', '.join(READABLE)))
    path.open('rb').close()
    return suffix, packed


def check_writable(path: Path, buses: int) -> None:
    """
    Check that a trace of so many buses can be written in the format of this suffix.

    :raises UnknownFormat: it cannot.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITABLE:
        raise UnknownFormat(command_sentences.suffix_not_written(
            path=path, suffix=suffix or '(none)', known=', '.join(WRITABLE)))
    if suffix in ONE_BUS and buses > 1:
        raise UnknownFormat(command_sentences.suffix_of_one_bus(
            path=path, suffix=suffix, buses=buses))


def begins_as(suffix: str, path: Path, complain: Complain) -> bool:
    """Return whether a file begins as those of its suffix; an empty one does not."""
    head = HEADS[suffix]
    with path.open('rb') as file:
        begin = file.read(_MAGIC)
    if begin and not head.pattern.match(begin):
        complain(head.otherwise)
    return head.pattern.match(begin) is not None


def checked(record: Record) -> Record:
    """
    Return an entry, after checking that it is possible at all.

    :raises ValueError: it is not.
    """
    longest = _LENGTH_MAX if record.kind is RecordKind.FD else CLASSICAL_MAX
    if len(record.data) > longest and record.kind is not RecordKind.STATE:
        raise ValueError(f'{len(record.data)} data bytes')
    highest = EXTENDED_IDENTIFIER_MAX if record.extended else STANDARD_IDENTIFIER_MAX
    if record.kind is not RecordKind.ERROR and not 0 <= record.identifier <= highest:
        raise ValueError(f'identifier {record.identifier:X}h')
    if not -TIME_MAX < record.time < TIME_MAX:    # nor NaN
        raise ValueError(f'time {record.time}')
    return record
