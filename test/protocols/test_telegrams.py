# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What stands once about the telegrams of a protocol, against frames that are not of our making.

Sessions, simulated drives and ``decode`` read frames by the same rows: a wrong one would be
wrong everywhere alike, and no test of one against another would see it. So each row has a frame
with a source (``test/vectors``), and each number, format and name of it is changed here once,
which has to be seen.
"""

import ast
from collections.abc import Callable, Iterator
from functools import partial
import json
from pathlib import Path
import re
import struct
from types import ModuleType
from typing import Any

from builders import frame, parameter
from extent import some
import pytest

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.cannord import identifiers, parameter_frame, process_data
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen_pkw import pkw
from drive_can_bridge.protocols.cia402 import pdo
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.options import effective
from drive_can_bridge.protocols.telegrams import Direction

REQUEST, RESPONSE = Direction.REQUEST, Direction.RESPONSE


def file(name: str) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(
        (Path(__file__).parents[1] / 'vectors' / f'{name}.json').read_text(encoding='utf-8'))
    return loaded


CANNORD, CIA402, DATAMODEL, PKW = map(file, ('cannord', 'cia402', 'datamodel', 'canopen_pkw'))


def octets(row: dict[str, Any]) -> bytes:
    return bytes.fromhex(row['data_hex'])


def rejects(call: Callable[..., object], *arguments: Any) -> bool:
    try:
        call(*arguments)
    except (LocalProtocolError, RemoteProtocolError):
        return True
    return False


# -- CANopen: frames of manuals, of a public package, and of traces -------------------------------


def check_sdo(module: Any) -> None:
    kinds = {kind.name.lower(): kind for kind in module.SdoCommand}
    vectors = [row for row in CIA402['vectors'] if row['kind'] in kinds]
    exchanges = set()
    for before, row in zip([{'frame': ''}, *vectors], vectors):
        identifier, data, _ = frame(row['frame'])
        direction = REQUEST if row['frame'].startswith('6') else RESPONSE
        assert identifier & ~0x7F == (
            module.REQUEST_BASE if direction is REQUEST else module.RESPONSE_BASE)
        expected = module.SdoMessage(
            kinds[row['kind']], (int(row['index'], 16), row['subindex']) if 'index' in row else
            None, bytes.fromhex(row.get('content', '')),
            int(row['code'], 16) if 'code' in row else row.get('size', 0),
            row.get('toggle', 0) << 4,
            row.get('last', row.get('size_told', not row['kind'].endswith('load_begun'))))
        assert module.decode(direction, data) == expected
        if row['kind'] == 'segment_taken':  # the package leaves something in unused bytes
            data = data[:1].ljust(8, b'\0')
        if row.get('size_told', True):
            assert module.encode(expected) == data
        if before.get('source') == row['source'] and before['frame'].startswith('6') and (
                direction is RESPONSE):
            exchanges.add((before['kind'], row['kind']))
    assert exchanges == {(request, answer) for request in kinds for answer in kinds
                         if kinds[answer].answers(kinds[request])}
    assert module.TOGGLE == 1 << 4      # "bit 4", say the vectors
    for direction in (REQUEST, RESPONSE):
        for head in range(0x100):
            fitting = [kind for way, kind, bits, _ in CIA402['heads']
                       if way == direction.value and fits(head, bits)]
            rows = [kind for kind in module.SdoCommand if kind.value.is_sent_by(direction)
                    and head & kind.value.mask == kind.value.code]
            assert [kind.name.lower() for kind in rows] == fitting
            for kind in rows:
                assert module.decode(direction, bytes((head,)).ljust(8, b'\0')).kind is kind


def fits(head: int, bits: str) -> bool:
    """Tell whether a byte has the digits of a pattern; letters say something else."""
    return all(wanted == digit for wanted, digit in zip(bits, f'{head:08b}') if wanted in '01')


def check_network(module: Any) -> None:
    told = [row | {'command': row['command'].replace('pre', 'enter_pre').upper()}
            for row in PKW['network'] if row['kind'] == 'nmt']
    assert {row['command'] for row in told} == {each.name for each in module.NmtCommand}
    for row in told:
        made = module.encode_nmt(module.NmtCommand[row['command']], 5)
        assert made == frame(row['frame'])
        assert module.decode_nmt(made.data) == (module.NmtCommand[row['command']], 5)
    states = {row['state']: frame(row['frame']) for row in PKW['network']
              if row['kind'] == 'state' and 'guarding' not in row['name']}
    assert set(states) == {each.text for each in module.NmtState}
    for state in module.NmtState:
        assert module.encode_heartbeat(5, state) == states[state.text]
        assert module.decode_heartbeat(states[state.text].data) is state
    for row in CIA402['vectors']:
        if row['kind'] == 'emergency':
            emergency = module.Emergency(int(row['code'], 16), row['register'],
                                         bytes.fromhex(row['manufacturer']))
            made = frame(row['frame'])
            assert module.encode_emergency(made.identifier & 0x7F, emergency) == made
            assert module.decode_emergency(made.data) == emergency
        elif row['kind'] == 'sync':
            assert module.encode_sync() == frame(row['frame'])


def check_pdo(module: Any) -> None:
    told: dict[int, dict[int, bytes]] = {}      # what was written to 1400h and so on, node 4
    for row in CIA402['vectors']:
        if row['kind'] == 'download' and row['frame'].startswith('604#'):
            told.setdefault(int(row['index'], 16), {})[row['subindex']] = bytes.fromhex(
                row['content'])
    for index, make in ((0x1400, module.receive_pdos), (0x1800, module.transmit_pdos)):
        for number in (1, 2):
            mapped = told[index + number - 1 + module.MAPPING_OFFSET]
            entries = tuple(int.from_bytes(mapped[place], 'little')
                            for place in range(1, 1 + mapped[0][0]))
            made, = make(4, [number], [mapped_object(entry) for entry in entries])
            assert made.communication == index + number - 1
            assert made.entries == entries
            assert made.identifier == int.from_bytes(told[made.communication][1], 'little')
    for row in CIA402['vectors']:
        if row['kind'] == 'pdo':
            objects = [mapped_object(int(entry, 16)) for entry, _ in row['entries']]
            made, = module.receive_pdos(1, [1], objects)
            assert made.pack([raw for _, raw in row['entries']]) == frame(row['frame']).data


def mapped_object(entry: int) -> Parameter:
    """Return the object of an entry of a mapping."""
    types = {8: ParameterType.INT8, 16: ParameterType.UINT16, 32: ParameterType.INT32}
    return parameter('object', None, index=entry >> 16, subindex=entry >> 8 & 0xFF,
                     type=types[entry & 0xFF])


# -- PKW: the page "Oggetti PKW" ------------------------------------------------------------------


def check_pkw(module: Any) -> None:
    codes = {name: int(row['code'], 16) for name, row in PKW['functions'].items()}
    assert set(codes.values()) == set(map(int, module.Function))
    assert (module.Function.NONE, module.Function.ERROR) == (codes['none'], codes['error'])
    for name, row in PKW['functions'].items():
        meaning = module.PkwMessage(0, codes[name], True).meaning
        assert meaning == (None if row['addressing'] is None else module.Meaning(
            row['addressing'] == 'canopen', row['write'], row['words']))
        assert f'{module.PkwMessage(0, codes[name], True).function_byte:02X}' == row['toggled']
    for row in PKW['vectors']:
        if row['use'] == 'reject':
            continue
        message = module.PkwMessage(row['word_1'], codes[row['function']], row['toggle'] == 1,
                                 row['low_byte'], tuple(row['data_words']))
        layout = module.PkwLayout(row['layout'])
        assert module.decode(octets(row), layout) == message
        if row['use'] == 'both':
            assert module.encode(message, layout) == octets(row)
    read, default = module.read_request(module.Address(455), 1, False), module.PkwLayout('word_le')
    told = [step.partition('#')[2] for row in PKW['exchanges'] for step in row['frames']
            if step.startswith('<')]
    assert {text for text in told if module.answers(
        module.decode(bytes.fromhex(text), default), read)} == {'C701002583200000'}
    refusal = module.decode(bytes.fromhex('C701004E02000106'), default)
    assert module.answers(refusal, read)


# -- CANnord: BU 0060, BU 0050 --------------------------------------------------------------------


def check_identifiers(module: Any) -> None:
    names = ('process_request', 'process_response', 'parameter_task', 'parameter_answer')
    assert [kind.name.replace('RESPONSE', 'ANSWER').lower() for kind in module.MessageObject] == [
        names[0], 'process_answer', *names[2:]]
    for row in CANNORD['identifiers']:
        station = row['station']
        for kind, name, wide in zip(module.MessageObject, names, row['extended']):
            assert module.identifier(kind, station) == int(row[name], 16)
            assert module.identifier(kind, station, extended=True) == int(wide, 16)
            assert module.decode_identifier(int(row[name], 16)) == (kind, station)
        assert module.group_identifier(station) == int(row['group'], 16)
    for row in CANNORD['groups']:
        for station in (row['first'], row['last']):
            assert module.group_identifier(station) == row['identifier']
            assert module.decode_identifier(row['identifier']) is None
    assert module.all_identifier() == 1032
    assert rejects(module.identifier, module.MessageObject.PROCESS_REQUEST, 256)


def check_process_data(module: Any) -> None:
    for row in CANNORD['process']:
        if row['expect'] != 'ok':
            assert rejects(module.decode_main, octets(row))
            continue
        values = tuple(value & 0xFFFF for value in row['values'])
        if row['kind'].startswith('extra'):
            assert module.decode_extra(octets(row)) == values
            made = module.encode_extra(values)
        else:
            word, swap = int(row['word'], 16), row.get('swap', False)
            assert module.decode_main(octets(row), swap=swap) == (word, values)
            made = module.encode_main(word, values, length=len(octets(row)), swap=swap)
            assert module.main_length(len(values)) == len(made)
        assert made == octets(row) or row['use'] == 'decode'
    assert rejects(module.encode_extra, (1, 2, 3))
    assert rejects(module.main_length, 4)


def check_parameter_frames(module: Any) -> None:
    for row in CANNORD['parameter']:
        layout = module.ParameterLayout(
            row.get('value_order', 'high_first'), row.get('index_byte', 'low'))
        if row['expect'] == 'reject':
            assert rejects(layout.decode, octets(row))
            continue
        found = layout.decode(octets(row))
        assert found == module.ParameterFrame(row['code'], row['number'], row['index'],
                                              row['value'] & 0xFFFFFFFF)
        if row['use'] == 'both':
            assert layout.encode(*(row[name] for name in ('code', 'number', 'index', 'value'))
                                 ) == octets(row)
    doubles = [2, 5]        # PWE1 and PWE2 are one value
    assert [int(each) for each in module.ResponseId] == [0, 1, 2, 4, 5, 6, 7]
    assert [int(each) for each in module.ResponseId if each.double] == doubles
    assert [int(each) for each in module.ResponseId if each.array] == [4, 5]
    none = {'task': 0, 'answers': [0], 'array': False}
    assert [int(task) for task in module.Task] == [0, *(row['task'] for row in CANNORD['tasks'])]
    for row in [none, *CANNORD['tasks']]:
        task, memory = module.Task(row['task']), row.get('memory')
        assert [int(each) for each in task.responses] == row['answers']
        assert (task.array, task.writes) == (row['array'], memory is not None)
        assert task.double is (row.get('writes') == 'double word')
        assert task.persistent is (None if memory is None else memory == 'eeprom')
        if task.writes:
            assert module.WRITE_TASKS[task.array, task.double, task.persistent] is task


# -- DataModel: the tables of the manual's chapter "CANbus" ---------------------------------------


def check_extended(module: Any) -> None:
    kinds = {'cyclic_request': module.CyclicRequest, 'cyclic_response': module.CyclicResponse,
             'acyclic_write': module.WriteTelegram, 'read_request': module.ReadTelegram,
             'read_response': module.ReadResponse}
    for row in DATAMODEL['vectors']:
        fields = row['fields']
        if row['protocol'] != 'extended' or row['is_remote_frame']:
            continue
        if row['use'] == 'encode':
            station, number, count = (fields.get(name, usual) for name, usual in (
                ('station', 1), ('param', 30), ('count', 1)))
            assert rejects(module.encode_write, station, number, [fields.get('value', 0)] * count)
            assert 'value' in fields or rejects(
                module.encode_read_request, station, number, count)
            continue
        made = Frame(int(row['can_id_hex'], 16), octets(row), row['is_extended_id'])
        count = len(effective(fields['mapping'])) if 'mapping' in fields else 4
        lenient, strict = (partial(module.decode, made, count=count, strict=each)
                           for each in (False, True))
        assert rejects(lenient) is (row['expect'] == 'reject')
        assert rejects(strict) is (row['expect'] != 'ok')
        if rejects(lenient):
            continue
        words, station, number = tuple(row['words_u16']), fields['station'], fields['param']
        kind = kinds[row['kind']]
        telegram = kind(words) if row['kind'].startswith('cyclic') else kind(
            number, fields['count'] if row['kind'] == 'read_request' else words)
        assert module.station_of(made.identifier) == station
        assert lenient() == telegram
        assert row['expect'] != 'ok' or strict() == telegram
        if row['use'] == 'both':
            request = module.encode_read_request(station, number, fields['count']) if (
                row['kind'].startswith('read')) else module.encode_write(
                station, number, words) if row['kind'] == 'acyclic_write' else Frame(
                module.cyclic_request_identifier(station), module.pack_words(words), True)
            assert made == (module.encode_answer(request.identifier, words)
                            if fields['dir'] else request)
    for name in DATAMODEL['filters'][:3]:
        assert int(name['can_mask'], 16) == module.DIR | module.STATION_MASK
    masks = {name: int(text, 16) for name, text in DATAMODEL['masks'].items()}
    assert masks == {
        'DIR': module.DIR, 'STATION': module.STATION_MASK, 'BIT20': module.W,
        'PARAM': module.PARAMETER_MASK, 'COUNT': module.COUNT_MASK, 'CYCLIC_LOW': module.CYCLIC}
    assert rejects(module.encode_write, 1, 0xFFFF, (1,))
    assert rejects(module.encode_write, 1, -1, (1,))
    assert not rejects(module.encode_read_request, 127, 0xFFFF, 1)


def check_standard(module: Any) -> None:
    assert module.REQUEST_ID_BASE == DATAMODEL['defaults']['std_rx_base']
    assert module.RESPONSE_ID_BASE == DATAMODEL['defaults']['std_tx_base']
    for row in DATAMODEL['vectors']:
        fields = row['fields']
        if row['protocol'] != 'standard':
            continue
        if row['name'] == 'std-addr16':
            assert rejects(module.identifier, fields['tx_base'], fields['address'])
            continue
        if row['name'] == 'std-collision':
            first, second = fields['stations']
            assert module.identifier(fields['tx_base'], first) == module.identifier(
                fields['rx_base'], second) == int(row['can_id_hex'], 16)
            continue
        made = Frame(int(row['can_id_hex'], 16), octets(row), False)
        if row['expect'] != 'ok':
            assert rejects(module.decode_request, made)
            continue
        words = tuple(row['words_u16'])
        base = fields['tx_base' if row['kind'] == 'std_read_response' else 'rx_base']
        assert module.identifier(base, fields['address']) == made.identifier
        if row['kind'] == 'std_read_response':
            for strict in (False, True):
                assert module.decode_read_response(
                    made, fields['expected_count'], strict=strict) == words
            again = module.encode_read_response(made.identifier, words)
        elif row['kind'] == 'std_write':
            assert module.decode_request(made) == extended.WriteTelegram(fields['pnu'], words)
            again = module.encode_write(made.identifier, fields['pnu'], *words)
        else:
            assert module.decode_request(made) == extended.ReadTelegram(
                fields['pnu'], fields['count'])
            again = module.encode_read_request(made.identifier, fields['pnu'], fields['count'])
        assert again == made or row['use'] == 'decode'


# -- every fact, and every change -----------------------------------------------------------------

#: modules, the statements in them that say something of telegrams, and what looks at these
TABLES: list[tuple[ModuleType, set[str], Callable[[Any], None]]] = [
    (sdo, {'SdoCommand', 'REQUEST_BASE', 'RESPONSE_BASE', 'LENGTH', 'EXPEDITED_MAX', 'SEGMENT_MAX',
           'TOGGLE'}, check_sdo),
    (network, {'NMT_IDENTIFIER', 'SYNC_IDENTIFIER', 'EMERGENCY_BASE', 'HEARTBEAT_BASE',
               'NmtCommand', 'NmtState', 'EMERGENCY_LENGTH'}, check_network),
    (pdo, {'RPDO_BASE', 'RPDO_COMMUNICATION', '_CODES'}, check_pdo),
    (pkw, {'PAYLOAD', 'TOGGLE', 'CODE_MASK', '_PLACES', 'Function'}, check_pkw),
    (identifiers, {'ADDRESS_MAX', 'PARAMETER_BASE', 'BROADCAST_BASE', 'BROADCAST_ALL',
                   'GROUP_SIZE', 'EXTENDED_SHIFT', 'MessageObject'}, check_identifiers),
    (process_data, {'MAIN_VALUES', 'EXTRA_VALUES', 'SHORT_LENGTH', 'LONG_LENGTH', 'EXTRA_LENGTH',
                    '_SHORT', '_LONG', '_EXTRA'}, check_process_data),
    (parameter_frame, {'NUMBER_MAX', 'INDEX_MAX', 'LENGTH', '_FIELDS', '_SPONTANEOUS',
                       '_IDENTIFIER_SHIFT', 'Task', 'ResponseId'}, check_parameter_frames),
    (extended, {'DIR', 'STATION_MASK', 'STATION_SHIFT', 'W', 'PARAMETER_MASK', 'PARAMETER_SHIFT',
                'COUNT_MASK', 'CYCLIC', 'CYCLIC_PARAMETER', 'STATION_MAX', 'SLOTS', 'PAYLOAD',
                'WORDS', 'PADDING'}, check_extended),
    (standard, {'REQUEST_ID_BASE', 'RESPONSE_ID_BASE', 'READ', 'WRITE', 'PAYLOAD',
                '_READ_REQUEST', '_WRITE', '_WORDS'}, check_standard),
]
#: characters of struct -> what is shorter, longer, or the other way round
OTHER = {'<': '>', '>': '<', 'B': 'H', 'H': 'B', 'I': 'H', 's': 'B', 'x': 'B'}
OTHER_NAMES = {'_REQUEST': '_RESPONSE', '_RESPONSE': '_REQUEST', 'NEITHER': 'RESPONSE'}


@pytest.mark.parametrize(('module', '_', 'check'), TABLES, ids=lambda value: str(
    getattr(value, '__name__', '')))
def test_what_stands_there_is_what_the_sources_print(
        module: ModuleType, _: set[str], check: Callable[[Any], None]) -> None:
    check(module)


def variants(value: object) -> Iterator[object]:
    """Change a constant in one thing at a time."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        for bit in range(max(8, value.bit_length())):
            yield value ^ 1 << bit
    elif isinstance(value, str) and re.fullmatch(r'[<>]?[\dxsBHI]*', value):
        several = set(value) & set('HI')    # bytes, of which there is no other order
        for place, character in enumerate(value):
            if character in OTHER and (several or character not in '<>'):
                yield value[:place] + OTHER[character] + value[place + 1:]
    elif isinstance(value, str):
        words = value.split()
        for place in range(len(words)):
            yield ' '.join(words[:place] + words[place + 1:])
            if place and words[place].islower():    # a field; rows that are named have no order
                yield ' '.join([*words[:place - 1], words[place], words[place - 1],
                                *words[place + 1:]])


def changes(tree: ast.Module, names: set[str]) -> Iterator[tuple[str, ast.AST, str, object]]:
    """Return what can be changed: its name, the node, the field of that, the new value."""
    for statement in tree.body:
        target = statement.targets[0] if isinstance(statement, ast.Assign) else statement
        found = {getattr(target, 'name', ''), *(
            each.id for each in ast.walk(target) if isinstance(each, ast.Name))} & names
        if not found or not isinstance(statement, (ast.Assign, ast.ClassDef)):
            continue
        name = ', '.join(sorted(found))
        rows = [each for each in statement.body if isinstance(each, ast.Assign)] if isinstance(
            statement, ast.ClassDef) else [statement]
        for row in rows:
            where = f'{name}: {ast.unparse(row)}'
            sizes = {each for part in ast.walk(row.value) if isinstance(part, ast.comprehension)
                     for each in ast.walk(part)}
            for node in ast.walk(row.value):
                if isinstance(node, ast.Constant) and node not in sizes:
                    for value in variants(node.value):
                        yield f'{where}: {value!r}', node, 'value', value
                for field in ('id', 'attr'):
                    if getattr(node, field, None) in OTHER_NAMES:
                        value = OTHER_NAMES[getattr(node, field)]
                        yield f'{where}: {value}', node, field, value


@pytest.mark.parametrize(('module', 'names', 'check'), TABLES, ids=lambda value: str(
    getattr(value, '__name__', '')))
def test_every_change_is_seen(module: ModuleType, names: set[str],
                              check: Callable[[Any], None]) -> None:
    tree = ast.parse(Path(module.__file__ or '').read_text(encoding='utf-8'))
    survivors, everything = [], [*changes(tree, names)]
    assert len(everything) > 50
    for what, node, field, value in some(everything, 12):
        before = getattr(node, field)
        setattr(node, field, value)
        changed = ModuleType('changed')
        try:
            exec(compile(tree, 'changed', 'exec'), changed.__dict__)
            check(changed)
        except (AssertionError, LocalProtocolError, RemoteProtocolError, struct.error, KeyError,
                TypeError, ValueError, IndexError, AttributeError, ArithmeticError):
            pass
        else:
            survivors.append(what)
        setattr(node, field, before)
    assert survivors == []
