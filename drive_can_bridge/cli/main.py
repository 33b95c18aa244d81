# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The command ``drive_can``: everything that a person runs by hand.

Of the subcommands (see :mod:`.command`) only the one that was asked for is imported, so that
``validate`` needs neither python-can nor ROS.

Exit codes: 0 success, 1 the request failed, 2 wrong usage.
"""

import argparse
from collections.abc import Sequence
import importlib
import io
import os
import re
import signal
import sys
from typing import Any

from drive_can_bridge import __version__
from drive_can_bridge.cli.argcomplete_hook import complete, typed
from drive_can_bridge.cli.command import complain, FAILED, Parser, WRONG_USAGE, WrongUsage
from drive_can_bridge.cli.help import examples, Formatter, overview, SUBCOMMANDS
from drive_can_bridge.clock import Clock, SteadyClock
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.process.beginning import let_signals_in

PROGRAM = 'drive_can'

#: the module of a subcommand, where it is not called so itself
MODULES = {**dict.fromkeys(('stop', 'enable', 'disable', 'reset'), 'control'),
           'completion': 'completion_script'}
#: what runs until a signal comes: that is no failure
ENDLESS = ('simulate', 'demo', 'record', 'monitor', 'panel')
#: options that make a subcommand one of these
ENDLESS_OPTIONS = ('--live', '--watch')
#: only shows things: whoever reads no further has seen enough
SHOWING = ('validate', 'decode', 'profile')
#: exit codes of what could not be done, where 1 says something else
TROUBLE = {'compare': 2}
#: what says itself where something is wrong: ``FILE:LINE:``, ``bus main:``, ``conveyor:``
_PLACED = re.compile(r'(bus )?\w+: |.*?:\d+: |drives\.|buses\.')
#: exit code of what is interrupted before it is done
INTERRUPTED = 130


def main(argv: Sequence[str] | None = None, clock: Clock | None = None) -> int:
    """
    Run the command.

    :param argv: arguments without the program's name; None: those of the process.
    :param clock: what everything waits by; None: that of this machine.
    :return: exit code.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    wanted = _wanted(arguments)
    failed = TROUBLE.get(wanted, FAILED)
    prefix = f'{PROGRAM} {wanted}'.rstrip()
    endless = wanted in ENDLESS or any(
        word.partition('=')[0] in ENDLESS_OPTIONS for word in arguments)
    if argv is None:
        _look_after_outputs()
    code = None
    if argv is None and endless:  # until the subcommand looks after signals itself
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        if argv is None:
            let_signals_in()
        code = _run(arguments, clock or SteadyClock())
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # Whoever read our output has gone. Python flushes once more on its way out: into nothing.
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
        complain(f'{prefix}: this needs a Python module that is not installed: '
                 f'{error.name or error}')
        return failed
    except Exception as error:  # noqa: BLE001  no traceback ever reaches a user
        complain(f'{prefix}: internal error, please report it: {type(error).__name__}: {error}')
        return failed
    finally:
        if argv is None and endless:  # all is done; Python takes a moment to leave
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, signal.SIG_IGN)


def _look_after_outputs() -> None:
    """Let nothing that is said raise an error: an output may be one that has no … or °."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')


def _wanted(arguments: list[str]) -> str:
    return next((word for word in arguments if not word.startswith('-')), '')


def understood(arguments: list[str]) -> tuple[Any, argparse.Namespace]:
    """
    Return the module of the subcommand, and what its arguments mean.

    :raises SystemExit: they mean nothing, or help is all that is wanted.
    """
    completing = typed()
    wanted = _wanted(arguments if completing is None else completing)
    parser = Parser(
        prog=PROGRAM, usage=f'{PROGRAM} SUBCOMMAND …', formatter_class=Formatter,
        description='Tools of drive_can_bridge, the bridge from motor drives on CAN buses to '
                    f'ROS 2.\n{overview(PROGRAM)}')
    parser.add_argument('--version', action='version', version=f'{PROGRAM} {__version__}')
    subparsers = parser.add_subparsers(dest='subcommand', metavar='SUBCOMMAND', required=True,
                                       help=argparse.SUPPRESS)
    parsers = {name: subparsers.add_parser(name, prog=f'{PROGRAM} {name}',
                                           formatter_class=Formatter)
               for name in SUBCOMMANDS}
    module: Any = None
    if wanted in parsers:
        module = importlib.import_module(f'{__package__}.{MODULES.get(wanted, wanted)}')
        own = parsers[wanted]
        module.define(own)
        own.epilog = '\n\n'.join(filter(None, (own.epilog, examples(PROGRAM, wanted))))
    complete(parser)
    args, rest = parser.parse_known_args(arguments)
    if hasattr(args, 'words'):  # argparse takes positional arguments in one piece only
        args.words += [word for word in rest if not word.startswith('-')]
        rest = [word for word in rest if word.startswith('-')]
    if rest:
        parsers.get(wanted, parser).error(f'unrecognized arguments: {" ".join(rest)}')
    return module, args


def _run(arguments: list[str], clock: Clock) -> int:
    module, args = understood(arguments)
    args.clock = clock
    try:
        code: int = module.run(args)
    except WrongUsage as error:
        action = f' {args.action}' if 'action' in args else ''
        complain(f'{PROGRAM} {args.subcommand}{action}: {error}')
        return WRONG_USAGE
    return code


if __name__ == '__main__':
    sys.exit(main())
