# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Settling open keys: what is concluded from which bytes, and that nothing is guessed."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
import io
from itertools import cycle
import json
from pathlib import Path
from typing import Any

from asked_bus import AskedBus, drive_can, takes_nothing
from builders import parameter
from foreign_devices import CROWD
import pytest
from transcripts import replayed, stories
from world import World

from drive_can_bridge.cli.probe import Asker
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import AccessMode
from drive_can_bridge.exchange.one_master import AnotherMaster
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.scanner import Finding
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.drive import SimulatedDrive
from drive_can_bridge.simulation.simulation import SIMULATED_DRIVES, Simulation

STORIES = stories(__file__, 'probe.yaml')
#: what the command says
SAID = {
    'too many': 'more than eight numbers answer',
    'hazard': 'is a write of a parameter in EEPROM to a CANnord inverter',
    'timeout': 'P513 is not 0: the inverter supervises telegrams once it has got one, and trips '
               'when they end',
    'silence': 'no answer to parameter tasks',
    'which': 'which drive? There are: ',
    'set': 'To be set',
    'keys': '\nTo be set in the file:\n  conveyor:\n    value_order: low_first\n'
            '    index_byte: high\n',
}
Device = Callable[[Frame], list[Frame]]


class Bench(AskedBus):
    """A bus with one device."""

    def probe(self, drive: DriveConfiguration) -> dict[str, Finding]:
        asker = Asker(BusConfiguration('main', 'virtual', 'x'), self, [drive], self.clock)
        return {finding.key: finding
                for finding in asker.probe(FAMILIES[drive.protocol].make_prober(drive))}


def configured(file: str, name: str, **options: Any) -> DriveConfiguration:
    drive = configuration_from_file(config_file(file)).drives[name]
    return replace(drive, parameter_timeout=0.1, parameter_retries=1,
                   options=replace(drive.options, **options))


INVERTER = configured('cannord.yaml', 'conveyor')
STARTER = configured('tesys.yaml', 'pump')
AXIS = configured('cia402.yaml', 'slide')
LIFT = configured('datamodel_standard.yaml', 'lift')
ELEVEN = configured('datamodel_standard.yaml', 'conveyor')


def values(findings: Mapping[str, Finding]) -> dict[str, Any]:
    return {key: finding.value for key, finding in findings.items()}


# -- bytes of the manuals -------------------------------------------------------------------------

def bare(drive: DriveConfiguration) -> DriveConfiguration:
    """Return a drive whose profile says nothing."""
    return replace(drive, profile=replace(drive.profile, parameters={}))



def limited(drive: DriveConfiguration) -> DriveConfiguration:
    """Return a drive whose profile limits all values of 32 bits to 1000."""
    return replace(drive, profile=replace(drive.profile, parameters={
        name: replace(each, maximum=1000.0) if each.type.bits == 32 else each
        for name, each in drive.profile.parameters.items()}))


#: drives of probe.yaml
TOLD = {'inverter': bare(INVERTER), 'starter': STARTER, 'axis': AXIS, 'lift': LIFT,
        'eleven': ELEVEN, 'limited': limited(STARTER)}


def test_cannord_arrays_and_others_of_the_profile_come_first() -> None:
    table = (parameter('ramp', 400), parameter('curve', 401, subindex=2),
             parameter('set_1', 402), parameter('set_2', 402, subindex=1),
             parameter('order', 403, access=AccessMode.WRITE_ONLY))
    bench = Bench(lambda frame: [])
    bench.probe(replace(INVERTER, profile=replace(
        INVERTER.profile, parameters={each.name: each for each in table})))
    asked = [int.from_bytes(sent.data[:2], 'little') & 0x7FF for sent in bench.sent
             if sent.data[1] >> 4 == 6]
    assert list(dict.fromkeys(asked)) == [400, 514, 513, 401, 402, 102, 700]


def test_pkw_an_echo_is_no_proof() -> None:
    # a device of another layout may repeat what starts nothing there
    found = Bench(lambda frame: [Frame(0x485, frame.data, False)] if frame.identifier == 0x505
                  else []).probe(STARTER)
    assert values(found) == {'layout': None, 'word_order': None, 'abort_code_order': None}


def test_pkw_a_frame_of_another_request_is_no_answer() -> None:
    found = Bench(lambda frame: [Frame(0x485, bytes.fromhex('C8010025FFFF0000'), False)],
                  ).probe(STARTER)
    assert found['layout'].value is None
    assert '--nmt-start' in found['layout'].reason


@pytest.mark.parametrize('drive', [LIFT, ELEVEN, STARTER, INVERTER],
                         ids=lambda each: each.protocol)
@pytest.mark.parametrize('change', [
    lambda answer: answer._replace(extended=not answer.extended),
    lambda answer: answer._replace(identifier=answer.identifier ^ 0x40),
    lambda answer: answer._replace(data=answer.data[:7])], ids=['format', 'identifier', 'length'])
def test_a_frame_that_is_not_quite_the_answer_is_none(
        drive: DriveConfiguration, change: Callable[[Frame], Frame]) -> None:
    device = simulated(drive)
    found = Bench(lambda frame: list(map(change, device(frame)))).probe(drive)
    assert set(values(found).values()) == {None}
    assert all('no answer' in finding.reason for finding in found.values()
               if 'comes first' not in finding.reason)


# the maps of the seed's examples, 29 bits, station 1: Reg.122 = 50, Reg.126 = 209, 210
def maps(request: str, response: str, moved: int = 0) -> Device:
    answers = {0x002007A4 + 16 * moved: (0x102007A4 + 16 * moved, request),
               0x002007E4 + 16 * moved: (0x102007E4 + 16 * moved, response)}

    def device(frame: Frame) -> list[Frame]:
        assert frame.data == bytes(8)
        identifier, data = answers.get(frame.identifier, (0, ''))
        return [Frame(identifier, bytes.fromhex(data), True)] if data else []
    return device




@pytest.mark.parametrize(('request_map', 'response_map', 'moved'), [
    ('0031003200000000', '00D000D100D20000', -1), ('0033003400000000', '00D200D300D40000', 1)])
def test_datamodel_moved(request_map: str, response_map: str, moved: int) -> None:
    found = Bench(maps(request_map, response_map, moved)).probe(LIFT)
    assert found['parameter_offset'].value == moved
    assert found['cyclic_request'].value == ['speed_setpoint', 'torque_limit']



def test_who_did_not_run_for_a_while_has_not_heard_silence() -> None:
    device = maps('0031003200000000', '00D000D100D20000', -1)
    prompt, late = Bench(device), Bench(device)
    late.stall = 1.0
    assert late.probe(LIFT) == prompt.probe(LIFT) != Bench(lambda frame: []).probe(LIFT)


def test_silence_after_a_read_whose_late_answer_nobody_could_tell() -> None:
    quiet = {drive.protocol: next(FAMILIES[drive.protocol].make_prober(drive).converse()).quiet
             for drive in (LIFT, ELEVEN)}
    assert quiet == {'datamodel_extended': 0.0,
                     'datamodel_standard': ELEVEN.options.quarantine}


def test_datamodel_undecided() -> None:
    def everything(frame: Frame) -> list[Frame]:
        return [Frame(frame.identifier | 0x10000000, bytes.fromhex('0001000200030004'), True)]
    found = Bench(everything).probe(LIFT)
    assert values(found) == dict.fromkeys(
        ('parameter_offset', 'cyclic_request', 'cyclic_response'))
    assert SAID['too many'] in found['parameter_offset'].reason


# -- simulated drives, set to each variant --------------------------------------------------------

def simulated(drive: DriveConfiguration,
              prepare: Callable[[SimulatedDrive], None] = lambda _: None) -> Device:
    """Return a simulated drive as a device."""
    made = SIMULATED_DRIVES[drive.protocol](drive)
    prepare(made)
    times = iter(range(10**9))

    def device(frame: Frame) -> list[Frame]:
        now = next(times) * 0.001
        made.receive_frame(frame, now)
        return made.take_frames()
    if drive.protocol == 'canopen_pkw':
        device(Frame(0, bytes((1, drive.station)), False))
    return device


ORDERS = ('high_first', 'low_first')


@pytest.mark.parametrize('told', [INVERTER, configured(
    'cannord.yaml', 'conveyor', value_order='low_first', index_byte='high')])
@pytest.mark.parametrize('index_byte', ['low', 'high'])
@pytest.mark.parametrize('value_order', ORDERS)
def test_simulated_inverter(value_order: str, index_byte: str, told: DriveConfiguration) -> None:
    options = {'value_order': value_order, 'index_byte': index_byte}
    bench = Bench(simulated(configured('cannord.yaml', 'conveyor', **options)))
    assert values(bench.probe(told)) == options


@pytest.mark.parametrize('abort_code_order', ORDERS)
@pytest.mark.parametrize('word_order', ORDERS)
@pytest.mark.parametrize('layout', ['word_le', 'dword_swapped', 'word_be'])
def test_simulated_starter(layout: str, word_order: str, abort_code_order: str) -> None:
    options = {'layout': layout, 'word_order': word_order, 'abort_code_order': abort_code_order}

    def used(drive: SimulatedDrive) -> None:
        for name in ('motor_starts', 'operating_time'):
            drive.set_value(name, 1234)

    device = configured('tesys.yaml', 'pump', **options)
    assert values(Bench(simulated(device, used)).probe(STARTER)) == options

    def new(drive: SimulatedDrive) -> None:
        for each in STARTER.profile.parameters.values():
            if each.type.bits == 32:
                drive.set_value(each.name, 0, 0.0)

    assert values(Bench(simulated(device, new)).probe(STARTER)) == {**options, 'word_order': None}


@pytest.mark.parametrize('drive', [LIFT, ELEVEN])
@pytest.mark.parametrize('offset', [-1, 0, 1])
@pytest.mark.parametrize('told', [-1, 0, 1])
def test_simulated_datamodel(drive: DriveConfiguration, offset: int, told: int) -> None:
    def moved(by: int) -> DriveConfiguration:
        return replace(drive, options=replace(drive.options, parameter_offset=by))

    found = Bench(simulated(moved(offset))).probe(moved(told))
    assert found.pop('parameter_offset').value == offset
    if drive is LIFT:
        assert found['cyclic_request'].value == [each.name for each in drive.cyclic_request]
        assert found['cyclic_response'].value == [each.name for each in drive.cyclic_response]
    else:
        assert not found


def test_a_servo_as_configured() -> None:
    verified = configured('cia402.yaml', 'slide', mapping='verify')
    assert Bench(simulated(verified)).probe(AXIS)['mapping'].value == 'verify'


@pytest.mark.parametrize(('axes', 'told'), [
    ({}, []),
    ({0x6841: 0x0250}, [
        'there are 2 axes behind this node (6841h is 0250h): the bridge drives the first (6040h), '
        'and leaves the others alone']),
    ({0x6841: 0x0250, 0x7041: 0x1237, 0x8041: 0x0250}, [
        'there are 3 axes behind this node (6841h is 0250h, 7041h is 1237h): the bridge drives '
        'the first (6040h), and leaves the others alone'])])
def test_which_axis_is_driven_of_several(axes: dict[int, int], told: list[str]) -> None:
    servo, station = simulated(AXIS), AXIS.station

    def device(frame: Frame) -> list[Frame]:
        index = int.from_bytes(frame.data[1:3], 'little')
        if index not in axes:
            return servo(frame)
        return [Frame(0x580 + station, b'\x4B' + frame.data[1:4] + axes[index].to_bytes(
            4, 'little'), False)]
    asker = Asker(BusConfiguration('main', 'virtual', 'x'), bench := Bench(device), [AXIS],
                  bench.clock)
    prober = FAMILIES['cia402'].make_prober(AXIS)
    asker.probe(prober)
    assert prober.notes == told


class Story:
    """Does the steps of a transcript."""

    def __init__(self) -> None:
        self.answers: dict[tuple[int, bytes], Iterator[list[Frame]]] = {}
        self.device: Device = lambda frame: next(
            self.answers.get((frame.identifier, frame.data), iter(())), [])

    def step(self, step: str) -> list[str]:
        first, *words = step.split()
        if first == 'answers':
            self.answers.clear()
        if first in ('answers', 'also'):
            self.request, self.response = (int(word, 16) for word in words)
        elif first == 'answer':
            request, *answers = words
            self.answers[self.request, bytes.fromhex(request)] = cycle([
                [Frame(self.response, bytes.fromhex(data), self.response > 0x7FF)
                 for data in turn.split()] for turn in ' '.join(answers).split('|')])
        elif first == 'simulated':
            registers = [word.split('=') for word in words[1:]]

            def prepare(made: SimulatedDrive) -> None:
                for name, value in registers:
                    made.set_value(name, int(value))
            self.device = simulated(TOLD[words[0]], prepare)
        elif first == 'asked':
            return list(dict.fromkeys(map(str, self.bench.sent)))
        else:
            self.bench = Bench(self.device)
            return [f'{key} {finding.value}: {finding.reason}'
                    for key, finding in self.bench.probe(TOLD[words[0]]).items()]
        return []


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str) -> None:
    assert replayed(STORIES[story], Story().step) == STORIES[story]


def test_a_node_that_says_nothing_and_one_that_has_nothing() -> None:
    assert set(values(Bench(lambda frame: []).probe(AXIS)).values()) == {None}
    bench = Bench(lambda frame: [Frame(0x581, b'\x80' + frame.data[1:4] + bytes.fromhex(
        '00000206'), False)])
    assert values(bench.probe(AXIS)) == {'mode': None, 'mapping': None, 'disable_word': None,
                                         'bridge_heartbeat': 0.0}
    assert {frame.data[0] for frame in bench.sent} == {0x40}


@pytest.mark.parametrize(('answer', 'why'), [
    ('', 'was not answered'),
    ('22000008', 'was refused: 08000022h (data cannot be stored in the present state of the '
                 'device)'), ('01000106', 'was refused: 06010001h (read of a write-only object)')])
@pytest.mark.parametrize(('lost', 'key'), [
    ('026500', 'mode'), ('001600', 'mapping'), ('5C6000', 'disable_word'),
    ('5B6000', None), ('161000', 'bridge_heartbeat'), ('076000', None)])
def test_what_a_servo_does_not_say_is_not_concluded(
        answer: str, why: str, lost: str, key: str | None) -> None:
    """Lost answers once made 1016h missing: ``bridge_heartbeat: 0.0`` was to be set."""
    servo, lacking = simulated(AXIS), bytes.fromhex(lost)

    def device(frame: Frame) -> list[Frame]:
        if frame.data[1:4] != lacking:
            return servo(frame)
        return [Frame(0x580 + AXIS.station, b'\x80' + lacking + bytes.fromhex(answer), False)
                ] if answer else []
    found, whole = Bench(device).probe(AXIS), Bench(simulated(AXIS)).probe(AXIS)
    index = f'{int.from_bytes(lacking[:2], "little"):04X}h'
    for each, finding in found.items():
        if each == key:
            assert finding.value is None
            assert f'undecided: {index} {why}' in finding.reason
        else:
            assert finding.value == whole[each].value


def test_lost_answers_propose_nothing() -> None:
    servo, lost = simulated(AXIS), (b'\x16\x10', b'\x5B\x60', b'\x5C\x60')
    found = Bench(lambda frame: [] if frame.data[1:3] in lost else servo(frame)).probe(AXIS)
    assert found['bridge_heartbeat'] == (
        'bridge_heartbeat', None, 'undecided: 1016h was not answered')
    assert found['disable_word'] == (
        'disable_word', None,
        'undecided: 605Ch was not answered, 605Bh was not answered')


# -- nobody is moved ------------------------------------------------------------------------------

@pytest.mark.parametrize('drive', [LIFT, ELEVEN, STARTER, INVERTER],
                         ids=lambda each: each.protocol)
@pytest.mark.parametrize('answering', [True, False])
def test_nobody_obeys_what_is_asked(drive: DriveConfiguration, answering: bool) -> None:
    bench = Bench(simulated(drive) if answering else lambda _: [])
    bench.probe(drive)
    assert bench.sent
    # a parameter task for inverter 50 is 264h: receive PDO1 of node 100, which is not there; and
    # node 5 is the one that is asked, whose functions that write are 2Ah, 2Bh, 3Ah and 3Bh
    others = [device for device in CROWD if device.name != 'canopen 5' and not (
        drive is INVERTER and device.name.startswith('canopen'))]
    if drive is STARTER:
        assert not [frame for frame in bench.sent
                    if {byte & 0x7F for byte in frame.data[1:4]} & {0x2A, 0x2B, 0x3A, 0x3B}
                    and frame.identifier == 0x505]
        assert {frame.data[0] for frame in bench.sent if frame.identifier == 0x605} == {0x40}
        assert {frame.identifier for frame in bench.sent} == {0x505, 0x605}
    for device in others:
        device.obeyed.clear()
        for frame in bench.sent:
            device.hear(frame)
    assert not [device.name for device in others if device.obeyed]


def test_maps_of_an_even_station_need_a_word(tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str],
                                             monkeypatch: pytest.MonkeyPatch) -> None:
    text = Path(config_file('datamodel_standard.yaml')).read_text(encoding='utf-8')
    file = tmp_path / 'even.yaml'
    file.write_text(text.replace('socketcan', 'virtual').replace(
        'station: 1 ', 'station: 2 ', 1), encoding='utf-8')
    monkeypatch.setattr('sys.stdin', open('/dev/null'))
    assert drive_can('probe', 'conveyor', '--params-file', file) == 2
    assert SAID['hazard'] in capsys.readouterr().err


# -- other masters, and the command line ----------------------------------------------------------

@pytest.mark.parametrize(('drive', 'request_frame'), [
    (LIFT, Frame(0x003FFFF0, bytes(8), True)), (LIFT, Frame(0x002001E2, bytes(8), True)),
    (ELEVEN, Frame(0x3F1, bytes.fromhex('031E000100000000'), False)),
    (INVERTER, Frame(0x064, bytes.fromhex('7E040000'), False)),
    (INVERTER, Frame(0x264, bytes.fromhex('BC12000000000000'), False)),
    (INVERTER, Frame(0x401, bytes.fromhex('7E040000'), False)),
    (STARTER, Frame(0x505, bytes(8), False)), (STARTER, Frame(0x000, b'\x01\x05', False)),
    (STARTER, Frame(0x605, bytes.fromhex('4000100000000000'), False)),
])
def test_another_master_ends_it(drive: DriveConfiguration, request_frame: Frame) -> None:
    bench = Bench(lambda _: [])
    asker = Asker(BusConfiguration('main', 'virtual', 'x'), bench, [drive], bench.clock)
    asker.listen(1.2)
    assert bench.now >= 1.2
    bench.arriving.append(request_frame)
    with pytest.raises(AnotherMaster, match=f'another master talks to drive {drive.name}'):
        asker.listen(1.2)
    bench.arriving.append(request_frame)
    with pytest.raises(AnotherMaster):
        asker.probe(FAMILIES[drive.protocol].make_prober(drive))
    assert not bench.sent


def test_a_bus_that_takes_nothing() -> None:
    with pytest.raises(TransportError, match='no other node acknowledges'):
        Bench(takes_nothing).probe(LIFT)


@pytest.mark.parametrize(('answer', 'told'), [
    ('0112000000003200', True), ('0112000032000000', True), ('0112000000000000', False),
    # -0.1 s, in either order of the words: it runs on when telegrams end
    ('01120000FFFFFFFF', False), ('011200000000FFFF', False)])
def test_a_telegram_time_out_is_told(answer: str, told: bool) -> None:
    question, said = map(bytes.fromhex, ('0112000000000000', answer))
    prober = FAMILIES['cannord'].make_prober(INVERTER)
    bench = Bench(lambda frame: [Frame(0x265, said, False)] if frame.data == question else [])
    Asker(BusConfiguration('main', 'virtual', 'x'), bench, [INVERTER], bench.clock).probe(prober)
    assert prober.notes == [SAID['timeout']] * told


def file_with(tmp_path: Path, name: str, options: str) -> Path:
    """Write a file with one inverter on a bus inside this process."""
    path = tmp_path / name
    path.write_text(f"""\
/**/drive_can_bridge:
  ros__parameters:
    buses: {{main: {{interface: virtual, channel: probe, bitrate: 500000}}}}
    drives:
      conveyor:
        {{bus: main, protocol: cannord, station: 50, profile: nord_sk500e,
         cyclic_request: [frequency_setpoint], cyclic_response: [actual_frequency]{options}}}
""", encoding='utf-8')
    return path


def test_the_command(bench: World, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = file_with(tmp_path, 'file.yaml', '')
    other = file_with(tmp_path, 'other.yaml', ', value_order: low_first, index_byte: high')
    with Simulation(configuration_from_file(other), bench.clock) as simulation:
        assert drive_can('probe', '--params-file', file, 'conv*') == 0
        out, err = capsys.readouterr()
        assert out.splitlines()[0].split() == ['drive', 'key', 'found', 'in', 'the', 'file',
                                               'rests', 'on']
        assert out.endswith(SAID['keys'])
        assert not err
        assert drive_can('probe', '--params-file', other, '--json') == 0
        documents = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert [(each['drive'], each['key'], each['value'], each['configured'])
                for each in documents] == [
            ('conveyor', 'value_order', 'low_first', 'low_first'),
            ('conveyor', 'index_byte', 'high', 'high')]
        drive = simulation.drives['conveyor']
        assert not [rule for rule in drive.violations if 'sub-index' not in rule]
    assert drive_can('probe', '--params-file', file) == 1
    out = capsys.readouterr().out
    assert 'undecided' in out and SAID['silence'] in out
    assert SAID['set'] not in out


@pytest.mark.parametrize(('words', 'told'), [
    (['lift'], "no drive 'lift'; there are: conveyor"), ([], '')])
def test_which_drive(words: list[str], told: str, tmp_path: Path,
                     capsys: pytest.CaptureFixture[str]) -> None:
    if words:
        assert drive_can('probe', *words, '--params-file', file_with(tmp_path, 'x.yaml', '')) == 2
        assert told in capsys.readouterr().err
        return
    assert drive_can('probe', '--params-file', config_file('all_families.yaml')) == 2
    assert SAID['which'] in capsys.readouterr().err


@pytest.mark.usefixtures('bench')
@pytest.mark.parametrize(('answer', 'code', 'told'), [
    ('n\n', 2, 'Ask all the same? [y/N] drive_can probe: nothing was sent\n'), ('', 2, 'sent'),
    ('y\n', 1, 'Ask all the same? [y/N] ')])
def test_somebody_is_asked(answer: str, code: int, told: str, tmp_path: Path,
                           monkeypatch: pytest.MonkeyPatch,
                           capsys: pytest.CaptureFixture[str]) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr('sys.stdin', Terminal(answer))
    content = config_file('all_families.yaml').read_text(encoding='utf-8')
    file = tmp_path / 'f.yaml'
    file.write_text(content.replace('channel: all_families', 'channel: nobody_answers'))
    # nobody is there: whether it asks shows by what becomes of it
    assert drive_can('probe', 'lift', '--params-file', file) == code
    assert told in capsys.readouterr().err
