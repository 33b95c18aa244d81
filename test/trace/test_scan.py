# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Finding drives: what is found, what is asked, and that nobody is moved by it."""

from dataclasses import replace
import json
import os
from pathlib import Path
from random import Random
from typing import NoReturn

from asked_bus import AskedBus, drive_can, takes_nothing
from extent import SEED
from foreign_devices import (
    cannord, canopen, CROWD as CROWD_OF_ALL, datamodel_extended, datamodel_standard, Device,
)
from literal_adapters import Socketcand
import pytest
from test_trace_agrees import running
from transcripts import replayed, stories
from world import World

from drive_can_bridge.cli import scan as scan_command
from drive_can_bridge.cli.scan import BusScan, LOAD_MAX, write_parameter_file
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.datamodel.extended import DIR
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.scanner import Certainty, Scanner, Sighting
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.simulation import Simulation
from drive_can_bridge.transport import kernel_interfaces
from drive_can_bridge.transport.kernel_interfaces import KernelInterface

STORIES = stories(__file__, 'scan.yaml')
#: what is said of a bus, and of what was asked
SAID = {
    'maps': 'request map 50 51, response map 209 210',
    'node': 'device type 00000000h, vendor 0h',
    'servo': 'device type 00020192h (servo drive of CiA 402), vendor 5505h, product 402h',
    'requests': 'requests to station {} of datamodel_extended',
    'alone': 'send: transmit queue full: no other node acknowledges',
    'master': 'there is another master',
    'passive': 'nothing was asked: --passive',
    'not asked': 'cannord is not asked: there is a CANopen node (5',
    'left': '; not asked: {}: ',
    'hazard': 'cannord: a task on 200h + 2·address is RPDO1',
    'nobody': '--protocols cannord needs --yes where nobody can be asked\n',
    'exists': 'drive_can scan: {} exists. Overwrite? Nothing was sent or written: nobody can be '
              'asked here; --yes overwrites\n',
    'none': 'no drive found',
    'nothing found': '{}: not written, no drive was found\n',
    'next': 'next: drive_can validate {}',
}
BITRATE = 125_000


class Bench(AskedBus):
    """A bus with devices that obey."""

    def __init__(self, *devices: Device) -> None:
        super().__init__(lambda frame: [answer for device in devices
                                        if (answer := device.hear(frame)) is not None])

    def scan(self) -> BusScan:
        return BusScan(BusConfiguration('main', 'virtual', 'x', BITRATE), self, self.clock)


SAFE = [name for name, family in FAMILIES.items() if family.make_scanner().unmistakable]
NAMED = [name for name in FAMILIES if name not in SAFE]
CROWD = (*CROWD_OF_ALL, *(cannord(address, extended=True) for address in range(256)))


def fresh(devices: tuple[Device, ...]) -> tuple[Device, ...]:
    for device in devices:
        device.obeyed.clear()
    return devices


def test_which_families_are_asked_without_being_named() -> None:
    assert SAFE == ['datamodel_extended', 'canopen_pkw', 'cia402']


@pytest.mark.parametrize('protocol', SAFE)
def test_nobody_at_all_obeys_what_is_asked_by_default(protocol: str) -> None:
    bench = Bench(*fresh(CROWD))
    bench.scan().ask(protocol)
    assert len(bench.sent) >= 127
    assert not [device.name for device in CROWD if device.obeyed]


@pytest.mark.parametrize('protocol', NAMED)
def test_what_is_asked_by_name_moves_nobody_but_canopen_nodes(protocol: str) -> None:
    bench = Bench(*fresh(CROWD))
    bench.scan().ask(protocol)
    assert bench.sent
    assert not [device.name for device in CROWD
                if device.obeyed and not device.name.startswith('canopen')]


def test_the_devices_of_this_test_do_obey() -> None:
    for device, command in (
            (datamodel_extended(1), Frame(0x003FFFF0, bytes(8), True)),
            (datamodel_standard(1), Frame(0x3F1, bytes.fromhex('063200DC05000000'), False)),
            (cannord(100), Frame(0x0C8, bytes.fromhex('7F040020'), False)),
            (cannord(100), Frame(0x2C8, bytes.fromhex('66200000000F27FF'), False)),
            # the read of a map at station 2 that writes P515 of inverter 249
            (cannord(249), Frame(0x3F2, bytes.fromhex('037A000400000000'), False)),
            (canopen(5), Frame(0x505, bytes.fromhex('C00200AA01000000'), False)),
            # the task for inverter 2 that is a receive PDO of node 4
            (canopen(4), Frame(0x204, bytes.fromhex('BC12000000000000'), False))):
        device.hear(command)
        assert device.obeyed, device.name


def test_drives_are_found() -> None:
    bench = Bench(datamodel_extended(3), datamodel_extended(127), canopen(9))
    scan = bench.scan()
    for protocol in SAFE:
        scan.ask(protocol)
    assert [(each.protocol, each.station, each.text) for each in scan.sightings] == [
        ('datamodel_extended', 3, SAID['maps']), ('datamodel_extended', 127, SAID['maps'])]
    assert scan.nodes == {9: SAID['node']}
    assert not scan.master

    bench = Bench(cannord(0), cannord(255), datamodel_standard(2), datamodel_standard(15))
    scan = bench.scan()
    for protocol in NAMED:
        scan.ask(protocol)
    assert [(each.protocol, each.station) for each in scan.sightings] == [
        ('datamodel_standard', 2), ('datamodel_standard', 15), ('cannord', 0), ('cannord', 255)]
    assert not scan.master


def test_who_did_not_run_for_a_while_has_not_heard_silence() -> None:
    bench = Bench(datamodel_extended(127))
    bench.stall = 1.0
    scan = bench.scan()
    bench.late.append(Frame(0x123, b'', False))
    scan.listen(0.5)
    assert scan.frames == 1
    scan.ask('datamodel_extended')
    assert [each.text for each in scan.sightings] == [SAID['maps']]


def test_what_came_meanwhile_is_heard_before_more_is_asked() -> None:
    bench = Bench(canopen(9))
    bench.stall = 1.0
    scan = bench.scan()
    bench.late.append(Frame(0x709, b'\x05', False))
    scan.listen(0.5)
    assert scan.nodes
    scan.ask('cannord')
    assert not bench.sent


def frame_of(text: str) -> Frame:
    """Return a frame as candump writes it: eight digits are an identifier of 29 bits."""
    identifier, _, data = text.partition('#')
    return Frame(int(identifier, 16), bytes.fromhex(data), len(identifier) == 8)


def scanned(protocol: str, *frames: tuple[float, str]) -> Scanner:
    scanner = FAMILIES[protocol].make_scanner()
    for time, text in frames:
        scanner.receive(frame_of(text), time)
    return scanner


def heard(protocol: str, *frames: tuple[float, str]) -> list[str]:
    return [sighting.text for sighting in scanned(protocol, *frames).sightings.values()]


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str) -> None:
    def step(step: str) -> list[str]:
        protocol, *words = step.split()
        scanner = scanned(protocol, *zip(map(float, words[::2]), words[1::2]))
        found = [f'{each.station} {each.certainty.value}: {each.text}'
                 for each in scanner.sightings.values()]
        return [*found, f'master: {scanner.master}'] if scanner.master else found
    assert replayed(STORIES[story], step) == STORIES[story]


#: answers of stations 42 and 1
ANSWER_42 = '1548B4D1#0102A5A5A5A5A5A5'
ANSWER_1 = '103FFFF0#0102A5A5A5A5A5A5'


@pytest.mark.parametrize('text', [
    ANSWER_42, ANSWER_1,
    '18E8FF01#01FFFFFFFFEAFE00',    # an acknowledgement of J1939
    '104007A4#0032003300000000',    # a request map
    '104007E4#00D300D100000000',
    '585#4303160120010030',         # a mailbox
    '485#C7010025',
])
def test_what_nobody_asked_for_makes_no_drive(text: str) -> None:
    for protocol in FAMILIES:
        scanner = scanned(protocol, *((0.01 * place, text) for place in range(5)))
        assert not scanner.sightings and not scanner.master
        assert not any(scanner.settings(station).get('remarks') for station in (1, 2, 42))


def test_noise_makes_no_drive() -> None:
    noise = Random(1)
    scanner = FAMILIES['datamodel_extended'].make_scanner()
    for place in range(3000):
        scanner.receive(Frame(noise.getrandbits(29), noise.randbytes(8), True), place / 2000)
    assert not scanner.sightings


#: what masters and drives of every family say, conversations by others included
SAID_ON_BUSES = [
    '705#05', '704#00', '000#0105', '605#4000100000000000', '585#4300100092010200',
    '585#4300100000000000', '585#8000100000000206', '605#4018100100000000',
    *(f'585#431810{place}05550000' for place in ('00', '01', '02', '03')),
    '585#431810010555', '605#4003160100000000', '585#4303160120010030', '585#8003160100000206',
    '585#4303140105050000', '585#4303140105020000', '505#C701002500000000',
    '485#C701002583200000', '0C8#7F040020', '0C9#370F0020', '2C8#6610000000000000',
    '2C9#6610000000006700', '3F2#031E000100000000', '7F2#0000000000000000',
    '004007A4#0000000000000000', '104007A4#0032003300000000', '004007E4#0000000000000000',
    '104007E4#00D300D100000000', '104007A4#FFFF003200320000', '003FFFF0#0000000000000000',
    ANSWER_1]


@pytest.mark.parametrize('place', range(10))
def test_whatever_others_say_in_whatever_order_a_file_can_be_written(
        place: int, tmp_path: Path) -> None:
    choose = Random(int(os.environ[SEED]) + place)
    cycle = [frame_of(text) for text in ('205#0F0000000000', '080#', '185#371200000000')]
    said = [*map(frame_of, SAID_ON_BUSES), *cycle]
    scanners = {protocol: FAMILIES[protocol].make_scanner() for protocol in FAMILIES}
    for turn in range(100):
        frames = choose.choice((cycle * 3, choose.sample(said, 2), [choose.choice(said)]))
        for frame, scanner in ((frame, each) for frame in frames for each in scanners.values()):
            scanner.receive(frame, 0.01 * turn)
            question = scanner.take_question()
            if question is not None:
                scanner.asked(question, 0.01 * turn)
    seen = [each for scanner in scanners.values() for each in scanner.sightings.values()]
    nodes = {node for scanner in scanners.values() for node in scanner.nodes}
    output = tmp_path / 'found.yaml'
    write_parameter_file(output, BusConfiguration('main', 'virtual', 'a', BITRATE), seen, [
        scanners[each.protocol].settings(each.station) for each in seen], nodes)
    assert drive_can('validate', output) == 0


def test_one_frame_before_all_stations_are_asked_makes_no_drive() -> None:
    bench = Bench(datamodel_extended(3))
    scan = bench.scan()
    bench.arriving += frame_of(ANSWER_42), frame_of(ANSWER_1)
    scan.listen(0.5)
    scan.ask('datamodel_extended')
    assert [(each.station, each.certainty) for each in scan.sightings] == [
        (3, Certainty.CERTAIN)]


@pytest.mark.parametrize(('request_', 'answer', 'text', 'certainty'), [
    ('0548B4D1#0000000000000000', ANSWER_42, 'answers to reads of P35661', Certainty.LIKELY),
    ('003FFFF0#0000000000000000', ANSWER_1, 'cyclic responses', Certainty.CERTAIN),
    ('004007A4#0000000000000000', '104007A4#0032003300000000', 'request map 50 51',
     Certainty.CERTAIN),
])
def test_a_29_bit_drive_of_another_master(request_: str, answer: str, text: str,
                                          certainty: Certainty) -> None:
    pair = (0.0, request_), (0.01, answer)
    again, late = ((0.5, request_), (0.51, answer)), ((0.5, request_), (0.7, answer))
    other = (0.5, '0548B4E1#0000000000000000')
    for frames in (pair, (*pair, pair[1]), (*pair, *late), (*pair, other, again[1])):
        assert heard('datamodel_extended', *frames) == []
    scanner = scanned('datamodel_extended', *pair, *again)
    [sighting] = scanner.sightings.values()
    assert sighting[2:] == (text, certainty)
    assert scanner.master == SAID['requests'].format(sighting.station)


def test_a_mailbox_that_another_master_asks_for() -> None:
    pair = (0.0, '605#4003160100000000'), (0.01, '585#4303160120010030')
    other = (0.02, '605#4003160000000000')
    assert heard('canopen_pkw', *pair) == heard('canopen_pkw', *pair, other, pair[1]) == []
    scanner = scanned('canopen_pkw', *pair, *pair)
    assert [sighting.certainty for sighting in scanner.sightings.values()] == [Certainty.CERTAIN]
    # whatever it is, it is there: nothing is asked that it might take for a command
    assert list(scanned('canopen_pkw', pair[1]).nodes) == [5]


@pytest.mark.parametrize('protocol', [name for name, family in FAMILIES.items()
                                      if family.on_canopen])
def test_a_drive_of_cia_402_says_so_whoever_asked(protocol: str) -> None:
    objects = {'001000': '92010200', '181001': '05550000', '181002': '02040000'}

    def answers(frame: Frame) -> Frame | None:
        content = objects.get(frame.data[1:4].hex())
        if frame.identifier != 0x606:
            return None
        return Frame(0x586, bytes.fromhex('80') + frame.data[1:4] + bytes.fromhex('00000206')
                     if content is None else
                     b'\x43' + frame.data[1:4] + bytes.fromhex(content), False)

    bench = Bench(Device('node 6', lambda frame: False, answers))
    scan = bench.scan()
    scan.ask(protocol)
    asked = len(bench.sent)
    scan.ask('cia402')
    sighting, = scan.sightings
    assert sighting == ('cia402', 6, SAID['servo'], Certainty.CERTAIN)
    # what is known is not asked again
    assert not [frame for frame in bench.sent[asked:] if frame.identifier == 0x606 and (
        frame.data[1:4].hex() == '001000')]
    assert not scan.master
    assert scan.scanners['cia402'].settings(6) == {'mode': 'pv'}


def test_a_servo_that_another_master_drives_otherwise() -> None:
    cycle = ((0.0, '205#0F0000000000'), (0.0, '080#'), (0.001, '185#371200000000'))
    # without SYNC, and with words that are none
    assert heard('cia402', *(cycle[0], cycle[2]) * 9) == []
    assert heard('cia402', *((0.0, '205#7F0400000000'), *cycle[1:]) * 9) == []
    assert heard('cia402', *(*cycle[:2], (0.0, '185#7F0000000000')) * 9) == []


def test_a_node_of_another_profile_is_no_drive() -> None:
    scanner = scanned('cia402', (0.0, '605#4000100000000000'), (0.01, '585#4300100091010200'),
                    (0.1, '585#8000100000000206'), (0.2, '585#43'))
    assert not scanner.sightings


def test_a_slow_answer_to_a_question_of_ours_is_one() -> None:
    scanner = FAMILIES['datamodel_extended'].make_scanner()
    scanner.asked(frame_of('004007A4#0000000000000000'), 0.0)
    scanner.receive(frame_of('104007A4#0032003300000000'), 0.25)
    assert [sighting.certainty for sighting in scanner.sightings.values()] == [Certainty.CERTAIN]
    assert not scanner.master


@pytest.mark.parametrize('protocol', list(FAMILIES))
def test_questions_leave_most_of_the_bus_to_others(protocol: str) -> None:
    bench = Bench()
    bench.scan().ask(protocol)
    longest = 160 if bench.sent[0].extended else 135     # with an answer each, worst stuffing
    load = 2 * longest * (len(bench.sent) - 1) / BITRATE / (bench.times[-1] - bench.times[0])
    assert load < LOAD_MAX * 1.15   # 11 % stuff bits are reckoned with, not the worst case


def test_a_master_that_comes_while_asking_ends_it() -> None:
    bench = Bench()
    scan = bench.scan()
    bench.arriving.append(Frame(0x003FFFF0, bytes(8), True))
    scan.ask('datamodel_extended')
    assert scan.master == SAID['requests'].format(1)
    assert len(bench.sent) <= 2


def test_a_bus_that_takes_nothing() -> None:
    scan = Bench(Device('deaf', lambda frame: False, takes_nothing)).scan()
    scan.ask('datamodel_extended')
    assert scan.trouble == SAID['alone']


@pytest.mark.parametrize('protocol', NAMED)
def test_a_canopen_node_that_boots_ends_asking_by_name(protocol: str) -> None:
    bench = Bench()
    scan = bench.scan()
    bench.arriving.append(Frame(0x704, b'\x00', False))
    scan.ask(protocol)
    assert scan.nodes == {4: 'heartbeat boot-up'}
    assert len(bench.sent) <= 1
    sent = len(bench.sent)
    scan.ask(protocol)
    assert len(bench.sent) == sent


@pytest.mark.parametrize(('mapped', 'identifier', 'read'), [
    ('20010030', '05050000', True),     # 30000120h at 505h: a mailbox
    ('10004060', '05050000', False),    # 60400010h: a control word
    ('20010030', '05020000', False),    # another identifier, which may be somebody else's
    ('20010030', '05050080', False),    # a PDO that does not exist
    ('20010030', '05050020', False),    # 29 bits
    ('20010030', '', True),             # it lacks what says that: where the standard has it
    ('10004060', '', False),
    ('20010030', '22000008', False),    # it does not say so now
])
def test_mailboxes_alone_are_read(mapped: str, identifier: str, read: bool) -> None:
    objects = {'001000': '00000000', '031601': mapped, '031401': identifier}

    def answers(frame: Frame) -> Frame | None:
        if frame.identifier == 0x605 and frame.data[1:4].hex() in objects:
            found = objects[frame.data[1:4].hex()]
            if found in ('', '22000008'):
                return Frame(0x585, b'\x80' + frame.data[1:4] + bytes.fromhex(
                    found or '00000206'), False)
            content = bytes.fromhex(found)
            return Frame(0x585, b'\x43' + frame.data[1:4] + content, False)
        if frame.data[:3] == bytes.fromhex('C70100'):
            return Frame(0x485, frame.data[:4] + bytes.fromhex('83200000'), False)
        return None

    bench = Bench(Device('node 5', lambda frame: False, answers))
    scan = bench.scan()
    scan.ask('canopen_pkw')
    sent = [frame.data.hex() for frame in bench.sent if frame.identifier == 0x505]
    assert sent == (['c701002500000000', 'c70100a500000000'] if read else [])
    assert ('PKW answers' in scan.nodes[5]) is read
    assert not scan.master


def test_simulated_drives_are_found_and_written(bench: World, tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / 'found.yaml'
    played = configuration_from_file(config_file('all_families.yaml'))
    drives = [(drive.protocol, drive.station) for drive in played.drives.values()
              if drive.protocol in SAFE]
    assert len(drives) == len(SAFE)
    with Simulation(played, bench.clock):
        assert drive_can('scan', '--interface', 'virtual', '--channel', 'all_families',
                         '--bitrate', 500_000, '--listen', 0.3, '-o', output) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:3] for line in lines[1:]] == [
        [protocol, str(station), 'certain'] for protocol, station in drives]
    assert drive_can('validate', output) == 0
    found = configuration_from_file(output)
    assert [(drive.protocol, drive.station) for drive in found.drives.values()] == drives
    capsys.readouterr()

    # a bridge runs with it
    with running(found, bench.clock) as bus:
        for name in found.drives:
            bus.wait_exchanges(name, 3)


def test_what_is_there_is_asked_for(bench: World, tmp_path: Path,
                                    capsys: pytest.CaptureFixture[str],
                                    monkeypatch: pytest.MonkeyPatch) -> None:
    output, beside = tmp_path / 'found.yaml', tmp_path / 'found_drive_std_7.yaml'
    (tmp_path / 'found_drive_of_mine.yaml').write_text('mine')
    arguments = ('scan', '--interface', 'virtual', '--channel', 'all_families', '--bitrate',
                 500_000, '--listen', 0.1, '-o', output)
    monkeypatch.setattr('sys.stdin', open('/dev/null'))
    frames: list[Frame] = []
    with Simulation(configuration_from_file(config_file('all_families.yaml')), bench.clock,
                    show_frame=lambda bus, frame, sent: sent or frames.append(frame)):
        for existing in (output, beside):
            existing.write_text('by hand')
            assert drive_can(*arguments) == 2
            assert capsys.readouterr().err == SAID['exists'].format(existing)
            assert existing.read_text() == 'by hand' and not frames
            existing.rename(tmp_path / 'kept')
        output.write_text('by hand')
        assert drive_can(*arguments, '--yes') == 0
    assert drive_can('validate', output) == 0
    assert frames


@pytest.mark.parametrize(('name', 'why'), [
    ('.', 'is a directory'), ('sub/', 'is a directory'), ('none/x.yaml', 'no such directory')])
def test_where_no_file_can_be_nothing_is_asked(
        name: str, why: str, bench: World, tmp_path: Path, capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'sub').mkdir()
    monkeypatch.chdir(tmp_path)
    begun = bench.clock.now()
    assert drive_can('scan', '--interface', 'virtual', '--channel', 'empty', '-o', name) == 1
    assert bench.clock.now() == begun
    told = capsys.readouterr()
    assert not told.out and told.err.endswith(f'{name.partition("/")[0]}: {why}\n')


@pytest.mark.usefixtures('bench')
def test_nothing_found_nothing_written(tmp_path: Path,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / 'found.yaml'
    arguments = ('scan', '--interface', 'virtual', '--channel', 'empty', '--listen', 0.1, '-o',
                 output, '--yes')
    assert drive_can(*arguments) == 1
    assert capsys.readouterr().err.endswith(SAID['nothing found'].format(output))
    assert not output.exists()
    output.write_text('by hand')
    assert drive_can(*arguments) == 1
    assert output.read_text() == 'by hand'


@pytest.mark.parametrize(('request_map', 'response_map', 'unfit'), [
    ('0032003200000000', '00D300D100000000', ['its request map, 50 50,']),
    ('0032003300000000', '00D300D300000000', ['its response map, 211 211,']),
    ('007A003300000000', '0081000000000000', ['its request map, 122 51,',
                                              'its response map, 129,']),
    ('FFFF000000000000', '00D3000000000000', ['its request map, 65535,']),
    ('0032003300000000', '00D300D100000000', []),
    ('0000000000000000', '0000000000000000', [])])
def test_what_is_written_is_valid_whatever_the_maps(
        tmp_path: Path, request_map: str, response_map: str, unfit: list[str]) -> None:
    scanner = FAMILIES['datamodel_extended'].make_scanner()
    for identifier, data in ((0x104007A4, request_map), (0x104007E4, response_map)):
        scanner.asked(Frame(identifier & ~DIR, bytes(8), True), 1.0)
        scanner.receive(Frame(identifier, bytes.fromhex(data), True), 1.0)
    output = tmp_path / 'found.yaml'
    write_parameter_file(output, BusConfiguration('main', 'virtual', 'a', 500_000),
                         [scanner.sightings[2]], [scanner.settings(2)])
    assert drive_can('validate', output) == 0
    remarks = [line.strip() for line in output.read_text(encoding='utf-8').splitlines()
               if 'cannot be exchanged' in line]
    assert [remark.split(' cannot')[0] for remark in remarks] == [f'# {text}' for text in unfit]


def test_what_is_written_is_valid_whoever_is_there(tmp_path: Path) -> None:
    seen = [Sighting('cannord', 1, 'by chance', Certainty.LIKELY),
            Sighting('cia402', 2, 'a servo', Certainty.CERTAIN),
            Sighting('cia402', 127, 'a servo', Certainty.CERTAIN),
            *(Sighting('canopen_pkw', node, 'a starter', Certainty.LIKELY)
              for node in (*range(20, 40), 126))]
    output = tmp_path / 'found.yaml'
    for rate, nodes, period, bridge_node in ((10_000, [125], 2.4, 124), (500_000, [], 0.24, 125)):
        write_parameter_file(
            output, BusConfiguration('main', 'virtual', 'a', rate), seen,
            [FAMILIES[each.protocol].make_scanner().settings(each.station) for each in seen],
            nodes)
        assert drive_can('validate', output) == 0
        drives = configuration_from_file(output).drives
        assert len(drives) == 23 and 'inverter_1' not in drives
        assert drives['axis_2'].options.bridge_node == bridge_node
        assert drives['axis_2'].period == period
    text = output.read_text(encoding='utf-8')
    assert '\n#       inverter_1:   # by chance\n#         bus: main\n' in text
    assert '\n      # left out, station 1 collides with drive axis_2 (station 2)' in text


def test_beside_a_bridge_all_drives_are_found_by_listening(
        bench: World, capsys: pytest.CaptureFixture[str]) -> None:
    played = configuration_from_file(config_file('all_families.yaml'))
    assert {drive.protocol for drive in played.drives.values()} == set(FAMILIES)
    with running(played, bench.clock) as bus:
        for name in bus.sessions:
            bus.wait_exchanges(name, 3)
        foreign = [drive.violations for drive in bus.simulation.drives.values()]
        assert drive_can('scan', '--interface', 'virtual', '--channel', 'all_families',
                         '--bitrate', 500_000, '--listen', 2.0, '--json') == 0
        assert [drive.violations for drive in bus.simulation.drives.values()] == foreign
        out, err = capsys.readouterr()
        drive_can('scan', '--interface', 'virtual', '--channel', 'all_families', '--bitrate',
                  '500k', '--listen', 0.5, '--passive')
    assert {(each['protocol'], each['station']) for each in map(json.loads, out.splitlines())} == {
        (drive.protocol, drive.station) for drive in played.drives.values()}
    assert SAID['master'] in err and 'only listening' in err
    err = capsys.readouterr().err
    assert SAID['master'] in err and SAID['passive'] in err and '500000 bit/s, ' in err


def test_a_node_of_no_known_family_is_no_document_and_is_named(
        bench: World, capsys: pytest.CaptureFixture[str]) -> None:
    with Simulation(configuration_from_file(config_file('all_families.yaml')), bench.clock):
        assert drive_can('scan', '--interface', 'virtual', '--channel', 'all_families',
                         '--passive', '--listen', 3.0, '--json') == 0
    out, err = capsys.readouterr()
    assert not out and err.startswith('CANopen node 5: heartbeat ')


def test_what_was_not_asked_is_named_with_the_next_command(
        bench: World, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    played = configuration_from_file(config_file('example.yaml'))
    bus, = played.buses.values()
    played = replace(played, buses={bus.name: replace(bus, interface='virtual',
                                                      channel='scan_next')})
    again = 'drive_can scan --interface virtual --channel scan_next --bitrate 500000'
    with Simulation(played, bench.clock):
        assert drive_can(*again.split()[1:], '--listen', 0.1) == 0
        err = capsys.readouterr().err.splitlines()
        left = ', '.join(name for name in FAMILIES if name not in SAFE)
        first = next(name for name in FAMILIES if name not in SAFE)
        assert err[-2].startswith('500000 bit/s, ')
        assert SAID['left'].format(left) in err[-2]
        assert err[-2].endswith(f'({again} --protocols {first})')
        assert err[-1] == f'next: {again} -o found.yaml'
        output = tmp_path / 'found.yaml'
        assert drive_can(*again.split()[1:], '--listen', 0.1, '-o', output) == 0
        assert capsys.readouterr().err.splitlines()[-1] == SAID['next'].format(output)


@pytest.mark.usefixtures('bench')
@pytest.mark.parametrize(('interface', 'set_to', 'given', 'used', 'warning'), [
    ('virtual', 0, None, None, ''),      # takes none, and has none
    ('slcan', 0, None, 125_000, command_sentences.bitrate_not_given(125_000)),
    ('slcan', 0, 500_000, 500_000, ''),
    ('socketcan', 250_000, None, 250_000, ''),
    ('socketcan', 250_000, 250_000, 250_000, ''),
    ('socketcan', 250_000, 500_000, 250_000,
     command_sentences.bitrate_of_interface(500_000, 'can9', 250_000)),
    ('socketcan', 0, None, None, ''),    # vcan
    ('socketcan', 0, 500_000, 500_000, '')])
def test_the_bit_rate_of_the_interface_goes_before_any_other(
        interface: str, set_to: int, given: int | None, used: int | None, warning: str,
        capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    opened = []

    def no_port(bus: BusConfiguration, *_: object) -> NoReturn:
        opened.append(bus)
        raise BusUnavailable('not today')
    monkeypatch.setattr(scan_command, 'open_port', no_port)
    monkeypatch.setattr(kernel_interfaces, 'kernel_interfaces', lambda: [
        KernelInterface('can8', 8, True, 'can', 10_000),
        KernelInterface('can9', 9, True, 'can', set_to)])
    rate = () if given is None else ('--bitrate', given)
    assert drive_can('scan', '--interface', interface, '--channel',
                     '/dev/null' if interface == 'slcan' else 'can9', *rate) == 1
    assert opened[0].bitrate == (used or 125_000)
    *told, _ = capsys.readouterr().err.splitlines()
    assert told == ([warning] if warning else [])


@pytest.mark.usefixtures('bench')
def test_named_families_need_a_word(capsys: pytest.CaptureFixture[str],
                                    monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ('scan', '--interface', 'virtual', '--channel', 'scan_named', '--listen', 0.1,
                 '--bitrate', 1_000_000, '--protocols', 'cannord')
    monkeypatch.setattr('sys.stdin', open('/dev/null'))
    assert drive_can(*arguments) == 2
    err = capsys.readouterr().err
    assert err.startswith(SAID['hazard']) and err.endswith(SAID['nobody'])
    assert drive_can(*arguments, '--yes') == 1
    assert SAID['none'] in capsys.readouterr().out


def test_named_families_are_not_asked_where_there_is_a_canopen_node(
        bench: World, capsys: pytest.CaptureFixture[str]) -> None:
    frames: list[Frame] = []
    with Simulation(configuration_from_file(config_file('all_families.yaml')), bench.clock,
                    show_frame=lambda bus, frame, sent: frames.append(frame)):
        drive_can('scan', '--interface', 'virtual', '--channel', 'all_families', '--bitrate',
                  500_000, '--listen', 0.3, '--protocols', 'cannord,datamodel_standard', '--yes')
    assert SAID['not asked'] in capsys.readouterr().err
    assert not [frame for frame in frames if not frame.extended
                and 0x200 <= frame.identifier < 0x400]


@pytest.mark.parametrize(('arguments', 'text'), [
    (['--interface', 'nothing', '--channel', 'x'], "'nothing' is no interface of python-can"),
    (['--interface', 'virtual', '--channel', 'x', '--bitrates', '125000'],
     'virtual has no listen-only mode'),
    (['--interface', 'virtual', '--channel', 'x', '--bitrates', '125000', '-o', 'x.yaml'],
     '--bitrates only counts frames, there is nothing to write: leave -o away'),
])
def test_wrong_usage(arguments: list[str], text: str,
                     capsys: pytest.CaptureFixture[str]) -> None:
    assert drive_can('scan', *arguments) == 2
    assert text in capsys.readouterr().err


@pytest.mark.parametrize(('options', 'text'), [
    ([], '--option: the adapter for socketcand needs host, port'),
    (['host=10.0.0.5'], '--option: the adapter for socketcand needs port'),
    (['channel=can1'], '--option channel: there is --channel'),
    (['can_filters=1', 'host=10.0.0.5', 'port=29536'],
     '--option can_filters: set by the bridge itself'),
])
def test_options_of_the_adapter_are_looked_at(options: list[str], text: str,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    words = [word for option in options for word in ('--option', option)]
    assert drive_can('scan', '--interface', 'socketcand', '--channel', 'can0', *words) == 2
    assert text in capsys.readouterr().err


@pytest.mark.usefixtures('threads')
def test_a_gateway_is_scanned(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    gateway = Socketcand()
    words = ['scan', '--interface', 'socketcand', '--channel', 'can0', '--listen', '0.05',
             '--passive', '--option', 'host=127.0.0.1', '--option', f'port={gateway.port}']
    try:
        assert drive_can(*words) == 1
        assert 'no drive found' in capsys.readouterr().out
        gateway.close()
        assert drive_can(*words) == 1
        told = capsys.readouterr().err
        assert told == (f'drive_can scan: socketcand can0: the gateway 127.0.0.1:{gateway.port} '
                        f'refuses\n')
    finally:
        gateway.close()


def test_what_is_written_has_the_options(tmp_path: Path) -> None:
    bus = BusConfiguration('main', 'socketcand', 'can0', BITRATE, options={
        'host': '10.0.0.5', 'port': 29536})
    path = tmp_path / 'found.yaml'
    write_parameter_file(path, bus, [Sighting(
        'datamodel_extended', 3, Certainty.CERTAIN, SAID['maps'])],
        [{'request_numbers': [50], 'response_numbers': [209]}])
    assert configuration_from_file(path).buses['main'].options == bus.options


def test_who_only_listens_is_not_asked(capsys: pytest.CaptureFixture[str]) -> None:
    bus = ['scan', '--interface', 'virtual', '--channel', 'nobody_scans', '--listen', '0.05',
           '--protocols', 'cannord']
    assert drive_can(*bus, '--passive') == 1
    assert '--yes' not in capsys.readouterr().err
