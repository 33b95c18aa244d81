# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The subcommand ``drive_can explain``: what a code means, and what to do about it.

The page ``docs/messages.md`` is made of the same rows: ``python -m drive_can_bridge.cli.explain``
writes it in a checkout; a test compares it.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
import difflib
import inspect
from pathlib import Path
import re
from string import Formatter
from types import ModuleType

from drive_can_bridge.cli.command import complain, FAILED, print_json, say
from drive_can_bridge.core import complaints, sentences
from drive_can_bridge.core.messages import Text
from drive_can_bridge.core.text import counted, printable

#: what the rows of a catalogue are about
ABOUT: dict[str, ModuleType] = {'drives and buses': sentences, 'files': complaints}
PAGE = Path('docs', 'messages.md')
_NEAREST = 5
_HEADING = re.compile(r'# -- (.*?) -*')
_ROW = re.compile(r'(\w+) = Text\(')

_HEAD = """\
# What the messages mean, and what to do

Every status of `/diagnostics` has a key `code` ([what else it has](ros_interface.md));
`drive_can explain CODE` shows its row of this page. In `<brackets>` stands what changes; several
texts of a code are its forms.

Made by `python -m drive_can_bridge.cli.explain`, of `core/sentences.py` and `core/complaints.py`.
"""
_FILES = """
# What can be wrong with a parameter file or a profile

`drive_can validate` and the bridge say it with file, line and key. What to do stands in the text:
it says what is allowed.

| code | text |
|---|---|
"""


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Say what a code means that diagnostics, or a line of --json, has: its text, and what to '
        'do about it.')
    parser.epilog = 'Exit code 0: it is known. 1: it is not; the nearest ones are named.'
    parser.add_argument('code', metavar='CODE', help='such as not_armed').completer = (  # type: ignore[attr-defined]
        lambda **_: sorted({**sentences.CODES, **complaints.CODES}))
    parser.add_argument('--json', action='store_true', help=(
        'a JSON document a line: code, about, texts (what changes in <brackets>), do'))


def run(args: Namespace) -> int:
    """Show the rows of a code: one of drives, one of files, or both."""
    rows = [(about, module.CODES[args.code]) for about, module in ABOUT.items()
            if args.code in module.CODES]
    for about, row in rows:
        if args.json:
            print_json({'code': row.code, 'about': about, 'texts': forms(row), 'do': row.do})
        else:
            say(f'{row.code} (of {about})')
            for text in forms(row):
                say(f'  it says:    {text}')
            say(f'  what to do: {row.do}')
    if not rows:
        near = difflib.get_close_matches(
            args.code, sorted({**sentences.CODES, **complaints.CODES}), _NEAREST)
        complain(f'drive_can explain: {printable(args.code)}: no such code' + (
            f', did you mean {" or ".join(near)}?' if near else '; docs/messages.md has them all'))
    return 0 if rows else FAILED


def forms(row: Text) -> list[str]:
    """Write the texts of a row for people: what changes in brackets, ``<names>``."""
    return [''.join(_pieces(text)) for text in row.texts]


def _pieces(text: str) -> Iterator[str]:
    for before, name, spec, _ in Formatter().parse(text):
        yield before
        if name and (spec or '').startswith('#'):
            yield counted(2, (spec or '')[1:]).replace('2', f'<{name}>')
        elif name and spec != '?':
            yield f'<{name}>'


def page() -> str:
    """Return the text of the page."""
    lines = [_HEAD]
    for line in inspect.getsource(sentences).splitlines():
        heading, row = _HEADING.fullmatch(line), _ROW.match(line)
        if heading:
            title = heading[1][:1].upper() + heading[1][1:]
            lines += ['', f'## {title}', '', '| code | text | what to do |', '|---|---|---|']
        elif row and row[1] != sentences.uncoded.code:
            text = sentences.CODES[row[1]]
            lines.append(f'| `{text.code}` | {_cell(text)} | {_escaped(text.do)} |')
    rows = [f'| `{text.code}` | {_cell(text)} |' for text in complaints.CODES.values()]
    return '\n'.join([*lines, _FILES + '\n'.join(rows)]).replace('\n\n\n', '\n\n') + '\n'


def _cell(row: Text) -> str:
    return '<br>'.join(f'`{_escaped(text.strip())}`' for text in forms(row))


def _escaped(text: str) -> str:
    return text.replace('|', '\\|')


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
