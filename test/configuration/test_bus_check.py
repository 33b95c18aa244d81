# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is wrong with a bus or with the whole: one changed line each."""

from pathlib import Path

from configuration_builders import changed, FILE, load, problems, warnings, write
import pytest

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.sentences import Sentence, uncoded

CASES = [
    ('bitrate: 125000', 'bitrate: 10000',
     ['f.yaml:5: buses.main: worst-case load 332.8 % at 10000 bit/s (conveyor 166.4 %, lift '
      '166.4 %), allowed is 100 %: use longer periods, fewer drives or a higher bit rate']),
    ('bitrate: 125000', 'bitrate: 26000',
     ['f.yaml:5: buses.main: worst-case load 128.0 % at 26000 bit/s (conveyor 64.0 %, lift '
      '64.0 %), allowed is 100 %: use longer periods, fewer drives or a higher bit rate']),
    ('bitrate: 125000', 'bitrate: fast',
     ["f.yaml:8: buses.main.bitrate: 'fast' is a string, allowed is an integer of 1000 to "
      '1000000']),
    ('bitrate: 125000', 'bitrate: 1.25e5',
     ['f.yaml:8: buses.main.bitrate: 125000.0 is a number, allowed is an integer of 1000 to '
      '1000000']),
    ('bitrate: 125000', 'bitrate: 2000000',
     ['f.yaml:8: buses.main.bitrate: 2000000 is out of range, allowed is an integer of 1000 to '
      '1000000']),
    ('bitrate: 125000', 'bitrat: 125000',
     ["f.yaml:8: buses.main.bitrat: unknown key, did you mean 'bitrate'?"]),
    ('bitrate: 125000', 'can_filter: 1',
     ["f.yaml:8: buses.main.can_filter: unknown key, did you mean 'can_filters'? It is set by the "
      'bridge itself']),
    ('bitrate: 125000', 'reconect_period: 1',
     ["f.yaml:8: buses.main.reconect_period: unknown key, did you mean 'reconnect_period'?"]),
    ('bitrate: 125000', 'reconnect_period: 0',
     ['f.yaml:8: buses.main.reconnect_period: 0 is out of range, allowed is a number of 0.01 '
      'to 3600']),
    ('bitrate: 125000', 'fd: true',
     ['f.yaml:8: buses.main.fd: set by the bridge itself, allowed is to leave it out']),
    ('bitrate: 125000', 'can_filters: []',
     ['f.yaml:8: buses.main.can_filters: set by the bridge itself, allowed is to leave it out']),
    ('bitrate: 125000', 'receive_own_messages: true',
     ['f.yaml:8: buses.main.receive_own_messages: set by the bridge itself, allowed is to '
      'leave it out']),
    ('bitrate: 125000', 'ignore_config: true',
     ['f.yaml:8: buses.main.ignore_config: set by the bridge itself, allowed is to leave it out']),
    ('bitrate: 125000', 'rx_queue_size: .nan',
     ['f.yaml:8: buses.main.rx_queue_size: nan is not a finite number, allowed is a string or '
      'a number or true or false or a list']),
    ('bitrate: 125000', 'extra: {a: 1}',
     ['f.yaml:8: buses.main.extra: a mapping, allowed is a string or a number or true or false '
      'or a list']),
    ('channel: demo', 'channel: 1.5',
     ['f.yaml:7: buses.main.channel: 1.5 is a number, allowed is a string or an integer']),
    ('channel: demo', 'channel: ""',
     ['f.yaml:7: buses.main.channel: an empty string, allowed is text']),
    ('        channel: demo\n', '',
     ['f.yaml:5: buses.main.channel: missing, allowed is a string or an integer']),
    ('interface: virtual', 'interfaces: virtual',
     ['f.yaml:5: buses.main.interface: missing, allowed is a string',
      "f.yaml:6: buses.main.interfaces: unknown key, did you mean 'interface'?"]),
    ('interface: virtual', 'interface: yes',
     ['f.yaml:6: buses.main.interface: true is a bool, allowed is a string']),
    ('      main:\n', '      "ma in":\n',
     ["f.yaml:5: buses.ma in: 'ma in' is wrong, allowed is a name of letters, digits, _ and -, "
      'at most 100 characters',
      "f.yaml:11: drives.conveyor.bus: 'main' is unknown, did you mean 'ma in'?",
      "f.yaml:20: drives.lift.bus: 'main' is unknown, did you mean 'ma in'?"]),
    ('    drives:\n', '    drivers:\n',
     ["f.yaml:9: drivers: unknown key, did you mean 'drives'?"]),
    ('    drives:\n', '    diagnostics_period: 0\n    autostart: 1\n    drives:\n',
     ['f.yaml:9: diagnostics_period: 0 is out of range, allowed is a number of 0.01 to 3600',
      'f.yaml:10: autostart: 1 is an integer, allowed is true or false']),
    ('    drives:\n', '    autostart: maybe\n    drives:\n',
     ["f.yaml:9: autostart: 'maybe' is a string, allowed is true or false"]),
    ('    drives:\n', '    use_sim_tim: true\n    drives:\n',
     ["f.yaml:9: use_sim_tim: unknown key, did you mean 'use_sim_time'?"]),
]


@pytest.mark.parametrize(('old', 'new', 'expected'), CASES)
def test_problem_of_a_bus(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(FILE, old, new)) == expected


class Adapters:
    """Knowledge about made-up adapters."""

    def adapter_keywords(self, interface: str) -> set[str] | None:
        return {'channel', 'bitrates', 'rx_queue_size'} if interface == 'virtual' else None

    def check_interface(self, interface: str) -> Sentence | None:
        return None if interface in ('virtual', 'closed') else uncoded(
            'no such thing, allowed is virtual')

    def check_channel(self, interface: str, channel: str | int) -> Sentence | None:
        return uncoded('no channel, allowed is room') if channel == 7 else None

    def check_bitrate(self, interface: str, bitrate: int) -> Sentence | None:
        return uncoded('impossible, allowed is 500000') if bitrate == 500 * 100 else None


@pytest.mark.parametrize(('old', 'new', 'expected'), [
    ('interface: virtual', 'interface: virtul',
     ['f.yaml:6: buses.main.interface: no such thing, allowed is virtual']),
    ('channel: demo', 'channel: 7',
     ['f.yaml:7: buses.main.channel: no channel, allowed is room']),
    ('bitrate: 125000', 'bitrate: 50000',
     ['f.yaml:8: buses.main.bitrate: impossible, allowed is 500000']),
    # close to a key of ours, but the adapter knows it
    ('bitrate: 125000', 'bitrates: 5', []),
    ('bitrate: 125000', 'bitrats: 5',
     ["f.yaml:8: buses.main.bitrats: unknown key, did you mean 'bitrate'?"]),
])
def test_what_adapters_know(tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    assert problems(tmp_path, changed(FILE, old, new), adapters=Adapters()) == expected


def test_key_that_the_adapter_does_not_name(tmp_path: Path) -> None:
    text = changed(FILE, 'bitrate: 125000', 'rx_queue_siz: 5\n        other: 1')
    assert warnings(tmp_path, text, adapters=Adapters()) == [
        'f.yaml:8: buses.main.rx_queue_siz: the adapter for virtual does not name this key (did '
        "you mean 'rx_queue_size'?); it is handed over all the same",
        'f.yaml:9: buses.main.other: the adapter for virtual does not name this key; it is handed '
        'over all the same']
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
    # two drives with 16000 + 640 bits a second each
    assert warnings(tmp_path, changed(FILE, 'bitrate: 125000', 'bitrate: 47543')) == []
    assert warnings(tmp_path, changed(FILE, 'bitrate: 125000', 'bitrate: 47542')) == [
        'f.yaml:5: buses.main: worst-case load 70.0 % at 47542 bit/s (conveyor 35.0 %, lift 35.0 '
        '%), recommended is at most 70 %']
    assert problems(tmp_path, changed(FILE, 'bitrate: 125000', 'bitrate: 33280')) == []
    assert len(problems(tmp_path, changed(FILE, 'bitrate: 125000', 'bitrate: 33279'))) == 1


def test_no_look_at_the_maps_no_load(tmp_path: Path) -> None:
    text = FILE.replace('        bus: main\n', '        bus: main\n        mapping: assume\n')
    assert problems(tmp_path, changed(text, 'bitrate: 125000', 'bitrate: 32000')) == []
    assert problems(tmp_path, changed(text, 'bitrate: 125000', 'bitrate: 31999')) != []


def test_standard_parameters(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n', '    use_sim_time: true\n'
                   '    start_type_description_service: false\n'
                   '    qos_overrides: {/x.y: {publisher: {depth: 1}}}\n'
                   '    qos_overrides./a.publisher.depth: 1\n    drives:\n')
    assert problems(tmp_path, text) == []


def test_bus_that_is_opened_twice(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n',
                   '      other: {interface: virtual, channel: demo}\n    drives:\n')
    assert warnings(tmp_path, text) == [
        "f.yaml:9: buses.other.channel: 'demo' is also the channel of bus main; identifiers and "
        'load are checked for each bus alone']


def test_bus_with_the_name_of_another_channel(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n', """\
      twin: {interface: virtual, channel: main}
      own: {interface: virtual, channel: own}
    drives:
""")
    assert warnings(tmp_path, text) == [
        'f.yaml:5: buses.main: bus twin has a channel of this name: decode takes what other '
        "programs' traces have of it for this bus"]


def test_no_drives(tmp_path: Path) -> None:
    assert warnings(tmp_path, FILE[:FILE.index('    drives:')]) == [
        'f.yaml:3: drives: no drive is configured']


def test_settings_of_the_bridge(tmp_path: Path) -> None:
    text = changed(FILE, '    drives:\n', '    autostart: no\n    diagnostics_period: 2\n'
                                          '    drives:\n')
    configuration = load(tmp_path, text)
    assert configuration.autostart is False
    assert repr(configuration.diagnostics_period) == '2.0'
    assert configuration.profile_directories == (str(tmp_path),)


def test_profile_directory_that_is_none(tmp_path: Path) -> None:
    path = write(tmp_path)
    text = path.read_text().replace(f'[{tmp_path}]', f"['', {tmp_path}, /nowhere/at/all]")
    path.write_text(text)
    assert configuration_from_file(path).warnings == (
        f"{path}:3: profile_directories: '/nowhere/at/all' is no directory",)


def test_earlier_directory_wins(tmp_path: Path) -> None:
    path = write(tmp_path)
    first = tmp_path / 'first'
    first.mkdir()
    (first / 'table.yaml').write_text('broken')
    path.write_text(path.read_text().replace(f'[{tmp_path}]', f'[{first}, {tmp_path}]'))
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    assert caught.value.problems == [
        f'{first}/table.yaml:1: yaml: no mapping, allowed are protocols, parameters, control, '
        'description']
