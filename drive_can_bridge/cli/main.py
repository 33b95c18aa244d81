# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The command ``drive_can``: everything that a user runs by hand.

Of the subcommands (see :mod:`.command`) only the requested one is imported, so that
``validate`` needs neither python-can nor ROS.

Exit codes: 0 success, 1 the request failed, 2 wrong usage.
"""

import argparse
from argparse import HelpFormatter
from collections.abc import Sequence
import importlib
import os
import re
import signal
import sys
from typing import Any

from drive_can_bridge import __version__
from drive_can_bridge.cli.command import complain, FAILED, Parser, WRONG_USAGE, WrongUsage
from drive_can_bridge.cli.completion import complete, typed
from drive_can_bridge.clock import Clock, SteadyClock
from drive_can_bridge.compiled import build
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.text import nearest
from drive_can_bridge.process.beginning import (
    keep_output, let_signals_in, look_after_outputs)

#: what for, subcommand, one line of help
GROUPS: dict[str, dict[str, str]] = {
    'Try it without hardware': {
        'demo': 'run a bridge, simulated drives and the live view of them',
        'simulate': 'play every drive of a parameter file on its bus',
    },
    'Set up a bridge': {
        'adapters': 'list the CAN adapters of this host',
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
        'jog': 'hold a setpoint for a while',
    },
    'Look': {
        'monitor': 'show all bridges and their drives, live',
        'panel': 'show all bridges and their drives in a browser',
        'record': 'write everything on the buses of a parameter file to a trace',
        'decode': 'say what the frames of a trace, or of a bus, mean',
        'explain': 'say what a code of diagnostics means, and what to do',
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
    'simulate': ('simulate -p robot.yaml --pty',
                 'simulate -p robot.yaml --interface socketcan --channel vcan0'),
    'adapters': ('adapters', 'adapters --json'),
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
    'jog': ('jog axis 60', 'jog conveyor speed_setpoint 300 --for 5'),
    'monitor': ('monitor', 'monitor --json'),
    'panel': ('panel', 'panel --port 8081 --allow-writes'),
    'record': ('record -p robot.yaml -o trace.log',
               'record -p robot.yaml -o trace.blf --seconds 60'),
    'decode': ('decode trace.log -p robot.yaml', 'decode --live -p robot.yaml --only changes'),
    'explain': ('explain not_armed', 'explain silent_since --json'),
    'read': ('read conveyor', 'read conveyor ramp_time p30 --watch 1'),
    'write': ('write conveyor ramp_time=2.5', 'write p30=250 -p robot.yaml'),
    'backup': ('backup conveyor -o conveyor.yaml', 'backup -o backups/ --namespace /cell1'),
    'restore': ('restore conveyor.yaml', 'restore conveyor.yaml spare --dry-run'),
    'compare': ('compare conveyor.yaml conveyor', 'compare monday.yaml tuesday.yaml'),
    'completion': ('completion bash', 'completion zsh'),
}
_INDENT = '  '


class Formatter(HelpFormatter):
    """Wraps paragraphs, and keeps indented lines as they are."""

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


PROGRAM = 'drive_can'

#: options of the program itself
_OF_ALL = ('-h', '--help', '--version')
#: the module of a subcommand, where it is not called so itself
MODULES = dict.fromkeys(('stop', 'enable', 'disable', 'reset'), 'hand')
#: what runs until a signal comes: that is no failure
ENDLESS = ('simulate', 'demo', 'record', 'monitor', 'panel')
#: options that make a subcommand one of these
ENDLESS_OPTIONS = ('--live', '--watch')
#: what ends these like Ctrl-C; SIGHUP comes when a terminal is closed, or its ssh session breaks
_ENDING = (signal.SIGTERM, signal.SIGHUP)
#: subcommands that open no bus, whatever their options
WITHOUT_BUS = (*GROUPS['By hand'], 'monitor', 'panel')
#: act on drives, and end
OF_DRIVES = (*GROUPS['By hand'], *GROUPS['Parameters of drives'])
#: use ROS, whose libraries write to standard output, too; the view of the demo does so itself
WITH_ROS = (*OF_DRIVES, 'monitor', 'panel')
#: only shows things: a reader who stops has seen enough
SHOWING = ('adapters', 'validate', 'decode', 'explain', 'profile')
#: exit codes of what could not be done, where 1 means something else
TROUBLE = {'compare': 2}
#: messages that begin with a place already: ``FILE:LINE:``, ``bus main:``, ``conveyor:``
_PLACED = re.compile(r'(bus )?\w+: |.*?:\d+: |drives\.|buses\.')
#: exit code of what is interrupted before it is done
INTERRUPTED = 130


def main(argv: Sequence[str] | None = None, clock: Clock | None = None) -> int:
    """
    Run the command.

    :param argv: arguments without the program's name; None: those of the process.
    :param clock: the clock of all waiting; None: that of this machine.
    :return: exit code.
    """
    arguments = _in_order(sys.argv[1:] if argv is None else argv)
    wanted = subcommand_in(arguments)
    failed = TROUBLE.get(wanted, FAILED)
    prefix = f'{PROGRAM} {wanted}'.rstrip()
    endless = wanted in ENDLESS or any(
        word.partition('=')[0] in ENDLESS_OPTIONS for word in arguments)
    if argv is None:
        if wanted in WITH_ROS:
            keep_output()
        look_after_outputs()
    code = None
    if argv is None and endless:  # until the subcommand looks after signals itself
        for number in _ENDING:
            if signal.getsignal(number) is not signal.SIG_IGN:      # nohup
                signal.signal(number, signal.default_int_handler)
    try:
        if argv is None:
            let_signals_in()
        code = _run(arguments, clock or SteadyClock(), alone=argv is None)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # The reader of our output is gone. Python flushes once more on its way out: into nothing.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if code is None:    # it was not done yet
            code = 0 if wanted in SHOWING else failed
        return code
    except KeyboardInterrupt:
        if endless:
            return 0
        complain(f'{prefix}: interrupted')
        return INTERRUPTED
    except DriveCanError as error:
        text = str(error)
        placed = text.startswith(f'{prefix}: ') or _PLACED.match(text)
        complain(text if placed else f'{prefix}: {text}')
        return failed
    except OSError as error:
        place = f'{error.filename}: ' if error.filename else ''
        complain(f'{prefix}: {place}{error.strerror or error}')
        return failed
    except ImportError as error:
        complain(command_sentences.module_missing(command=prefix, module=error.name or error))
        return failed
    except Exception as error:  # noqa: BLE001  no traceback ever reaches a user
        complain(command_sentences.internal_error_of_command(
            command=prefix, kind=type(error).__name__, text=error))
        return failed
    finally:
        if argv is None and endless:  # all is done; Python takes a moment to leave
            for number in (signal.SIGINT, *_ENDING):
                signal.signal(number, signal.SIG_IGN)


def _in_order(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with the subcommand first: its options may stand before it, too."""
    words = list(arguments)
    if words and words[0].startswith('-') and words[0] not in _OF_ALL:
        place = next((place for place, word in enumerate(words) if word in SUBCOMMANDS), 0)
        words.insert(0, words.pop(place))
    return words


def subcommand_in(arguments: Sequence[str]) -> str:
    """Return the requested subcommand; '' where there is none."""
    return next((word for word in arguments if not word.startswith('-')), '')


def understood(arguments: list[str]) -> tuple[Any, argparse.Namespace]:
    """
    Return the module of the subcommand, and its parsed arguments.

    :raises SystemExit: they are wrong, or ask for help.
    """
    completing = typed()
    wanted = subcommand_in(arguments if completing is None else completing)
    parser = Parser(
        prog=PROGRAM, usage=f'{PROGRAM} SUBCOMMAND …', formatter_class=Formatter,
        description='Tools of drive_can_bridge, the bridge from motor drives on CAN buses to '
                    f'ROS 2.\n{overview(PROGRAM)}')
    parser.add_argument('--version', action='version',
                        version=f'{PROGRAM} {__version__} ({build()})')
    subparsers = parser.add_subparsers(dest='subcommand', metavar='SUBCOMMAND', required=True,
                                       help=argparse.SUPPRESS)
    # what the others understand costs as much time as all else here
    parsers = {name: subparsers.add_parser(name, prog=f'{PROGRAM} {name}',
                                           formatter_class=Formatter)
               for name in SUBCOMMANDS if wanted == name or wanted not in SUBCOMMANDS}
    module: Any = None
    if wanted in parsers:
        module = importlib.import_module(f'{__package__}.{MODULES.get(wanted, wanted)}')
        own = parsers[wanted]
        module.define(own)
        own.epilog = '\n\n'.join(filter(None, (own.epilog, examples(PROGRAM, wanted))))
    complete(parser)
    if arguments[:1] == [wanted] and wanted not in parsers:
        near = nearest(wanted, SUBCOMMANDS)
        parser.error(command_sentences.no_subcommand(word=repr(wanted))
                     + (f', did you mean {near}?' if near else ''))
    args, rest = parser.parse_known_args(arguments)
    # answers every question, also where none is asked
    rest = [word for word in rest if word != '--yes']
    if hasattr(args, 'words'):  # argparse takes positional arguments in one piece only
        args.words += [word for word in rest if not _is_option(word)]
        rest = [word for word in rest if _is_option(word)]
    if rest:
        parsers.get(wanted, parser).error(f'unrecognized arguments: {" ".join(rest)}')
    return module, args


def _is_option(word: str) -> bool:
    """Return whether a word is an option; for argparse ``-1e3`` and ``-inf`` are."""
    try:
        float(word)
    except ValueError:
        return word.startswith('-')
    return False


def _run(arguments: list[str], clock: Clock, *, alone: bool) -> int:
    module, args = understood(arguments)
    args.clock = clock
    libraries = None
    if args.subcommand not in WITHOUT_BUS and not (
            args.subcommand in OF_DRIVES and args.params_file is None):
        from drive_can_bridge.transport.library_logs import Few, LibraryLogs
        libraries = LibraryLogs(Few(complain).say, clock.now)
        libraries.install()
    try:
        code: int = module.run(args)
    except WrongUsage as error:
        action = f' {args.action}' if 'action' in args else ''
        complain(f'{PROGRAM} {args.subcommand}{action}: {error}')
        return WRONG_USAGE
    finally:
        if libraries is not None and not alone:     # else there may be more of them
            libraries.take_away()
    return code


if __name__ == '__main__':
    sys.exit(main())
