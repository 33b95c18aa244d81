# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the messages mean, as a page of the documentation.

The page is made of the rows of the catalogue, in the order of its files; a test compares it. To
write it again: ``.venv/bin/python docs/messages.py``.
"""

import inspect
from pathlib import Path
import re
from types import ModuleType

from drive_can_bridge.cli import explain
from drive_can_bridge.core import sentences
from drive_can_bridge.core.codes import MODULES
from drive_can_bridge.core.messages import Text

PAGE = Path(__file__).with_name('messages.md')
_HEADING = re.compile(r'# -- (.*?)(?: -+)?')
_ROW = re.compile(r'(\w+) = Text\(')

_HEAD = """\
# What the messages mean, and what to do

Search this page for the `code` of a status in `/diagnostics` ([what else it
has](ros_interface.md)), or give it to `drive_can explain`, which takes a line of the log, or some
words of one, too:

```sh
drive_can explain not_armed bus_up
drive_can explain "conveyor: read ramp_time (P30): no answer in 0.1 s, 3 attempts"
```

In `<brackets>` stands what changes; several texts of a code are its forms. Where the last column
is empty, the text says what is allowed. `messages.md#not_armed` leads to the row of that code.

Made by `docs/messages.py`, of the rows that `core/codes.py` names.
"""
_FILES = """
# What can be wrong with a parameter file or a profile

`drive_can validate` and the bridge say it with file, line and key; each text says what is allowed.
"""
_TABLE = ['', '| code | text | what to do |', '|---|---|---|']


def page() -> str:
    """Return the text of the page."""
    of_drives = sorted(
        [section for about, modules in MODULES.items() if about != 'files'
         for module in modules for section in _sections(module, '')],
        key=lambda section: not section[0].startswith('Diag'))
    of_files = [section for module in MODULES['files']
                for section in _sections(module, 'files: ')]
    lines = [_HEAD]
    for sections in (of_drives, of_files):
        lines += [f'* [{title}](#{_slug(title)})' for title, _ in sections]
    for sections, head, prefix in ((of_drives, '', ''), (of_files, _FILES, explain.OF_FILES)):
        lines.append(head)
        for title, rows in sections:
            lines += ['', f'## {title}', *_TABLE]
            lines += [f'| <a id="{prefix}{row.code}"></a>`{row.code}` | {_cell(row)} | '
                      f'{_escaped(row.do) if row.has_advice else ""} |' for row in rows]
    return re.sub('\n{3,}', '\n\n', '\n'.join(lines)) + '\n'


def _sections(module: ModuleType, prefix: str) -> list[tuple[str, list[Text]]]:
    """Return the rows below each heading of a catalogue."""
    sections: list[tuple[str, list[Text]]] = []
    for line in inspect.getsource(module).splitlines():
        heading, row = _HEADING.fullmatch(line), _ROW.match(line)
        if heading:
            title = f'{prefix}{heading[1]}'
            sections.append((title[:1].upper() + title[1:], []))
        elif row and row[1] != sentences.uncoded.code:
            sections[-1][1].append(module.CODES[row[1]])
    return sections


def _slug(title: str) -> str:
    """Return the anchor of a heading, as GitHub makes it."""
    return re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')


def _cell(row: Text) -> str:
    return '<br>'.join(f'`{_escaped(text.strip())}`' for text in explain.forms(row))


def _escaped(text: str) -> str:
    return text.replace('|', '\\|')


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
