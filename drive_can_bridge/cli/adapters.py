# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The subcommand ``drive_can adapters``: the adapters of this host, and how to configure them.

Reads from the kernel and serial ports, and asks python-can's interfaces that can be asked without
opening a device.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator

from drive_can_bridge.cli.command import complain, print_json, say
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.text import printable
from drive_can_bridge.transport.found_adapters import ask_libraries, FoundAdapter, of_host


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'List the CAN adapters of this host: interfaces of the kernel, serial ports, and what '
        "makers' libraries find; each with its lines for a parameter file. Nothing is opened, so "
        'nothing that runs is disturbed.')
    parser.epilog = 'Exit code 0, also where there is none. docs/adapters.md has what each does.'
    parser.add_argument('--json', action='store_true', help=(
        'a JSON document a line: interface, channel, options, adapter (docs/adapters.md), what, '
        'state, bitrate, latency_ms, remarks'))


def run(args: Namespace) -> int:
    """List the adapters."""
    found = list(of_host())
    more, silent = ask_libraries(args.clock)
    known = {(each.interface, str(each.channel)) for each in found}
    found += [each for each in more if (each.interface, str(each.channel)) not in known]
    for each in found:
        if args.json:
            print_json(_document(each))
        else:
            for line in _lines(each):
                say(line)
    for interface in silent:
        complain(command_sentences.library_hangs(interface=interface))
    if not found:
        complain(command_sentences.no_adapters())
    return 0


def _lines(found: FoundAdapter) -> Iterator[str]:
    yield f'{found.interface} {printable(str(found.channel))}: {found.what}'
    for key, value in {'interface': found.interface, 'channel': found.channel,
                       **found.options}.items():
        yield f'    {key}: {printable(str(value))}'
    for remark in found.remarks:
        yield f'    # {remark}'


def _document(found: FoundAdapter) -> dict[str, object]:
    return {'interface': found.interface, 'channel': found.channel, 'options': found.options,
            'adapter': found.adapter or None, 'what': found.what, 'state': found.state or None,
            'bitrate': found.bitrate or None,
            'latency_ms': None if found.latency is None else round(1e3 * found.latency, 1),
            'remarks': found.remarks}
