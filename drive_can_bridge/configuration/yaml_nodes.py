# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
YAML files as nodes with lines, and from those to plain data, under the rules of ROS parameters.

Nodes are put together from PyYAML's event stream, as rcl does: only there can be seen what rcl
refuses (aliases, anchors that stand twice). No recursion: no nesting of a file ends in the depths
of the C stack. Everything wrong is noted and reading goes on.

rcl compares a scalar with a list of words, then tries C's ``strtoll`` with base 0, then
``strtod``; what is left is a string. So ``y`` is a bool, ``010`` is 8, ``08`` is 8.0, ``1_000``,
``null`` and ``1e400`` are strings, ``inf`` is a number. Quotes or the tag ``!!str`` make a string;
every other tag is ignored. A test compares this with the real parser.
"""

from collections.abc import Iterator
from enum import Enum
from errno import EFBIG, EINVAL
import math
from pathlib import Path as FilePath
import re
import sys
from typing import Any, NamedTuple, Union

import yaml

from drive_can_bridge.configuration.problems import Path, Problem, Tree
from drive_can_bridge.core import complaints
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.text import describe_type

Scalar = Union[bool, int, float, str]

STRING_TAG = 'tag:yaml.org,2002:str'

_WORDS: dict[str, bool] = {
    **dict.fromkeys(('Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'),
                    True),
    **dict.fromkeys(('N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'),
                    False),
}

#: YAML's own spellings, which strtod does not know
_YAML_FLOATS: dict[str, float] = {
    **dict.fromkeys(('.nan', '.NaN', '.NAN'), math.nan),
    **dict.fromkeys(('.inf', '.Inf', '.INF', '+.inf', '+.Inf', '+.INF'), math.inf),
    **dict.fromkeys(('-.inf', '-.Inf', '-.INF'), -math.inf),
}

# What C's isspace skips in front of a number.
_SPACE = r'[ \t\n\v\f\r]*'
_INTEGER = re.compile(
    _SPACE + r'([+-]?)(?:0[xX]([0-9a-fA-F]+)|0([0-7]*)|([1-9][0-9]*))', re.ASCII)
_DECIMAL = re.compile(
    _SPACE + r'[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?', re.ASCII)
_HEXADECIMAL = re.compile(
    _SPACE + r'[+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]+)?',
    re.ASCII)
_SPECIAL = re.compile(_SPACE + r'([+-]?)(inf|infinity|nan(?:\([0-9a-z_]*\))?)',
                      re.ASCII | re.IGNORECASE)

_INT64_MIN, _INT64_MAX = -(1 << 63), (1 << 63) - 1
# Longer digit strings overflow int64 anyway; this only spares the conversion.
_DIGITS_MAX = 64


def read_scalar(text: str, *, quoted: bool = False, tag: str | None = None) -> Scalar:
    """
    Return the value that rcl gives to a scalar.

    :param text: the scalar after YAML's own unescaping and folding.
    :param quoted: single or double quoted; block scalars count as plain.
    :param tag: resolved tag, or None.
    """
    if quoted or tag == STRING_TAG:
        return text
    if text in _WORDS:
        return _WORDS[text]
    for read in (_integer, _float):
        number = read(text)
        if number is not None:
            return number
    return text


def _integer(text: str) -> int | None:
    """Do what ``strtoll(text, &end, 0)`` does, when it takes the whole text without overflow."""
    match = _INTEGER.fullmatch(text)
    if match is None or len(text.lstrip(' \t\n\v\f\r+-0')) > _DIGITS_MAX:
        return None
    sign, hexadecimal, octal, decimal = match.groups()
    if hexadecimal is not None:
        value = int(hexadecimal, 16)
    elif decimal is not None:
        value = int(decimal)
    else:
        value = int(octal or '0', 8)
    if sign == '-':
        value = -value
    return value if _INT64_MIN <= value <= _INT64_MAX else None


def _float(text: str) -> float | None:
    """Do what ``strtod`` does, when it takes the whole text without overflow or underflow."""
    if text in _YAML_FLOATS:
        return _YAML_FLOATS[text]
    special = _SPECIAL.fullmatch(text)
    if special is not None:
        value = math.inf if special.group(2)[0] in 'iI' else math.nan
        return -value if special.group(1) == '-' else value
    stripped = text.lstrip(' \t\n\v\f\r')
    if _DECIMAL.fullmatch(text):
        value = float(stripped)
        zero = not re.split('[eE]', stripped)[0].strip('+-.0')
        smallest = sys.float_info.min
    elif _HEXADECIMAL.fullmatch(text):
        try:
            value = float.fromhex(stripped)
        except OverflowError:
            return None
        zero = not re.split('[pP]', stripped)[0].strip('+-.0xX')
        smallest = math.ulp(0.0)
    else:
        return None
    # strtod reports a range error for what overflows, and for what loses digits near zero, which
    # binary fractions need not do.
    if math.isinf(value) or (not zero and abs(value) < smallest):
        return None
    return value


def read_regular(path: FilePath, limit: int) -> bytes:
    """
    Read a file.

    :param limit: MiB that it may have.
    :raises OSError: it cannot be read, is no file, or is too large.
    """
    # a pipe may keep us waiting, a device has no end
    if not path.is_file() and not path.is_dir() and path.exists():
        raise OSError(EINVAL, 'not a regular file, allowed is one', str(path))
    with path.open('rb') as file:
        data = file.read((limit << 20) + 1)
    if len(data) > limit << 20:
        raise OSError(EFBIG, f'too large, allowed are {limit} MiB', str(path))
    return data


# libyaml, which rcl uses as well, where PyYAML was built with it.
_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

#: of what is read at all, in MiB and in levels
SIZE_MAX = 4
DEPTH_MAX = 32
_TOO_DEEP = complaints.too_deep(levels=DEPTH_MAX)
#: what is noticed to be wrong much later: where it begins is the line to look at
_OPENED = ('while scanning a quoted scalar', 'while parsing a flow', 'while scanning a simple key')


class BrokenYaml(Exception):
    """The text is not YAML from here on."""

    def __init__(self, line: int, why: Sentence) -> None:
        super().__init__(why)
        self.line, self.why = line, why


class Kind(Enum):
    """What a node is."""

    SCALAR = 'scalar'
    LIST = 'list'
    MAPPING = 'mapping'
    ALIAS = 'alias'


class Node(NamedTuple):
    """
    A part of a YAML text.

    :param line: where it begins, counted from 1.
    :param items: of a list; of a mapping its keys and values in turn.
    :param text: of a scalar, without quotes.
    """

    kind: Kind
    line: int
    items: list['Node']
    text: str = ''
    quoted: bool = False
    tag: str | None = None

    @property
    def scalar(self) -> Scalar:
        """The value of a scalar, as rcl reads it."""
        return read_scalar(self.text, quoted=self.quoted, tag=self.tag)

    @property
    def pairs(self) -> Iterator[tuple['Node', 'Node']]:
        """Keys and values of a mapping."""
        return zip(self.items[::2], self.items[1::2])


class Document(NamedTuple):
    """One of the documents of a file: where it begins, and what it holds."""

    line: int
    root: Node


def read_documents(path: FilePath) -> list[Document]:
    """
    Read a YAML file.

    :raises OSError: it cannot be read, is no file, or is too large.
    :raises BrokenYaml: it is no YAML.
    """
    return _documents(read_regular(path, SIZE_MAX))


def _documents(data: bytes) -> list[Document]:
    starts: list[int] = []
    roots: list[Node] = []
    # the lists that nodes are added to: that of the documents, and those of all open nodes
    growing = [roots]
    line = 1
    try:
        for event in yaml.parse(data, Loader=_LOADER):
            line = event.start_mark.line + 1 if event.start_mark else line
            if isinstance(event, yaml.ScalarEvent):
                growing[-1].append(Node(Kind.SCALAR, line, [], event.value,
                                        event.style in ("'", '"'), event.tag))
            elif isinstance(event, yaml.AliasEvent):
                growing[-1].append(Node(Kind.ALIAS, line, []))
            elif isinstance(event, yaml.CollectionStartEvent):
                kind = Kind.LIST if isinstance(event, yaml.SequenceStartEvent) else Kind.MAPPING
                node = Node(kind, line, [])
                growing[-1].append(node)
                growing.append(node.items)
                if len(growing) > DEPTH_MAX + 1:
                    raise BrokenYaml(line, _TOO_DEEP)
            elif isinstance(event, yaml.CollectionEndEvent):
                growing.pop()
            elif isinstance(event, yaml.DocumentStartEvent):
                starts.append(line)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise _broken(error, line, data) from None
    return list(map(Document, starts, roots))


def _broken(error: Exception, line: int, data: bytes) -> BrokenYaml:
    mark = getattr(error, 'problem_mark', None)
    context = str(getattr(error, 'context', ''))
    if context.startswith(_OPENED):
        mark = getattr(error, 'context_mark', None) or mark
    line = mark.line + 1 if mark is not None else line
    indentation = re.match(rb'\s*', b''.join(data.splitlines()[line - 1:line]))
    if indentation is not None and b'\t' in indentation[0]:
        return BrokenYaml(line, complaints.tab())
    what = getattr(error, 'problem', None) or getattr(error, 'reason', None) or 'unreadable'
    if 'nesting' in what:   # libyaml has a limit of its own since PyYAML 6.0.4
        return BrokenYaml(line, _TOO_DEEP)
    in_mapping = context.startswith('while parsing a block mapping')
    return BrokenYaml(line, complaints.indented_like_no_key(what=what) if in_mapping else
                      complaints.not_yaml(what=what))


#: stands for a value that could not be read
_UNREADABLE = object()


class Rules(Enum):
    """What a mapping may contain."""

    #: below ``ros__parameters``: what rcl refuses or garbles is a problem
    PARAMETERS = 'parameters'
    #: a profile, which rcl never sees
    PROFILE = 'profile'


class TreeReader:
    """
    Read one mapping, with everything below it, into a :class:`Tree`.

    What spoils this mapping only is noted in the tree.

    :ivar refused: what spoils the whole file.
    """

    def __init__(self, file: str, rules: Rules) -> None:
        self.tree = Tree({}, file)
        self.refused: list[Problem] = []
        self._parameters = rules is Rules.PARAMETERS
        self._why = ' (rcl refuses the file)' if self._parameters else ''

    def read(self, node: Node) -> None:
        """Read a mapping."""
        self.tree.lines[()] = node.line
        self._mapping(node, (), self.tree.data)

    def _note(self, path: Path, message: Sentence, *, at: Path | None = None) -> None:
        """Note a problem; the value at ``path`` is not to be used."""
        self.refused.append(self.tree.problem(path, message, at=at))
        self.tree.damaged.add(path)

    def _mapping(self, node: Node, path: Path, target: dict[str, Any]) -> None:
        lines = self.tree.lines
        for key, value in node.pairs:
            problem = _key_problem(key)
            if problem:
                self.refused.append(self.tree.problem(path, problem)._replace(line=key.line))
                self.tree.incomplete.add(path)
                continue
            here = (*path, key.text)
            if here in lines:
                self.tree.problems.append(self.tree.problem(
                    here, complaints.duplicate_key(first=lines[here]),
                )._replace(line=key.line))
                continue
            lines[here] = key.line
            # ROS itself reads topic names in QoS overrides, which may have dots.
            if self._parameters and '.' in key.text \
                    and str(here[0]).split('.')[0] != 'qos_overrides':
                self.tree.wrong(here, complaints.dots())
                self.tree.incomplete.add(path)
                continue
            read = self._value(value, here)
            if read is not _UNREADABLE:
                target[key.text] = read

    def _value(self, node: Node, path: Path) -> Any:
        if node.kind is Kind.SCALAR:
            return self._scalar(node, path)
        if node.kind is Kind.LIST:
            return self._list(node, path)
        if node.kind is Kind.ALIAS:
            self._note(path, complaints.alias(why=self._why))
        elif self._parameters and not node.items:
            self._note(path, complaints.garbling_mapping())
        else:
            value: dict[str, Any] = {}
            self._mapping(node, path, value)
            return value
        return _UNREADABLE

    def _scalar(self, node: Node, path: Path) -> Any:
        if not node.text and not node.quoted:
            self._note(path, complaints.no_value(why=self._why))
        elif '\0' in node.text:
            self._note(path, complaints.nul())
        else:
            return node.scalar
        return _UNREADABLE

    def _list(self, node: Node, path: Path) -> Any:
        items: list[Any] = []
        for item in node.items:
            here = (*path, len(items))
            self.tree.lines[here] = item.line
            plain = item.kind is Kind.SCALAR
            value = self._scalar(item, here) if plain else _UNREADABLE
            if item.kind is Kind.ALIAS:
                self._note(path, complaints.alias(why=self._why), at=here)
            elif not plain:
                self._note(path, complaints.nested_list(), at=here)
            elif value is _UNREADABLE:
                self.tree.damaged.add(path)
            elif self._parameters and items and type(value) is not type(items[0]):
                self._note(path, complaints.mixed_list(
                    value=value, kind=describe_type(value),
                    first=describe_type(items[0])), at=here)
            else:
                items.append(value)
        return _UNREADABLE if path in self.tree.damaged else items


def _key_problem(key: Node) -> Sentence:
    """Say why a key cannot be one; NOTHING if it can."""
    if key.kind is not Kind.SCALAR:
        kind = 'an alias' if key.kind is Kind.ALIAS else 'a list or mapping'
        return complaints.no_key(kind=kind)
    if not key.text:
        return complaints.empty_key()
    return complaints.key_with_nul() if '\0' in key.text else NOTHING
