# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The subcommand ``drive_can explain``: what a code means, and what to do about it.

The page ``docs/messages.md`` is made of the same rows, by ``docs/messages.py`` in a checkout.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
import difflib
from itertools import groupby
import re
from string import Formatter

from drive_can_bridge.cli.command import complain, FAILED, print_json, say
from drive_can_bridge.cli.explained_words import KEYS, rows_of_word, VERDICTS
from drive_can_bridge.core import sentences
from drive_can_bridge.core.codes import CODES
from drive_can_bridge.core.messages import Text
from drive_can_bridge.core.text import counted, printable

#: codes that are named, and rows that are shown, where none is the one
_NEAREST = 5
#: letters that are enough to look for
_ENOUGH = 6
#: letters that are enough where a text is all that stands behind a name
_ENOUGH_OF_ALL = 4
#: what ends a name before a text
_BEFORE = re.compile(r'(?<=\S): ')
#: put before the codes of files in the anchors of the page, where a code is of both
OF_FILES = 'file-'
#: what the codes of a part of the catalogue stand for, behind the code
_WHERE = {'drives and buses': 'said about a drive or a bus', 'commands': 'said by a command',
          'states': 'a state of a drive',
          'files': 'said about a parameter file or a profile', 'keys': 'a key of diagnostics',
          'verdicts': 'stands before a reason', 'numbers': 'a number of the drive'}
#: where a clause of a row ends; not the comma that joins the names of a field
_CLAUSE = re.compile(r'[,;] (?!\})')


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Say what a code of diagnostics, log or --json means: its text, and what to do about it. '
        'A line of the log, or words of one, will do, too.')
    parser.epilog = (
        'Exit code 0: all is known. 1: something is not; the nearest are named. --json: code, '
        'about, texts (what changes in <brackets>), do.')
    parser.add_argument('code', metavar='CODE', nargs='+', help=(  # type: ignore[attr-defined]
        'such as not_armed; several, one after the other; or a text')).completer = (
        lambda **_: _codes())
    parser.add_argument('--json', action='store_true', help='a JSON document a line')


def run(args: Namespace) -> int:
    """Show the rows of codes (one of drives, one of files, or both), or those of texts."""
    return max([_explain(text, json=args.json)
                for quoted, words in groupby(args.code, _is_line)
                for text in (words if quoted else [' '.join(words)])])


def _is_line(word: str) -> bool:
    """Return whether an argument was quoted, and is no list of codes."""
    return ' ' in word and not _named(word)


def _explain(text: str, *, json: bool) -> int:
    """Show the rows of codes, or those of a text; return the exit code."""
    named, unknown = _named(text), list[str]()
    rows = named or rows_of(text)
    if not rows:    # a list of codes, of which some are none; mostly other words: a text
        words = text.split()
        unknown = [word for word in words if not _rows_of_code(word)]
        if len(unknown) <= len(words) / 2:
            named = rows = _named(' '.join(word for word in words if word not in unknown))
    shown = rows if named else rows[:_NEAREST]
    for about, row in shown:
        if json:
            print_json({'code': row.code, 'about': about, 'texts': forms(row), 'do': row.do})
        else:
            say(f'{row.code} ({_WHERE[about]})')
            for form in forms(row):
                say(f'  it says:    {form}')
            say(f'  {"it is:     " if about in ("keys", "numbers") else "what to do:"} {row.do}')
    if rows[len(shown):]:
        complain(f'and {len(rows) - len(shown)} more: give more words')
    missing = unknown if rows else [text]
    for word in missing:
        near = difflib.get_close_matches(word, _codes(), _NEAREST)
        complain(f'drive_can explain: {printable(word)}: no such code' + (
            f', did you mean {" or ".join(near)}?' if near else '; docs/messages.md has them all'))
    return FAILED if missing else 0


def rows_of(text: str) -> list[tuple[str, Text]]:
    """Return the rows of codes, of words of a text, or of a line, and what they are about."""
    return _named(text) or _with_words(text) or _said_in(text)


def _named(text: str) -> list[tuple[str, Text]]:
    """Return the rows of codes, one after the other; none where a word is no code."""
    found: dict[tuple[str, str], tuple[str, Text]] = {}
    words = text.split()
    if len(words) == 1 and not _rows_of_code(text):
        return list(rows_of_word(text.strip().strip('`')).items())
    for word in words:
        of_word = _rows_of_code(word)
        if not of_word:
            return []
        found.update(of_word)
    return list(found.values())


def _rows_of_code(word: str) -> dict[tuple[str, str], tuple[str, Text]]:
    """Return the rows of one code, as the page, and links to it, write it."""
    anchor = word.strip('`').rpartition('#')[2]
    code = anchor.removeprefix(OF_FILES)
    return {(about, code): (about, rows[code]) for about, rows in CODES.items()
            if code in rows and (about == 'files' or code == anchor)}


def _codes() -> list[str]:
    return sorted({*KEYS, *VERDICTS, *(code for rows in CODES.values() for code in rows)})


def _rows() -> Iterator[tuple[str, Text]]:
    for about, rows in (*CODES.items(), ('verdicts', VERDICTS)):
        for row in rows.values():
            if row is not sentences.uncoded:
                yield about, row


def _with_words(text: str) -> list[tuple[str, Text]]:
    """Return the rows in whose texts some words stand: those of few other words first."""
    words = ' '.join(text.lower().split())
    if len(words) < _ENOUGH:
        return []
    found = [(min(len(form) for form in forms(row) if words in form.lower()), about, row)
             for about, row in _rows() if any(words in form.lower() for form in forms(row))]
    return [(about, row) for _, about, row in sorted(found, key=lambda each: each[0])]


def _said_in(text: str) -> list[tuple[str, Text]]:
    """Return the rows that a line may be made of: those that have most in common with it first."""
    fitting = [(max(rest, places, key=len), len(rest) + _in_fields(rest, text), about, row)
               for about, row in _rows() for rest in (_rest(row, text),)
               if (places := row.places(text) or _begun(row, text)) or rest]
    found = [(about, row) for places, covered, about, row in sorted(
        fitting, key=lambda each: (-max(len(each[0]), each[1]),
                                   not each[3].places(text, whole=True), -len(each[0])))
             if about == 'verdicts' or not any(places < others for others, *_ in fitting)]
    # one word and fields fit nearly every line that has the word
    return [each for each in found if not _is_faint(each[1])] or found


def _rest(row: Text, text: str) -> frozenset[int]:
    """Return where the letters of a row stand that is all of a line behind names of its places."""
    if not any(_first_words(form) in text for form in row.texts) or _is_faint(row):
        return frozenset()
    for begin in (0, *(found.end() for found in _BEFORE.finditer(text))):
        places = row.places(text[begin:], whole=True, enough=_ENOUGH_OF_ALL)
        if places:
            return frozenset(begin + place for place in places)
    return frozenset()


def _first_words(form: str) -> str:
    """Return what stands before the first field of a form, or between its first two."""
    pieces = [before for before, *_ in Formatter().parse(form) if before.strip()]
    return pieces[0] if pieces else form


def _in_fields(places: frozenset[int], text: str) -> int:
    """Return how many letters stand between those of a row that is the rest of a line."""
    return sum(map(str.isalpha, text[min(places):])) - len(places) if places else 0


def _begun(row: Text, text: str) -> frozenset[int]:
    """Return where the letters of a row stand in a text that was cut short behind a clause."""
    heads = [form[:end.start()] for form in row.texts
             if text.startswith(form.partition('{')[0]) for end in _CLAUSE.finditer(form)]
    return Text(*heads).places(text, whole=True) if heads else frozenset()


def _is_faint(row: Text) -> bool:
    return row not in VERDICTS.values() and all(
        '<' in form and len(re.findall(r'[^\W\d_]+', re.sub('<.*?>', '', form))) < 2
        for form in forms(row))


def forms(row: Text) -> list[str]:
    """Return the texts of a row for people: what changes in brackets, ``<names>``."""
    return [''.join(_pieces(text)) for text in row.texts]


def _pieces(text: str) -> Iterator[str]:
    for before, name, spec, _ in Formatter().parse(text):
        yield before
        if name and (spec or '').startswith('#'):
            yield counted(2, (spec or '')[1:]).replace('2', f'<{name}>')
        elif name and spec != '?':
            yield f'<{name}>'
