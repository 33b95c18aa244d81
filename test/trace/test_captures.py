# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Captures of Wireshark.

Those in ``captures/`` were made by text2pcap, mergecap and editcap of Wireshark 4.0.17: one
interface (link type 227), two, "any" (113, 276), what editcap makes of a BUSMASTER .log and of a
candump .log (252), and one of Ethernet.
"""

from pathlib import Path
from struct import pack, unpack_from
import sys

import pytest

from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.frame import Record, RecordKind
from drive_can_bridge.trace.files import read_records

CAPTURES = Path(__file__).parent / 'captures'
#: 2026-11-21 10:20:30
BEGIN = 1_795_256_430.0
DATA, ERROR, REMOTE, FD = (RecordKind[name] for name in ('DATA', 'ERROR', 'REMOTE', 'FD'))
READ = bytes.fromhex('4041600000000000')
ANSWER = bytes.fromhex('4B41600037120000')
TWELVE = bytes(range(12))
TWICE = ('frames that stand twice, going out and coming back (a capture of "any"): {}; each is '
         'taken once')
CUT = 'the rest cannot be read: it is damaged, or cut'


@pytest.fixture
def scapy() -> None:
    pytest.importorskip('scapy.utils')


def read(path: Path) -> tuple[list[Record], list[str]]:
    complaints: list[str] = []
    records = [each._replace(time=round(each.time - BEGIN, 6))
               for each in read_records(path, complaints.append)]
    return records, complaints


def one_interface(channel: str) -> list[Record]:
    return [
        Record(0.0, channel, 0x605, READ, False), Record(0.002, channel, 0x585, ANSWER, False),
        Record(0.1, channel, 4, bytes.fromhex('0008000000000000'), True, ERROR),
        Record(0.2, channel, 0x705, b'', False, REMOTE),
        Record(0.3, channel, 0x3FFFF0, b'\x0A\x0B', True),
        Record(0.4, channel, 0x123, TWELVE, False, FD)]


ANY = [(0.0, 0x605, READ, DATA, True), (0.002, 0x585, ANSWER, DATA, None),
       (0.01, 0x123, TWELVE, FD, True)]


@pytest.mark.usefixtures('scapy')
@pytest.mark.parametrize(('name', 'channel'), [
    ('one_interface.pcap', ''), ('one_interface_ns.pcap', ''), ('one_interface.pcapng', 'can0')])
def test_one_interface(name: str, channel: str) -> None:
    assert read(CAPTURES / name) == (one_interface(channel), [])


@pytest.mark.usefixtures('scapy')
def test_two_interfaces_are_told_apart() -> None:
    records, complaints = read(CAPTURES / 'two_interfaces.pcapng')
    second = Record(0.001, 'can1', 0x706, b'\x7F', False)
    assert (records, complaints) == (sorted([*one_interface('can0'), second]), [])


@pytest.mark.usefixtures('scapy')
@pytest.mark.parametrize(('name', 'channel'), [('any.pcap', ''), ('any.pcapng', 'any')])
def test_what_any_has_twice_is_taken_once(name: str, channel: str) -> None:
    records, complaints = read(CAPTURES / name)
    assert records == [Record(time, channel, identifier, data, False, kind, sent)
                       for time, identifier, data, kind, sent in ANY]
    assert complaints == [TWICE.format(2), 'passed over: packets that are no frames (1)']


@pytest.mark.usefixtures('scapy')
def test_any_of_tcpdump_has_numbers_of_interfaces() -> None:
    records, complaints = read(CAPTURES / 'any_version_2.pcap')
    assert records == [Record(0.0, '#3', 0x605, READ, False, DATA, True),
                       Record(0.002, '#4', 0x585, ANSWER, False)]
    assert complaints == [TWICE.format(1)]


@pytest.mark.usefixtures('scapy')
def test_what_wireshark_made_of_other_makers_traces() -> None:
    records, complaints = read(CAPTURES / 'busmaster.pcapng')
    assert [each[2:4] for each in records] == [(0x705, b'\5'), (0x605, READ)]
    assert complaints == []
    records, complaints = read(CAPTURES / 'candump.pcapng')
    assert [each[2:5] for each in records] == [
        (0x705, b'\5', False), (0x3FFFF0, b'\x0A\x0B', True)]
    assert complaints == []


@pytest.mark.usefixtures('scapy')
def test_packets_of_another_kind_are_counted() -> None:
    assert read(CAPTURES / 'ethernet.pcap') == ([], ['passed over: packets of link type 1 (1)'])


def block(kind: int, content: bytes, order: str) -> bytes:
    size = 12 + len(content)
    return pack(f'{order}LL', kind, size) + content + pack(f'{order}L', size)


def section(order: str, link: int, name: bytes, *packets: bytes) -> bytes:
    """Return a part of a .pcapng with an interface whose clock begins 1000 s later."""
    options = (pack(f'{order}HH', 2, len(name)) + name + bytes(-len(name) % 4)
               + pack(f'{order}HHq', 14, 8, 1000) + bytes(4))
    return (block(0x0A0D0D0A, pack(f'{order}LHHq', 0x1A2B3C4D, 1, 0, -1), order)
            + block(1, pack(f'{order}HxxL', link, 0) + options, order)
            + b''.join(block(6, pack(f'{order}5L', 0, 0, 500_000 * number, len(data), len(data))
                             + data + bytes(-len(data) % 4), order)
                       for number, data in enumerate(packets)))


@pytest.mark.usefixtures('scapy')
def test_sections_have_interfaces_and_byte_orders_of_their_own(tmp_path: Path) -> None:
    cooked = bytes.fromhex('0001011800000000000000000000000C')
    (tmp_path / 'a.pcapng').write_bytes(
        section('<', 227, b'can0', pack('>LBB2xB', 0x123, 1, 0, 5))
        + section('>', 113, b'can1', b'', cooked + pack('>LBB2xB', 0x80000124, 1, 0, 6)))
    complaints: list[str] = []
    assert list(read_records(tmp_path / 'a.pcapng', complaints.append)) == [
        Record(1000.0, 'can0', 0x123, b'\5', False), Record(1000.5, 'can1', 0x124, b'\6', True)]
    assert complaints == ['entry 2: a packet was captured in part']


def test_a_frame_that_was_captured_in_part_is_none(scapy: None, tmp_path: Path) -> None:
    (tmp_path / 'a.pcapng').write_bytes(section('<', 227, b'', pack('>LBB2xB', 0x123, 2, 0, 5)))
    assert read(tmp_path / 'a.pcapng') == ([], ['entry 1: a packet was captured in part'])


@pytest.mark.usefixtures('scapy')
@pytest.mark.parametrize('name', ['one_interface.pcapng', 'one_interface.pcap'])
def test_a_cut_capture(name: str, tmp_path: Path) -> None:
    """At every byte: what is there is read, and a cut is told unless nothing is cut in two."""
    whole = (CAPTURES / name).read_bytes()
    borders, place = {0}, 0 if name.endswith('ng') else 24
    while place <= len(whole):
        borders.add(place)
        if place < len(whole):
            place += (unpack_from('<L', whole, place + 4)[0] if name.endswith('ng')
                      else 16 + unpack_from('<L', whole, place + 8)[0])
        else:
            break
    path = tmp_path / name
    for end in range(5, len(whole)):
        path.write_bytes(whole[:end])
        records, complaints = read(path)
        expected = one_interface('can0' if name.endswith('ng') else '')
        assert records == expected[:len(records)]
        assert complaints == ([] if end in borders else [CUT]), end


def test_without_the_library_a_sentence_says_what_brings_it(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'scapy.utils', None)
    with pytest.raises(DriveCanError, match='needs the Python module scapy'):
        read(CAPTURES / 'one_interface.pcap')


@pytest.mark.parametrize(('name', 'content', 'told'), [
    ('a.log', '***BUSMASTER Ver 3.2.2***\n***PROTOCOL CAN***\n', 'this is a .log of BUSMASTER, '
     'which editcap (of Wireshark) turns into a .pcapng: editcap FILE.log FILE.pcapng'),
    ('a.csv', 'Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n1,0000021A,false,Rx,0,1,FE,\n',
     'this is a .csv of SavvyCAN (GVRET), which SavvyCAN saves as a .log of candump'),
    ('a.log', '//-----\nMicrochip Technology Inc.\nCAN BUS Analyzer\n',
     'this is a .log of Microchip (CAN BUS Analyzer), which SavvyCAN reads, and saves as a .log '
     'of candump'),
    ('a.txt', '166.064000 CXX made by hand\n166.064000 R11 0000021A FE 36\n',
     'this is a trace of OVMS (CRTD), which SavvyCAN reads, and saves as a .log of candump'),
    ('a.trc', '@ TEXT @ 2 @ 64 @\n', 'this is a .trc of CAN Bus Analyzer, which SavvyCAN reads, '
     'and saves as a .log of candump'),
    ('a.pcapng', 'no capture', 'this is no capture of Wireshark'),
])
def test_what_is_read_otherwise(name: str, content: str, told: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(content)
    assert read(tmp_path / name) == ([], [told])
