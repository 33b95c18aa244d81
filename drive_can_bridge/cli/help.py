# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``--help`` says: the subcommands in groups, and two examples of each that work."""

from argparse import HelpFormatter

#: what for, subcommand, one line of help
GROUPS: dict[str, dict[str, str]] = {
    'Try it without hardware': {
        'demo': 'run a bridge, simulated drives and the live view of them',
        'simulate': 'play every drive of a parameter file on its bus',
    },
    'Set up a bridge': {
        'scan': 'find the drives on a bus',
        'probe': 'settle by reads which keys a drive needs',
        'profile': 'list, show, check and import parameter tables',
        'validate': 'check a parameter file without touching a bus',
        'security': 'write who may talk to a bridge',
    },
    'By hand': {
        'stop': 'stop drives; without a name all drives of every bridge, at once',
        'enable': 'enable drives',
        'disable': 'disable drives',
        'reset': 'reset the faults of drives',
    },
    'Look': {
        'monitor': 'show all bridges and their drives, live',
        'panel': 'show all bridges and their drives in a browser',
        'record': 'write everything on the buses of a parameter file to a trace',
        'decode': 'say what the frames of a trace, or of a bus, mean',
    },
    'Parameters of drives': {
        'read': 'read parameters of a drive',
        'write': 'set parameters of a drive',
        'backup': 'write the settings of drives to files',
        'restore': 'write the settings of a backup into a drive',
        'compare': 'show what differs between backups and drives',
    },
    'Shell': {
        'completion': 'print what lets Tab complete drives and parameters',
    },
}
#: subcommand -> one line of help
SUBCOMMANDS = {name: text for group in GROUPS.values() for name, text in group.items()}
EXAMPLES: dict[str, tuple[str, str]] = {
    'demo': ('demo', 'demo --drive --duration 60'),
    'simulate': ('simulate -p robot.yaml --pty', 'simulate -p robot.yaml --interface vcan0'),
    'scan': ('scan --interface socketcan --channel can0',
             'scan --interface slcan --channel /dev/ttyACM0 --bitrate 125k -o found.yaml'),
    'probe': ('probe -p robot.yaml', 'probe lift -p robot.yaml --json'),
    'profile': ('profile list', 'profile import drive.eds -o drive.yaml'),
    'validate': ('validate robot.yaml', 'validate robot.yaml --json'),
    'security': ('security robot.yaml -o security/',
                 'security robot.yaml -o security/ --namespace /cell1'),
    'stop': ('stop', 'stop conveyor'),
    'enable': ('enable lift', 'enable /cell1/lift'),
    'disable': ('disable lift', "disable 'lift*' --namespace /cell1"),
    'reset': ('reset lift', 'reset lift conveyor'),
    'monitor': ('monitor', 'monitor --json'),
    'panel': ('panel', 'panel --port 8081 --allow-writes'),
    'record': ('record -p robot.yaml -o trace.log',
               'record -p robot.yaml -o trace.blf --seconds 60'),
    'decode': ('decode trace.log -p robot.yaml', 'decode --live -p robot.yaml --only changes'),
    'read': ('read conveyor', 'read conveyor ramp_time p30 --watch 1'),
    'write': ('write conveyor ramp_time=2.5', 'write p30=250 -p robot.yaml'),
    'backup': ('backup conveyor -o conveyor.yaml', 'backup -o backups/ --namespace /cell1'),
    'restore': ('restore conveyor.yaml', 'restore conveyor.yaml spare --dry-run'),
    'compare': ('compare conveyor.yaml conveyor', 'compare monday.yaml tuesday.yaml'),
    'completion': ('completion bash', 'completion zsh'),
}
_INDENT = '  '


class Formatter(HelpFormatter):
    """Wraps paragraphs, and leaves lines alone that are indented."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return '\n'.join(
            indent + line if line.startswith(_INDENT) or not line
            else super(Formatter, self)._fill_text(line, width, indent)
            for line in text.split('\n'))


def overview(program: str) -> str:
    """Return all subcommands in their groups."""
    width = max(map(len, SUBCOMMANDS))
    lines = []
    for title, group in GROUPS.items():
        lines += ['', f'{title}:', *(f'{_INDENT}{name:{width}}  {text}'
                                     for name, text in group.items())]
    return '\n'.join([*lines, '', f'{program} SUBCOMMAND --help says more, with examples.'])


def examples(program: str, subcommand: str) -> str:
    """Return the examples of a subcommand."""
    return '\n'.join(['examples:', *(f'{_INDENT}{program} {words}'
                                     for words in EXAMPLES[subcommand])])
