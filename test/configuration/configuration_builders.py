# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameter files and profiles for the tests of the configuration, and what is wrong with them."""

import math
from pathlib import Path
from typing import Any

from saying import says

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.protocols.families import FAMILIES

#: the families as a sentence lists them
PROTOCOLS = f'{", ".join(list(FAMILIES)[:-1])} or {list(FAMILIES)[-1]}'

#: a good file; tests change a line of it. The line numbers in tests count from here.
HEAD = """\
/**/drive_can_bridge:
  ros__parameters:
    autostart: true
    buses:
      main:
        interface: virtual
        channel: demo
        bitrate: 125000
    drives:
"""
FILE = HEAD + """\
      conveyor:
        bus: main
        protocol: datamodel_extended
        station: 1
        profile: table
        period: 0.02
        cyclic_request: [speed, limit]
        cyclic_response: [actual, current, status]
        rearm: neutral
      lift:
        bus: main
        protocol: datamodel_extended
        station: 2
        profile: table
        cyclic_request: [speed]
        cyclic_response: [actual, status]
"""

#: a good profile, likewise
PROFILE = """\
description: for tests
protocols: [datamodel_extended]
parameters:
  speed: {number: 50, type: int16, scale: 0.1, unit: rpm, minimum: -3000, maximum: 3000}
  limit: {neutral: 100, limit: true, number: 51, type: uint16}
  word: {number: 52, type: uint16, storage: ram}
  flag: {number: 53, type: bool}
  angle: {number: 54, type: int16, unit: deg}
  order: {number: 55, access: wo}
  actual: {number: 209, type: int16, scale: 0.1, unit: rpm, access: ro}
  current: {number: 210, type: int16, scale: 0.01, unit: A, access: ro}
  status: {number: 211, access: ro, bits: {ready: 0, fault: 3}}
  position: {number: 214, type: int16, unit: rev, access: ro}
  frequency: {number: 215, unit: Hz, access: ro}
  ramp: {number: 30, scale: 0.01, unit: s, storage: eeprom, minimum: 0.01, maximum: 60}
control:
  parameter: word
  words: {disable: 0, enable: 1, quick_stop: 2, reset_fault: 128}
  status: {parameter: status, ready: [1, 1], enabled: [2, 2], fault: [8, 8]}
"""


def changed(text: str, old: str, new: str) -> str:
    """Change one place of a text, which has to be there."""
    if text.count(old) < 1:
        raise ValueError(f'{old!r} is not in the text')
    return text.replace(old, new, 1)


def line_of(text: str, part: str) -> int:
    """Return the line in which a part of a text begins, counted from 1."""
    return text.count('\n', 0, text.index(part)) + 1


def write(folder: Path, text: str = FILE, profile: str = PROFILE) -> Path:
    """Write a parameter file and the profile it names."""
    (folder / 'table.yaml').write_text(profile, encoding='utf-8')
    place = f'    profile_directories: [{folder}]\n'
    text = text.replace('    autostart: true\n', place, 1)
    path = folder / 'f.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def load(folder: Path, text: str = FILE, profile: str = PROFILE,
         adapters: Any = None) -> BridgeConfiguration:
    """Read the texts as files."""
    return configuration_from_file(write(folder, text, profile), adapters=adapters)


def problems(folder: Path, text: str = FILE, profile: str = PROFILE,
             adapters: Any = None) -> list[Sentence]:
    """Return what is wrong with the texts, without the directory."""
    try:
        load(folder, text, profile, adapters)
    except ConfigurationError as error:
        return local(folder, error.problems)
    return []


def warnings(folder: Path, text: str = FILE, profile: str = PROFILE,
             adapters: Any = None) -> list[Sentence]:
    """Return what is suspicious about the texts, without the directory."""
    return local(folder, load(folder, text, profile, adapters).warnings)


def local(folder: Path, lines: Any) -> list[Sentence]:
    """Take a directory out of lines and out of their fields."""
    return [Sentence(line.replace(f'{folder}/', ''), line.code, {
        name: value.replace(f'{folder}/', '') if type(value) is str else value
        for name, value in line.fields.items()}) for line in lines]


def at(place: str, code: str, **fields: Any) -> says:
    """Return what a problem at ``FILE:LINE: KEY`` is equal to, or one at ``KEY``."""
    if ':' not in place:
        return says(code, file='', key=place, **fields)
    file, line, key = place.replace(' ', '', 1).split(':', 2)
    return says(code, file=file, line=int(line), key=key, **fields)


def parts(**shares: float) -> str:
    """Return the shares of a bus, in %, as a sentence lists them by drive."""
    return ', '.join(f'{drive} {share} %' for drive, share in shares.items())


#: plain scalars and what rcl makes of them
SCALARS: list[tuple[str, object]] = [
    *((word, True) for word in ('y', 'Y', 'yes', 'Yes', 'YES', 'on', 'On', 'ON', 'true', 'True',
                                'TRUE')),
    *((word, False) for word in ('n', 'N', 'no', 'No', 'NO', 'off', 'Off', 'OFF', 'false',
                                 'False', 'FALSE')),
    ('tRUE', 'tRUE'), ('oN', 'oN'),
    ('0', 0), ('5', 5), ('+5', 5), ('-5', -5), ('-0', 0),
    ('010', 8), ('-010', -8), ('0777', 511), ('08', 8.0), ('0o17', '0o17'), ('0b11', '0b11'),
    ('0x3F0', 1008), ('0X3f0', 1008), ('-0x10', -16), ('0x', '0x'), ('0xg', '0xg'),
    ('1_000', '1_000'), ('1,000', '1,000'), ('٥', '٥'),
    ('9223372036854775807', 9223372036854775807),
    ('9223372036854775808', 9223372036854775808.0),
    ('-9223372036854775808', -9223372036854775808),
    ('0x8000000000000000', 9223372036854775808.0),
    ('99999999999999999999', 1e20),
    ('1.5', 1.5), ('1.', 1.0), ('.5', 0.5), ('-.5', -0.5), ('1e3', 1000.0), ('1E+3', 1000.0),
    ('-0.0', -0.0), ('1e', '1e'), ('.', '.'), ('1.5.5', '1.5.5'), ('1e5L', '1e5L'),
    ('0x1p4', 16.0), ('0x1.8', 1.5), ('0x.8p1', 1.0),
    ('1e400', '1e400'), ('1e-400', '1e-400'), ('1e-310', '1e-310'), ('0e-999', 0.0),
    ('inf', math.inf), ('Infinity', math.inf), ('-inf', -math.inf), ('INF', math.inf),
    ('.inf', math.inf), ('.Inf', math.inf), ('+.INF', math.inf), ('-.inf', -math.inf),
    ('.iNF', '.iNF'), ('.infinity', '.infinity'),
    ('null', 'null'), ('~', '~'), ('=', '='), ('<<', '<<'), ('abc', 'abc'), ('a b', 'a b'),
    ('2024-01-01', '2024-01-01'), ('12:30:00', '12:30:00'), ('/dev/ttyACM0', '/dev/ttyACM0'),
]
