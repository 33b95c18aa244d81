# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The subcommand ``drive_can adapters``: the adapters of this host, and how to configure them.

Reads from the kernel and serial ports, and asks python-can's interfaces that can be asked without
opening a device. The page ``docs/adapters.md`` is made of the same table:
``python -m drive_can_bridge.cli.adapters`` writes it in a checkout; a test compares it.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path

from drive_can_bridge.cli.command import complain, print_json, say
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.text import printable
from drive_can_bridge.transport.found_adapters import ask_libraries, FoundAdapter, of_host
from drive_can_bridge.transport.known_adapters import (
    NOT_ON_LINUX, Row, ROWS, TRIED)

PAGE = Path('docs', 'adapters.md')
_HEAD = """\
# CAN adapters: how to write yours, and what it does differently

`drive_can adapters` lists what this computer has, each with its lines for the parameter file; it
opens nothing. Here, look for what is printed on the box, or for the interface of python-can (4.3
to 4.6).

The column *lines* goes between the braces of a bus, and the bit rate after it. With the row
`slcan`:

```yaml
    buses:
      main: {interface: slcan, channel: /dev/ttyACM0, bitrate: 500000}
```

* **Where the kernel has a driver, take `socketcan`**: several programs share the interface, and
  stamps are the host's.
* `adapter: NAME` (first column) says which one it is where neither interface nor USB shows it;
  then `drive_can validate` says what it cannot do.
* `/dev/ttyACM0` is numbered as it is plugged; a
  [name that stays](commissioning.md#10-from-now-on-at-boot) is better.
* An adapter that hands back what it sends is logged once; the bridge drops those frames.
* *known by*: {tried}.
* *only listens*: the setting that makes it do so, for `record`, `decode --live` and
  `scan --bitrates`; a bridge needs it off. `–`: none is known; `record` and `decode --live` then
  acknowledge what they hear, as any node does, and `scan --bitrates` is not for that adapter.

"""
_COLUMNS = ('name', 'adapter', 'lines', 'does differently', 'what helps', 'known by',
            'only listens')
_PARTS = {'socketcan': 'Of the kernel', 'slcan': 'Serial, with SLCAN commands',
          'seeedstudio': 'Serial, with packets', 'socketcand': 'Over the network, and without '
          'hardware', 'gs_usb': 'USB, past the kernel', 'pcan': "By the makers' libraries"}
_TAIL = """
Without a row, because they do not exist on Linux: {none}.

## Late answers

An adapter that keeps what it has received makes the answers of *all* drives of its bus late, by
the same time. Diagnostics say so, and name the timer where there is one. An FTDI chip keeps bytes
for 16 ms unless set otherwise: fine at a `period` of 20 ms, and 38 % of the answers are late at
10 ms. For good, by a udev rule:

```
# /etc/udev/rules.d/61-can-latency.rules
ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"
```
"""


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


def page() -> str:
    """Return the text of the page."""
    tried = ';\n  '.join(f'**{letter}** {words}' for letter, words in TRIED.items())
    lines = [_HEAD.rstrip().replace('{tried}', tried)]
    for row in ROWS:
        part = _PARTS.get(row.interface)
        if part is not None and row.interface == row.name:
            lines += ['', f'## {part}', '', f'| {" | ".join(_COLUMNS)} |',
                      f'|{"---|" * len(_COLUMNS)}']
        lines.append(f'| {" | ".join(_cells(row))} |')
    none = ', '.join(f'`{name}` ({why})' for name, why in NOT_ON_LINUX.items())
    return '\n'.join([*lines, _TAIL.replace('{none}', none)])


def _cells(row: Row) -> Iterator[str]:
    listens = row.listen_only
    yield f'`{row.name}`'
    yield row.title
    yield f'`{row.lines}`'
    yield row.differs
    yield row.cure.replace('|', '\\|')
    yield row.tried
    yield '–' if not listens else f'`{listens.strip(chr(34))}`'


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
