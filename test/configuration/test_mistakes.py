# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What people get wrong in a parameter file, and what they are told, read line by line.

``mistakes.yaml``: what stands in the file instead of what, and every line that is said. The lines
were judged by hand: do they lead the right way?
"""

from pathlib import Path
from string import Formatter
from typing import Any

import pytest
import yaml

from drive_can_bridge.cli.main import main
from drive_can_bridge.core import complaints
from drive_can_bridge.core.messages import Text
from drive_can_bridge.resources import profiles_directory
from drive_can_bridge.transport.adapters import adapter_keywords

#: as in the README
FILE = """\
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {interface: socketcan, channel: can0, bitrate: 1000000}
    drives:
      axis: {bus: main, protocol: cia402, station: 5, profile: cia402_servo, mode: pv,
             response_pdos: [1, 2], cyclic_request: [target_velocity],
             cyclic_response: [actual_velocity, actual_position]}
"""
STORIES: list[dict[str, Any]] = yaml.safe_load(
    Path(__file__).with_name('mistakes.yaml').read_text(encoding='utf-8'))


def written(story: dict[str, Any]) -> str:
    """Return the file with the mistake."""
    text = story.get('file', FILE)
    for old, new in story.get('instead', {}).items():
        assert text.count(old) == 1, old
        text = text.replace(old, str(new))
    return str(text)


def told(place: Path, text: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return what ``drive_can validate`` says of a file, without its name."""
    file = place / 'f.yaml'
    file.write_text(text, encoding='utf-8')
    capsys.readouterr()
    code = main(['validate', str(file)])
    lines = capsys.readouterr().err.splitlines()
    assert code == int(any(not line.startswith('warning') for line in lines))
    return [line.replace(f'{file}:', '').replace(str(profiles_directory()), 'PROFILES')
            for line in lines]


@pytest.mark.parametrize('story', STORIES, ids=lambda story: story['mistake'])
def test_mistake(tmp_path: Path, story: dict[str, Any],
                 capsys: pytest.CaptureFixture[str]) -> None:
    interface, _, key = story.get('keyword', '').partition(' ')
    expected = list(story['told'])
    if key and key not in (adapter_keywords(interface) or ()):   # as slcan before python-can 4.4
        expected.insert(0, f'warning: 4: buses.main.{key}: the adapter for {interface} does not '
                           f'name this key; it is handed over all the same')
    assert told(tmp_path, written(story), capsys) == expected


def test_there_are_many_and_the_file_itself_is_good(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert len(STORIES) >= 50 and told(tmp_path, FILE, capsys) == []


@pytest.mark.parametrize(('row', 'mistake'), [
    (complaints.channel_of_kernel, 'interface: the name of the device'),
    (complaints.channel_of_serial, 'interface: a serial port'),
    (complaints.number_in_words, 'bitrate: with a letter'),
    (complaints.word_as_bool, 'a bus called on'),
    (complaints.one_entry, 'cyclic_request: no list'),
    (complaints.no_space, 'a space is missing'),
    (complaints.no_colon, 'a colon is missing'),
    (complaints.two_keys_in_line, 'two keys in one line'),
    (complaints.other_entry_meant, 'another entry where one was meant: a drive'),
    (complaints.not_below, 'nothing is indented below the drive'),
    (complaints.without_head, 'without a head'),
    (complaints.parameters_missing, 'without ros__parameters'),
    (complaints.two_protocols, 'protocol: canopen'),
    (complaints.to_be_imported, 'profile: an EDS file'),
    (complaints.some_allowed, 'cyclic_response: a name that is like none'),
    (complaints.status_word_mapped, 'cyclic_response: the status word'),
], ids=lambda each: getattr(each, 'code', each))
def test_row_of_a_mistake(row: Text, mistake: str) -> None:
    """Its longest words stand in what is said of that mistake."""
    words = max((before for text in row.texts for before, *_ in Formatter().parse(text)), key=len)
    story, = (each for each in STORIES if each['mistake'] == mistake)
    assert any(words in line for line in story['told'])
