# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The examples of every ``--help``, and who runs each.

They are read from the help itself. One that stands in no table, and a row that no help shows, is a
failure (``test/client/test_help_examples.py``).
"""

from contextlib import redirect_stdout
import io
import re
import shlex

from drive_can_bridge.cli.main import PROGRAM, SUBCOMMANDS, understood

#: subcommands of subcommands
ACTIONS = {'profile': ('list', 'show', 'check', 'import')}
_EXAMPLE = re.compile(rf'^ +{PROGRAM} (.+)$', re.MULTILINE)

#: need nothing but files
ALONE = (
    'adapters', 'adapters --json', 'compare monday.yaml tuesday.yaml', 'completion bash',
    'completion zsh', 'explain not_armed', 'explain silent_since --json',
    'profile import drive.eds -o drive.yaml', 'profile list', 'security robot.yaml -o security/',
    'security robot.yaml -o security/ --namespace /cell1', 'validate robot.yaml',
    'validate robot.yaml --json',
)
#: need drives on a bus, and no bridge
DIRECT = (
    'decode trace.log -p robot.yaml', 'probe -p robot.yaml', 'probe lift -p robot.yaml --json',
    'scan --interface slcan --channel /dev/ttyACM0 --bitrate 125k -o found.yaml',
    'scan --interface socketcan --channel can0', 'write p30=250 -p robot.yaml',
)
#: need a bridge
BRIDGE = (
    'backup conveyor -o conveyor.yaml', 'compare conveyor.yaml conveyor', 'disable lift',
    'enable lift', 'jog axis 60', 'jog conveyor speed_setpoint 300 --for 5', 'read conveyor',
    'reset lift', 'reset lift conveyor', 'restore conveyor.yaml',
    'restore conveyor.yaml spare --dry-run', 'stop', 'stop conveyor',
    'write conveyor ramp_time=2.5',
)
#: need one in /cell1
CELL = (
    'backup -o backups/ --namespace /cell1', "disable 'lift*' --namespace /cell1",
    'enable /cell1/lift',
)
#: run until they are ended: as processes
ENDLESS = (
    'decode --live -p robot.yaml --only changes', 'demo', 'demo --drive --duration 60', 'monitor',
    'monitor --json', 'panel', 'panel --port 8081 --allow-writes',
    'read conveyor ramp_time p30 --watch 1', 'record -p robot.yaml -o trace.blf --seconds 60',
    'record -p robot.yaml -o trace.log', 'simulate -p robot.yaml --pty',
    'simulate -p robot.yaml --interface socketcan --channel vcan0',
)

TABLES = (ALONE, DIRECT, BRIDGE, CELL, ENDLESS)


def shown() -> list[str]:
    """Return what the help of all subcommands tells to type, without the program's name."""
    found = []
    for words in [[name] for name in SUBCOMMANDS] + [
            [name, action] for name, actions in ACTIONS.items() for action in actions]:
        with redirect_stdout(io.StringIO()) as text:
            try:
                understood([*words, '--help'])
            except SystemExit as end:
                assert end.code == 0, words
        found += _EXAMPLE.findall(text.getvalue())
    return found


def taken_apart(example: str) -> list[str]:
    """Return the words of an example, as a shell gives them."""
    return shlex.split(example)
