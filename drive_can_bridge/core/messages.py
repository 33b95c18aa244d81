# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How texts for people are written as rows of data.

The rows stand in :mod:`.sentences` (of drives, requests and stops) and :mod:`.complaints` (of
files): the text, and what to do about it. The name of a row is the *code*, and what stands in
braces are the *fields*. A row is called with its fields, and returns a :class:`Sentence`: text
wherever text is wanted, with a code for programs and tests, which need not read it:

.. code-block:: python

    no_answer = Text('no answer in {timeout:g} s, {attempts:#attempt}', do='look at its cable')

    reason = sentences.no_answer(timeout=0.1, attempts=3)
    reason == 'no answer in 0.1 s, 3 attempts'
    reason.code == 'no_answer' and reason.fields['attempts'] == 3

A sentence that gives the reason of another one has it among its fields, code and all.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from functools import cached_property
from itertools import cycle
import re
from string import Formatter
from typing import Any

from drive_can_bridge.core.text import counted, show


class Sentence(str):
    """
    A text for people that programs need not read.

    :ivar code: its meaning, as a stable word.
    :ivar fields: of what, by name.
    :ivar kind: what it is for programs, where they have to know.
    :ivar row: of the catalogue; None: it is made of others.
    """

    __slots__ = ('code', 'fields', 'kind', 'row')

    code: str
    fields: Mapping[str, Any]
    kind: Enum | None
    row: 'Text | None'

    def __new__(cls, text: str = '', code: str = '', fields: Mapping[str, Any] | None = None,
                kind: Enum | None = None, row: 'Text | None' = None) -> 'Sentence':
        said = super().__new__(cls, text)
        said.code, said.fields, said.kind, said.row = code, fields or {}, kind, row
        return said

    def also(self, **fields: Any) -> 'Sentence':
        """Return the sentence of the same row with further fields."""
        return self if self.row is None else self.row(**{**self.fields, **fields})


#: what a way to write a number is made of; anything else joins
_NUMBERS = '.,0123456789Xgf'

#: digits of a number that counts, at most
_DIGITS = 20
#: letters that a text with something else in it has in common with one of a row
_ENOUGH = 6

#: the empty sentence
NOTHING = Sentence()


def together(said: Iterable[Sentence]) -> Sentence:
    """Join several sentences in one line; its code is that of the first, all are in its fields."""
    parts = [part for part in said if part]
    if len(parts) < 2:
        return parts[0] if parts else NOTHING
    return Sentence('; '.join(parts), parts[0].code, {'parts': parts})


def around(said: str, before: str = '', behind: str = '') -> Sentence:
    """Return a sentence with text before and behind it; it keeps its code for programs."""
    text = f'{before}{said}{behind}'
    return (Sentence(text, said.code, said.fields, said.kind) if isinstance(said, Sentence)
            else Sentence(text))


class Text:
    """
    A row of the catalogue; a call with its fields returns the sentence.

    In braces stand fields, and behind a colon how they are written: as :func:`format` has it,
    ``{n:#byte}`` counts, ``{names:, }`` joins several, ``{ran:?}`` writes nothing; ``{value!r}``
    writes a value as a user would recognise it. Of several texts the first is used whose fields
    are all there: given, and neither empty nor false. The last one is for all other cases.

    :ivar code: its name in the catalogue.
    :ivar do: what people should do about it.
    :ivar has_advice: that is of this row, and not of all of its catalogue.
    :param fields: that order, where it is not that of the text, or where a field is in no text.
    :param kinds: what its sentences are for programs: one for all texts, or one for each.
    :param how: writes a field in a way of its own, by name.
    """

    def __init__(self, *texts: str, do: str = '', fields: str = '', kinds: Sequence[Enum] = (),
                 **how: Callable[[Any], str]) -> None:
        self.code, self.do, self.texts = '', do, texts
        self.has_advice = bool(do)
        self._order, self._kinds, self._how = fields, kinds, how

    # made at the first use: a command writes one sentence of some hundreds

    def make_ready(self) -> None:
        """Compute now what is otherwise computed at the first use."""
        _ = self.fields, self.optional

    @cached_property
    def _variants(self) -> list['_Variant']:
        variants = [_Variant(text, self._how) for text in self.texts]
        for each, kind in zip(variants, cycle(self._kinds)):
            each.kind = kind
        return variants

    @cached_property
    def _in_text(self) -> list[str]:
        return [name for each in self._variants for name in each.fields]

    @cached_property
    def fields(self) -> tuple[str, ...]:
        """The names of its fields, in the order in which they may be given."""
        return tuple(self._order.split()) or tuple(dict.fromkeys(self._in_text))

    @cached_property
    def optional(self) -> frozenset[str]:
        """The names of the fields that may be missing."""
        return frozenset(self._in_text).difference(self._variants[-1].fields)

    def __call__(self, *args: Any, **fields: Any) -> Sentence:
        if args:
            fields = {**dict(zip(self.fields, args)), **fields}
        *others, last = self._variants
        for variant in others:
            if all(_is_there(fields.get(name)) for name in variant.fields
                   if name in self.optional):
                return Sentence(variant.write(fields), self.code, fields, variant.kind, self)
        return Sentence(last.write(fields), self.code, fields, last.kind, self)

    def places(self, text: str, *, whole: bool = False, enough: int = _ENOUGH) -> frozenset[int]:
        """
        Return where the letters of this row stand in a text; empty: the text is not from this row.

        :param whole: nothing else is to stand there.
        :param enough: so many letters does a form need to count.
        """
        return max((_places(each, text, whole, enough) for each in self.texts), key=len)


def code_of(text: str, rows: Iterable[Text]) -> str:
    """Return the code of the row that a mere text is of, as it comes through ROS; '': of none."""
    fitting = sorted((len(row.places(text, whole=True)), row.code) for row in rows)
    *_, (next_best, _), (best, code) = fitting
    return code if best > next_best else ''


def _places(form: str, text: str, whole: bool, enough: int) -> frozenset[int]:
    pieces = list(Formatter().parse(form))
    letters = sum(each.isalpha() for before, *_ in pieces for each in before)
    if letters < (1 if whole and len(pieces) == 1 and pieces[0][1] is None else enough) or (
            not all(before in text for before, *_ in pieces)):      # the rest takes longer
        return frozenset()
    # what stands between two fields, each of which may be anything
    patterns = ['']
    for before, name, spec, _ in pieces:
        patterns[-1] += f'({re.escape(before)})'
        if name and (spec or '').startswith('#'):
            patterns[-1] += rf'\d{{1,{_DIGITS}}}( {re.escape((spec or "")[1:])}\w*)'
        elif name and spec != '?':
            patterns.append('')
    for begin in (0,) if whole else (0, *(found.end() for found in re.finditer('\n', text))):
        spans = _spans(patterns, text, begin, whole=whole)
        if spans is not None:
            return frozenset(place for span in spans for place in range(*span)
                             if text[place].isalpha())
    return frozenset()


def _spans(patterns: Sequence[str], text: str, at: int, *,
           whole: bool) -> list[tuple[int, int]] | None:
    """
    Return where patterns match, with something of one line between two; None: they do not.

    Each is searched for once, from the end of the one before. One expression of all of
    them would try each place of one with each place of the others, and a text
    made for it could hang a command.
    """
    spans: list[tuple[int, int]] = []
    last = len(patterns) - 1
    for number, pattern in enumerate(patterns):
        if at > len(text):      # no text is left for the field
            return None
        compiled = re.compile(rf'{pattern}\Z' if whole and number == last else pattern)
        found = (compiled.match if whole and not number else compiled.search)(text, at)
        if found is None or number and '\n' in text[at - 1:found.start()]:
            return None
        spans += [found.span(group) for group in range(1, compiled.groups + 1)]
        at = found.end() + 1
    return spans


class _Variant:
    """One text of a row, with what :meth:`str.format` cannot write set apart."""

    def __init__(self, text: str, how: Mapping[str, Callable[[Any], str]]) -> None:
        self.fields: list[str] = []
        self.kind: Enum | None = None
        self._apart: list[tuple[str, str, Callable[[Any], str]]] = []
        self._text = ''
        for before, name, spec, conversion in Formatter().parse(text):
            self._text += before.replace('{', '{{').replace('}', '}}')
            if not name:
                continue
            self.fields.append(name)
            write = how.get(name) or _writer(spec or '', conversion)
            if write is not None:
                self._apart.append((f'_{len(self.fields)}', name, write))
                name, spec = self._apart[-1][0], ''
            self._text += f'{{{name}:{spec}}}'

    def write(self, fields: dict[str, Any]) -> str:
        if self._apart:
            fields = {**fields, **{key: write(fields[name]) for key, name, write in self._apart}}
        return self._text.format(**fields)


def catalogue(module: dict[str, Any], do: str = '') -> dict[str, Text]:
    """
    Set the codes of a module's rows, and return them by code.

    :param do: what to do about rows without advice.
    """
    rows = {code: row for code, row in module.items() if isinstance(row, Text)}
    for code, row in rows.items():
        row.code, row.do = code, row.do or do
    return rows


def _is_there(value: Any) -> bool:
    return bool(value) or value == 0 and value is not False


def _writer(spec: str, conversion: str | None) -> Callable[[Any], str] | None:
    if conversion == 'r':
        return show
    if spec == '?':
        return lambda value: ''
    if spec.startswith('#'):
        return lambda value: counted(value, spec[1:])
    if spec.strip(_NUMBERS):
        return lambda value: spec.join(map(str, value))
    return None
