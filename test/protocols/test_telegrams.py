# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The tables of telegrams against frames that are not of our making, row by row.

Sessions, simulated drives and ``decode`` read frames by the same row: a wrong one would be wrong
everywhere alike, and no test of one against another would see it. So every row has a frame with a
source, and every change of a row is seen.
"""

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from enum import Enum
import json
from pathlib import Path
import struct
from typing import Any

from builders import frame
import pytest

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.telegrams import Direction, TelegramType

VECTORS = Path(__file__).parents[1] / 'vectors'
REQUEST, RESPONSE = Direction.REQUEST, Direction.RESPONSE
OTHER = {REQUEST: RESPONSE, RESPONSE: REQUEST}


def file(name: str) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads((VECTORS / f'{name}.json').read_text(encoding='utf-8'))
    return loaded


# -- SDO: frames of manuals, of a public package, and of traces -----------------------------------

SDO_FILE = file('cia402')
SDO_KINDS = {kind.name.lower(): kind for kind in sdo.Kind}
SDO_VECTORS = [row for row in SDO_FILE['vectors'] if row['kind'] in SDO_KINDS]


def sdo_direction(row: dict[str, Any]) -> Direction:
    return REQUEST if row['frame'].startswith('6') else RESPONSE


def sdo_message(row: dict[str, Any]) -> sdo.Message:
    """Make what a vector says, without the codec."""
    return sdo.Message(
        SDO_KINDS[row['kind']],
        (int(row['index'], 16), row['subindex']) if 'index' in row else None,
        bytes.fromhex(row.get('content', '')),
        int(row['code'], 16) if 'code' in row else row.get('size', 0),
        row.get('toggle', 0) << 4,
        row.get('last', row.get('size_told', not row['kind'].endswith('load_begun'))))


def check_sdo() -> None:
    exchanges = set()
    for before, row in zip([{}, *SDO_VECTORS], SDO_VECTORS):
        data, expected = frame(row['frame']).data, sdo_message(row)
        assert sdo.decode(sdo_direction(row), data) == expected
        if row['kind'] == 'segment_taken':  # the package leaves something in unused bytes
            data = data[:1].ljust(8, b'\0')
        if row.get('size_told', True):
            assert sdo.encode(expected) == data
        if before.get('source') == row['source'] and [
                sdo_direction(each) for each in (before, row)] == [REQUEST, RESPONSE]:
            exchanges.add((before['kind'], row['kind']))
    assert exchanges == {(request.name.lower(), answer.name.lower()) for request in sdo.Kind
                         for answer in sdo.Kind if answer.answers(request)}
    for direction in (REQUEST, RESPONSE):
        for head in range(0x100):
            kinds = [kind for way, kind, bits, _ in SDO_FILE['heads']
                     if way == direction.value and fits(head, bits)]
            rows = [kind for kind in sdo.Kind if kind.value.is_sent_by(direction)
                    and head & kind.value.mask == kind.value.code]
            assert [kind.name.lower() for kind in rows] == kinds
            for kind in rows:
                assert sdo.decode(direction, bytes((head,)).ljust(8, b'\0')).kind is kind


def fits(head: int, bits: str) -> bool:
    """Tell whether a byte has the digits of a pattern; letters say something else."""
    return all(wanted == digit for wanted, digit in zip(bits, f'{head:08b}') if wanted in '01')


# -- every row, and every change ------------------------------------------------------------------

TABLES: dict[type[Enum], Callable[[], None]] = {sdo.Kind: check_sdo}
ROWS = [pytest.param(table, member, id=f'{table.__module__}.{member}')
        for table in TABLES for member in table]


@pytest.mark.parametrize('check', TABLES.values())
def test_rows_say_what_the_sources_print(check: Callable[[], None]) -> None:
    check()


def variants(row: TelegramType, table: type[Enum]) -> Iterator[TelegramType]:
    """Change one thing of a row at a time."""
    for direction in Direction:
        yield replace(row, direction=direction)
    for bit in range(8):
        yield replace(row, code=row.code ^ 1 << bit)
        yield replace(row, mask=row.mask ^ 1 << bit)
    for place, character in enumerate(row.layout):
        other = {'<': '>', 'B': 'H', 'H': 'B', 'I': 'H'}.get(character, character)
        if other != '>' or set(row.layout) & set('HI'):     # else they are all bytes
            yield replace(row, layout=row.layout[:place] + other + row.layout[place + 1:])
    names = row.names
    for place, name in enumerate(names[1:], 1):
        yield replace(row, fields=' '.join(
            [*names[:place - 1], name, names[place - 1], *names[place + 1:]]))
    for member in table:
        answers = set(row.answers.split()) ^ {member.name}
        yield replace(row, answers=' '.join(sorted(answers)))


@pytest.mark.parametrize(('table', 'member'), ROWS)
def test_every_change_of_a_row_is_seen(table: type[Enum], member: Enum,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    row = member.value
    survivors = []
    for changed in variants(row, table):
        if changed == row:
            continue
        with monkeypatch.context() as patch:
            patch.setattr(member, '_value_', changed)
            try:
                TABLES[table]()
            except (AssertionError, RemoteProtocolError, struct.error, KeyError, TypeError):
                continue
        survivors.append({each.name: getattr(changed, each.name) for each in fields(row)
                          if getattr(changed, each.name) != getattr(row, each.name)})
    assert survivors == []
