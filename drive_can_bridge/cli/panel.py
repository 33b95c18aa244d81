# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can panel``: the drives in a browser.

A ROS client and a web server, nothing of a bridge. It never moves anything.
"""

import argparse
from collections.abc import Callable
import socket
import sys

from drive_can_bridge.cli.command import imports_of, namespace, whole
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.process import environment
from drive_can_bridge.process.beginning import leave
from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.resources import command_that_brings

COMMAND = 'drive_can panel'
#: messages per second to be sampled for all drives that are not in focus
BUDGET = 300.0


def define(parser: argparse.ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Show all bridges and their drives in a browser, until SIGINT or SIGTERM. '
        'Prints an address for each role: a viewer looks, an operator may stop '
        'drives, too. Never moves anything.')
    parser.add_argument('--host', default='127.0.0.1',
                        help='address to listen on; anything but the loopback lets others on the '
                             'network in who have a token (default: %(default)s)')
    parser.add_argument('--port', type=whole(0, 65535), default=8080,
                        help='0: any (default: %(default)s)')
    parser.add_argument('--allow-writes', action='store_true',
                        help='operators may write parameters and restore backups')
    parser.add_argument('--namespace', metavar='NS', default='', type=namespace,
                        help='only bridges in this namespace, or below it')


def run(args: argparse.Namespace) -> int:
    """
    Serve the pages.

    :return: 0 after SIGINT or SIGTERM.
    :raises DriveCanError: no ROS, no NiceGUI, the port is taken.
    """
    with SignalWatcher(args.clock, keep=True) as watcher:
        if not _serve(args, lambda: watcher.signalled):
            print(f'{COMMAND}: ended before it served a page', file=sys.stderr)
        code = watcher.exit_code(0)
        leave(code)
        return code


def _module(error: ImportError) -> str:
    """Return which module to install: another one that is missing comes with NiceGUI."""
    return 'nicegui' if error.name in (None, 'nicegui') else f'nicegui ({error.name})'


def _serve(args: argparse.Namespace, ended: Callable[[], bool]) -> bool:
    """Serve until the end; return whether the addresses were printed before it came."""
    with imports_of(COMMAND):
        from drive_can_bridge.ros.monitor.client import MonitorClient, ServiceOperations
    if ended():     # what follows takes seconds, too
        return False
    try:
        from drive_can_bridge.panel.access import is_loopback, PanelAccess, PanelRole
        from drive_can_bridge.panel.feed import Feed
        from drive_can_bridge.panel.pages import application, PanelSetting
        from drive_can_bridge.panel.server import address, listen, serve
    except ImportError as error:
        raise DriveCanError(command_sentences.extra_missing(
            command=COMMAND, module=_module(error), how=command_that_brings('panel'))) from error
    if ended():
        return False
    listener = listen(args.host, args.port)
    access = PanelAccess(host=args.host, port=listener.getsockname()[1])
    model = Model(args.namespace)
    source = MonitorClient(model, budget=BUDGET)
    place = environment.in_words()
    served = False

    def ready() -> None:
        nonlocal served
        served = True
        for words in filter(None, (place, environment.elsewhere(args.namespace or None))):
            print(f'{COMMAND}: {words}', file=sys.stderr)
        if not is_loopback(args.host):
            print(f'{COMMAND}: listens on {args.host}: who reaches this machine and has a '
                  f'token gets in, and who sees the traffic sees the token (no TLS); '
                  f'docs/security.md says how to do better', file=sys.stderr)
        for role in (PanelRole.OPERATOR, PanelRole.VIEWER):
            print(f'{role.value}: {address(listener, access.tokens[role])}', flush=True)
    try:
        app = application(Feed(source, ServiceOperations(source.node), model, args.clock), access,
                          PanelSetting(place,
                                       f'{socket.gethostname()} · {place.partition(",")[0]}',
                                       args.allow_writes))
        serve(app, listener, access, args.clock, ended=ended, ready=ready)
    finally:
        source.close()
    return served
