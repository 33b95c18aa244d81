# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The CAN adapters that are known, as a page of the documentation.

The page is made of the table that ``validate`` uses; a test compares it. To write it again:
``.venv/bin/python docs/adapters.py``.
"""

from collections.abc import Iterator
from pathlib import Path

from drive_can_bridge.transport.known_adapters import NOT_ON_LINUX, Row, ROWS, TRIED

PAGE = Path(__file__).with_name('adapters.md')
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
    keys = {'interface': row.interface, 'channel': row.channel, **dict(row.options)}
    yield f'`{row.name}`'
    yield row.title
    yield f'`{", ".join(f"{key}: {value}" for key, value in keys.items())}`'
    yield row.differs
    yield '; or '.join(filter(None, (row.cure, row.instead))).replace('|', '\\|')
    yield row.tried
    yield '–' if not listens else f'`{listens.strip(chr(34))}`'


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
