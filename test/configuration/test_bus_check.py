# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is wrong with a bus or with the whole: one changed line each."""

from collections.abc import Container, Iterator
import os
from pathlib import Path

from configuration_builders import at, changed, FILE, load, local, parts, problems, warnings, write
import pytest
from saying import says

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.adapter import AdapterTraits
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.sentences import uncoded
from drive_can_bridge.transport import adapters

CASES = [
    ('bitrate: 125000', 'bitrate: 10000',
     [at('f.yaml:5: buses.main', 'overload', load=332.8, bitrate=10000,
         parts='conveyor 166.4 %, lift 166.4 %', most=100.0)]),
    ('bitrate: 125000', 'bitrate: 1.25e5',
     [at('f.yaml:8: buses.main.bitrate', 'wrong_type', value=125000.0, kind='a number',
         allowed='an integer of 1000 to 1000000')]),
    ('bitrate: 125000', 'bitrate: 2000000',
     [at('f.yaml:8: buses.main.bitrate', 'out_of_range', value=2000000,
         allowed='an integer of 1000 to 1000000')]),
    ('bitrate: 125000', 'bitrate: 500',
     [at('f.yaml:8: buses.main.bitrate', 'out_of_range_in_kilo', value=500, number='500000',
         allowed='an integer of 1000 to 1000000')]),
    ('bitrate: 125000', 'bitrate: 125000#can0',
     [at('f.yaml:8: buses.main.bitrate', 'comment_without_space', value='125000#can0',
         kind='a string', allowed='an integer of 1000 to 1000000')]),
    ('channel: demo', 'port: demo',
     [at('f.yaml:5: buses.main.channel', 'missing_called', theirs='port', ours='channel',
         allowed='a string or an integer')]),
    ('bitrate: 125000', 'bitrat: 125000',
     [at('f.yaml:8: buses.main.bitrat', 'unknown_key',
         hint=says('did_you_mean', word='bitrate'))]),
    ('bitrate: 125000', 'can_filter: 1',
     [at('f.yaml:8: buses.main.can_filter', 'unknown_key_of_bridge', word='can_filters')]),
    ('bitrate: 125000', 'reconnect_period: 0',
     [at('f.yaml:8: buses.main.reconnect_period', 'out_of_range', value=0,
         allowed='a number of 0.01 to 3600')]),
    ('bitrate: 125000', 'trace_seconds: 1\n        trace_directory: ~no_such_user/traces',
     [at('f.yaml:9: buses.main.trace_directory', 'no_home', value='~no_such_user/traces')]),
    ('bitrate: 125000', 'trace_directory: ~no_such_user/traces', []),   # nothing is recorded
    ('bitrate: 125000', 'rx_queue_size: .nan',
     [at('f.yaml:8: buses.main.rx_queue_size', 'not_finite',
         allowed='a string or a number or true or false or a list')]),
    ('bitrate: 125000', 'extra: {a: 1}',
     [at('f.yaml:8: buses.main.extra', 'wrong_kind', kind='a mapping',
         allowed='a string or a number or true or false or a list')]),
    ('channel: demo', 'channel: 1.5',
     [at('f.yaml:7: buses.main.channel', 'wrong_type', value=1.5, kind='a number',
         allowed='a string or an integer')]),
    ('channel: demo', 'channel: ""',
     [at('f.yaml:7: buses.main.channel', 'empty_string')]),
    ('interface: virtual', 'interfaces: virtual',
     [at('f.yaml:5: buses.main.interface', 'missing', allowed='a string'),
      at('f.yaml:6: buses.main.interfaces', 'unknown_key',
         hint=says('did_you_mean', word='interface'))]),
    ('interface: virtual', 'interface: yes',
     [at('f.yaml:6: buses.main.interface', 'word_as_bool', value=True, kind='a bool',
         allowed='a string')]),
    ('      main:\n', '      "ma in":\n',
     [at('f.yaml:5: buses.ma in', 'wrong_name', value='ma in', name='ma_in',
         allowed='a name of letters, digits, _ and -, at most 100 characters'),
      at('f.yaml:11: drives.conveyor.bus', 'unknown', name='main',
         hint=says('did_you_mean', word='ma in')),
      at('f.yaml:20: drives.lift.bus', 'unknown', name='main',
         hint=says('did_you_mean', word='ma in'))]),
    ('    drives:\n', '    drivers:\n',
     [at('f.yaml:9: drivers', 'unknown_key', hint=says('did_you_mean', word='drives'))]),
    ('    drives:\n', '    diagnostics_period: 0\n    autostart: 1\n    drives:\n',
     [at('f.yaml:9: diagnostics_period', 'out_of_range', value=0,
         allowed='a number of 0.01 to 3600'),
      at('f.yaml:10: autostart', 'wrong_type', value=1, kind='an integer',
         allowed='true or false')]),
    # two drives with 16000 + 640 bits a second each
    ('bitrate: 125000', 'bitrate: 33280', []),
    ('bitrate: 125000', 'bitrate: 33279',
     [at('f.yaml:5: buses.main', 'overload', bitrate=33279, most=100.0)]),
    *(('bitrate: 125000', f'{key}: true',
       [f'f.yaml:8: buses.main.{key}: set by the bridge itself, allowed is to leave it out'])
      for key in ('fd', 'can_filters', 'receive_own_messages', 'ignore_config')),
    ('    drives:\n', '    use_sim_tim: true\n    drives:\n',
     [at('f.yaml:9: use_sim_tim', 'unknown_key', hint=says('did_you_mean', word='use_sim_time'))]),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), CASES)
def test_problem_of_a_bus(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(FILE, old, new)) == expected


class Adapters:
    """Knowledge about made-up adapters."""

    def adapter_keywords(self, interface: str) -> set[str] | None:
        return {'channel', 'bitrates', 'rx_queue_size'} if interface == 'virtual' else None

    def missing_keywords(self, interface: str, given: Container[str]) -> list[str]:
        return ['room'] if 'rooms' in given else []

    def check_interface(self, interface: str) -> Sentence | None:
        return None if interface in ('virtual', 'closed') else uncoded(
            'no such thing, allowed is virtual')

    def check_channel(self, interface: str, channel: str | int) -> Sentence | None:
        return uncoded('no channel, allowed is room') if channel == 7 else None

    def check_bitrate(self, interface: str, bitrate: int) -> Sentence | None:
        return uncoded('impossible, allowed is 500000') if bitrate == 500 * 100 else None

    def serial_port(self, bus: BusConfiguration) -> tuple[str, ...]:
        return ()

    def check_name(self, interface: str, name: str) -> Sentence | None:
        return None

    def traits_of(self, bus: BusConfiguration) -> AdapterTraits | None:
        return None


@pytest.mark.parametrize(('old', 'new', 'expected'), [
    ('interface: virtual', 'interface: virtul',
     ['f.yaml:6: buses.main.interface: no such thing, allowed is virtual']),
    ('channel: demo', 'channel: 7',
     ['f.yaml:7: buses.main.channel: no channel, allowed is room']),
    ('bitrate: 125000', 'bitrate: 50000',
     ['f.yaml:8: buses.main.bitrate: impossible, allowed is 500000']),
    # close to a key of ours, but the adapter knows it
    ('bitrate: 125000', 'bitrates: 5', []),
    ('bitrate: 125000', 'rooms: 5',
     [at('f.yaml:5: buses.main', 'adapter_needs', interface='virtual', keys=['room'])]),
    ('bitrate: 125000', 'bitrats: 5',
     [at('f.yaml:8: buses.main.bitrats', 'unknown_key',
         hint=says('did_you_mean', word='bitrate'))]),
])
def test_what_adapters_know(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(FILE, old, new), adapters=Adapters()) == expected


def test_key_that_the_adapter_does_not_name(tmp_path: Path) -> None:
    text = changed(FILE, 'bitrate: 125000', 'rx_queue_siz: 5\n        other: 1')
    assert warnings(tmp_path, text, adapters=Adapters()) == [
        at('f.yaml:8: buses.main.rx_queue_siz', 'adapter_does_not_name', interface='virtual',
           near=says('near', word='rx_queue_size')),
        at('f.yaml:9: buses.main.other', 'adapter_does_not_name', interface='virtual', near='')]
    # nothing is known about this one
    assert warnings(tmp_path, changed(text, 'virtual', 'closed'), adapters=Adapters()) == []
    assert warnings(tmp_path, text) == []


def test_options_are_handed_over(tmp_path: Path) -> None:
    text = changed(FILE, 'bitrate: 125000',
                   'rx_queue_size: 5\n        flag: yes\n        names: [a, b]\n        gap: 1.5')
    bus = load(tmp_path, text).buses['main']
    assert bus.options == {'rx_queue_size': 5, 'flag': True, 'names': ['a', 'b'], 'gap': 1.5}
    assert (bus.interface, bus.channel, bus.bitrate, bus.reconnect_period) == (
        'virtual', 'demo', 125000, 1.0)


@pytest.mark.parametrize(('given', 'channel'), [
    ('0', 0), ("'0'", '0'), ('/dev/ttyACM0', '/dev/ttyACM0'), ('0x10', 16), ('null', 'null')])
def test_channel_keeps_its_type(tmp_path: Path, given: str, channel: object) -> None:
    found = load(tmp_path, changed(FILE, 'channel: demo', f'channel: {given}')).buses['main']
    assert found.channel == channel
    assert type(found.channel) is type(channel)


def test_load_close_to_the_limit(tmp_path: Path) -> None:
    assert warnings(tmp_path, changed(FILE, 'bitrate: 125000', 'bitrate: 47543')) == []
    assert warnings(tmp_path, changed(FILE, 'bitrate: 125000', 'bitrate: 47542')) == [
        at('f.yaml:5: buses.main', 'high_load', load=70.00126204198392, bitrate=47542,
           parts=parts(conveyor=35.0, lift=35.0), most=70.0)]


def test_no_look_at_the_maps_no_load(tmp_path: Path) -> None:
    text = FILE.replace('        bus: main\n', '        bus: main\n        mapping: assume\n')
    assert problems(tmp_path, changed(text, 'bitrate: 125000', 'bitrate: 32000')) == []
    assert problems(tmp_path, changed(text, 'bitrate: 125000', 'bitrate: 31999')) != []


def test_bus_that_is_opened_twice(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n',
                   '      other: {interface: virtual, channel: demo}\n    drives:\n')
    assert warnings(tmp_path, text) == [
        at('f.yaml:9: buses.other.channel', 'channel_of_other_bus', channel='demo', bus='main')]


@pytest.mark.parametrize(('station', 'more', 'collides'), [
    (1, '', True), (2, '', False),
    # another adapter, perhaps
    (1, ', unique_hardware_id: HW2', False)])
def test_station_twice_on_a_bus_that_is_opened_twice(tmp_path: Path, station: int, more: str, *,
                                                     collides: bool) -> None:
    text = changed(FILE, '    drives:\n', '      other: {interface: virtual, channel: demo, '
                                           f'bitrate: 250000{more}}}\n    drives:\n')
    head, lift, tail = text.partition('      lift:\n        bus: ')
    text = head + lift + tail.replace('main', 'other', 1).replace(
        'station: 2', f'station: {station}')
    assert problems(tmp_path, text) == [
        at('f.yaml:23: drives.lift.station', 'collides', station=1, other='conveyor',
           other_station=1, bus='main')] * collides


SERVOS = """\
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {interface: virtual, channel: demo, bitrate: 1000000}
      other: {interface: virtual, channel: demo, bitrate: 1000000}
    drives:
"""
SERVO = """\
      {name}:
        bus: {bus}
        protocol: cia402
        station: {station}
        profile: cia402_servo
        period: 0.01
        mode: pv
        cyclic_request: [target_velocity]
        cyclic_response: [actual_velocity]
"""


@pytest.mark.parametrize(('first', 'second', 'what'), [
    ('', '', 'SYNC'),
    ('bridge_heartbeat: 0.0', '', 'SYNC'),
    ('transmission: event', '', 'bridge heartbeat'),
    ('transmission: event', 'bridge_node: 126', 'bridge heartbeat'),
    ('transmission: event', 'bridge_heartbeat: 0.0', None)])
def test_what_a_bus_sends_to_all_comes_once_although_it_is_opened_twice(
        tmp_path: Path, first: str, second: str, what: str | None) -> None:
    """Two SYNCs a period would have each drive take every setpoint, and answer, twice."""
    text = SERVOS
    for station, (name, bus, more) in enumerate(
            [('slide', 'main', first), ('lift', 'other', second)], 1):
        text += SERVO.format(name=name, bus=bus, station=station)
        text += f'        {more}\n' * bool(more)
    line = text.splitlines().index('        bus: other') + 1
    assert problems(tmp_path, text) == [
        at(f'f.yaml:{line}: drives.lift.bus', 'told_by_two_buses', bus='other', other='slide',
           other_bus='main', what=what)] * (what is not None)
    assert problems(tmp_path, text.replace('bus: other', 'bus: main').replace('126', '127')) == []


@pytest.fixture
def terminal() -> Iterator[str]:
    near, far = os.openpty()
    yield os.ttyname(far)
    os.close(near)
    os.close(far)


def with_serial_buses(first: str, interface: str, second: str) -> str:
    """Return a good file with a serial bus, and one more of this interface."""
    text = changed(changed(FILE, 'interface: virtual', 'interface: slcan'), 'demo', f"'{first}'")
    return changed(text, '    drives:\n',
                   f"      other: {{interface: {interface}, channel: '{second}'}}\n    drives:\n")


@pytest.mark.parametrize(('interface', 'spelled'), [
    ('slcan', '{port}'), ('slcan', '/dev/..{port}'), ('slcan', '{port}@115200'),
    ('slcan', '{folder}/adapter'), ('robotell', '{port}')])
def test_serial_port_of_two_buses(tmp_path: Path, terminal: str, interface: str,
                                  spelled: str) -> None:
    (tmp_path / 'adapter').symlink_to(terminal)
    second = spelled.format(port=terminal, folder=tmp_path)
    text = with_serial_buses(terminal, interface, second)
    assert problems(tmp_path, text, adapters=adapters) == [
        at('f.yaml:9: buses.other.channel', 'port_of_other_bus', bus='main',
           channel=second.replace(f'{tmp_path}/', ''))]


def test_serial_port_of_two_buses_that_is_not_plugged_in(tmp_path: Path) -> None:
    text = with_serial_buses('/dev/no_such_port', 'slcan', '/dev/../dev/no_such_port')
    assert problems(tmp_path, text, adapters=adapters) == [
        at('f.yaml:9: buses.other.channel', 'port_of_other_bus', bus='main')]


def test_serial_ports_of_their_own(tmp_path: Path, terminal: str) -> None:
    text = with_serial_buses(terminal, 'slcan', '/dev/no_such_port')
    assert problems(tmp_path, text, adapters=adapters) == []
    assert warnings(tmp_path, text, adapters=adapters) == [
        at('f.yaml:9: buses.other', 'bitrate_assumed', bitrate=125000)]


def test_bus_with_the_name_of_another_channel(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n', """\
      twin: {interface: virtual, channel: main}
      own: {interface: virtual, channel: own}
    drives:
""")
    assert warnings(tmp_path, text) == [
        at('f.yaml:5: buses.main', 'name_of_other_channel', bus='twin')]


def test_no_drives(tmp_path: Path) -> None:
    assert warnings(tmp_path, FILE[:FILE.index('    drives:')]) == [
        at('f.yaml:3: drives', 'no_drive')]


def test_settings_of_the_bridge(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n', '    autostart: no\n    diagnostics_period: 2\n'
                                          '    drives:\n')
    configuration = load(tmp_path, text)
    assert configuration.autostart is False
    assert repr(configuration.diagnostics_period) == '2.0'
    assert configuration.profile_directories == (str(tmp_path),)


@pytest.mark.parametrize('name', ['/nowhere/at/all', f'/{"too_long" * 32}'])
def test_profile_directory_that_is_none(name: str, tmp_path: Path) -> None:
    path = write(tmp_path)
    text = path.read_text().replace(f'[{tmp_path}]', f"['', {tmp_path}, {name}]")
    path.write_text(text)
    assert local(tmp_path, configuration_from_file(path).warnings) == [
        at('f.yaml:3: profile_directories', 'no_directory', name=name)]
    path.write_text(changed(text, 'profile: table', 'profile: tabel'))
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    problem, = local(tmp_path, caught.value.problems)
    assert problem.code == 'unknown_profile' and name in problem.fields['places']


def test_earlier_directory_wins(tmp_path: Path) -> None:
    path = write(tmp_path)
    first = tmp_path / 'first'
    first.mkdir()
    (first / 'table.yaml').write_text('broken')
    path.write_text(path.read_text().replace(f'[{tmp_path}]', f'[{first}, {tmp_path}]'))
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    assert caught.value.problems == [
        at(f'{first}/table.yaml:1: yaml', 'no_profile')]
