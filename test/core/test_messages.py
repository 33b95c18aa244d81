# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The catalogue of sentences and complaints: its rows are what people read, and not repeated here.

Told are: how rows are written out; that each is said somewhere with the right fields, and that
a story somewhere among the tests gets each complaint.
"""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
import inspect
from pathlib import Path
from string import Formatter
from time import process_time
from types import ModuleType

import pytest
from saying import says

from drive_can_bridge import host_texts
from drive_can_bridge.core import complaints, host_sentences, sentences
from drive_can_bridge.core.codes import code_of, CODES, MODULES
from drive_can_bridge.core.messages import around, NOTHING, Sentence, Text, together
from drive_can_bridge.core.sentences import Absence

TESTS = Path(__file__).parents[1]
PRODUCT = TESTS.parent / 'drive_can_bridge'
CATALOGUES = {each.__name__: each.CODES for modules in MODULES.values() for each in modules}

#: modules of stories about configurations; elsewhere ``says`` is mostly a sentence of a drive
STORIES = [*(TESTS / 'configuration').glob('test_*.py'),
           TESTS / 'protocols' / 'cia402' / 'test_cia402_checks.py',
           TESTS / 'protocols' / 'cannord' / 'test_cannord_group.py',
           TESTS / 'ros' / 'test_ros_refusals.py']


@pytest.mark.parametrize(('sentence', 'text'), [
    (sentences.no_answer(timeout=0.1, attempts=1), 'no answer in 0.1 s, 1 attempt'),
    (sentences.no_answer(0.25, 3), 'no answer in 0.25 s, 3 attempts'),
    (sentences.members_offline(names=['hoist', 'turn']), 'hoist, turn offline'),
    (sentences.not_armed(wanted=('0 to /a', '0 to /b')), 'not armed: publish 0 to /a and 0 to /b'),
    (sentences.maps_written([50, 51], (209,)), 'request map [50, 51], response map [209]'),
    (sentences.word_stays(), 'the word stays'),
    (sentences.status_word(8), 'status word 0008h'),
    (sentences.status_words({'lift': 0xB30, 'hoist': None}),
     'status words: lift 0B30h, hoist unknown'),
    (sentences.slow_exchange(mean=0.0312, period=0.02),
     'an exchange takes 31 ms, the period is 20 ms: the drive is slow; choose a longer period or '
     'a shorter cyclic_response'),
    (sentences.answer_late(0.0004),
     'answer 0.4 ms after its period: the computer, the adapter or the drive is too slow'),
    (sentences.refused_by_drive(2, 'error 2: limit exceeded'),
     'refused by the drive: error 2: limit exceeded'),
    (complaints.wrong_type(value='maybe', kind='a string', allowed='true or false'),
     "'maybe' is a string, allowed is true or false"),
    (complaints.unknown_word(value=False, near='', allowed='lenient or strict'),
     'false is unknown, allowed is lenient or strict'),
    (complaints.no_mapping(entry='x'), 'no mapping, allowed is NODE_NAME: {x: …}'),
])
def test_counting_joining_and_numbers(sentence: Sentence, text: str) -> None:
    assert sentence == text


def test_the_first_text_whose_fields_are_all_there() -> None:
    assert sentences.unknown_parameter('ramp') == 'unknown parameter ramp'
    assert sentences.unknown_parameter('ramp', None) == 'unknown parameter ramp'
    assert sentences.unknown_parameter('ramp', 'rump') == (
        'unknown parameter ramp, did you mean rump?')
    assert sentences.fault_came('status 8', False) == 'fault (status 8)'
    assert sentences.fault_came('status 8', True) == (
        'fault (status 8); only ~/enable starts the drive again')
    assert sentences.mode_differs('csp', 8, None) == '6061h shows nothing yet instead of 8 (csp)'
    assert sentences.mode_differs('csp', 8, 0) == '6061h shows mode 0 yet instead of 8 (csp)'
    assert 'stuck in state ready (s); a; b' in sentences.stuck(2.0, 'ready', 's', ['a', 'b'])
    assert sentences.stuck(2.0, 'ready', 's').endswith('stuck in state ready (s)')


def test_a_sentence_has_the_code_of_its_row_and_the_fields_that_it_was_given() -> None:
    said = sentences.no_answer(0.1, attempts=3)
    assert (said.code, said.fields) == ('no_answer', {'timeout': 0.1, 'attempts': 3})
    assert sentences.booted().fields == {}


def test_a_reason_keeps_its_code_within_another_sentence() -> None:
    why = sentences.stop_not_answered()
    said = sentences.may_still_be_running(why)
    assert said == says('may_still_be_running', why=says('stop_not_answered'))
    assert said != says('may_still_be_running', why=says('stop_not_possible'))
    assert 'stop_not_answered' not in said


def test_several_things_in_one_line() -> None:
    first, second = sentences.heartbeat_missing(), sentences.booted()
    both = together([NOTHING, first, second])
    assert both == f'{first}; {second}' and both.code == first.code
    assert both.fields == {'parts': [first, second]}
    assert together([second, NOTHING]) is second and together([]) is NOTHING


def test_what_stands_around_a_sentence_changes_its_text_only() -> None:
    said = around(sentences.no_answer(0.1, 3), 'lift: ', '; look')
    assert said == 'lift: no answer in 0.1 s, 3 attempts; look'
    assert said == says('no_answer', attempts=3) and code_of(said) == 'no_answer'
    assert around('mere text', 'lift: ').code == ''


@pytest.mark.parametrize('module', [each for modules in MODULES.values() for each in modules])
def test_every_row_has_words_and_advice_and_stands_once(module: ModuleType) -> None:
    for code, row in module.CODES.items():
        assert row.do and all(row.texts), code
    names = [target.id for node in ast.parse(inspect.getsource(module)).body
             if isinstance(node, ast.Assign) for target in node.targets
             if isinstance(target, ast.Name)]
    assert len(names) == len(set(names))


def test_a_code_stands_in_one_module() -> None:
    codes = [code for about, modules in MODULES.items() if about != 'files'
             for module in modules for code in module.CODES]
    assert sorted(codes) == sorted(set(codes))


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding='utf-8'))


def rows_named_in(tree: ast.Module, module: str) -> Iterator[tuple[ast.expr, str, Text | None]]:
    """Return what names a row of the catalogue: the expression, the code, the row."""
    own = {name.rpartition('.')[2]: name for name in CATALOGUES}
    names = {code: (code, row) for code, row in CATALOGUES.get(module, {}).items()}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module in CATALOGUES:
            rows = CATALOGUES[node.module]
            names.update((each.asname or each.name, (each.name, rows[each.name]))
                         for each in node.names if each.name in rows)
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in names and isinstance(node.ctx, ast.Load):
            yield node, *names[node.id]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and (
                node.value.id in own):
            yield node, node.attr, CATALOGUES[own[node.value.id]].get(node.attr)


def product() -> Iterator[tuple[Path, str]]:
    for path in sorted(PRODUCT.rglob('*.py')):
        text = path.read_text(encoding='utf-8')
        # parsing is what takes long
        if any(each in text for each in ('sentences', 'complaints', 'state_names')):
            yield path, '.'.join(path.relative_to(TESTS.parent).with_suffix('').parts)


def test_every_call_gives_the_right_fields() -> None:
    """As mypy would: none that its row has not, none missing, no more than it has."""
    wrong, looked_at = [], 0
    for path, module in product():
        tree = parsed(path)
        rows = {node: row for node, _, row in rows_named_in(tree, module)}
        for call in ast.walk(tree):
            row = rows.get(call.func) if isinstance(call, ast.Call) else None
            if not isinstance(call, ast.Call) or row is None or any(
                    each.arg is None for each in call.keywords) or any(
                        isinstance(each, ast.Starred) for each in call.args):
                continue
            given = [*row.fields[:len(call.args)], *(str(each.arg) for each in call.keywords)]
            looked_at += 1
            if (len(call.args) > len(row.fields) or len(given) != len(set(given))
                    or not {*given} <= {*row.fields}
                    or not {*row.fields} - row.optional <= {*given}):
                wrong.append(f'{path.name}:{call.lineno}: {row.code} is given {given}, has '
                             f'{row.fields}')
    assert wrong == []
    assert looked_at > 400


def test_every_row_is_said() -> None:
    said = {row for path, module in product() for _, _, row in rows_named_in(parsed(path), module)}
    said.update(host_sentences.CODES.get(node.attr) for path in PRODUCT.rglob('*.py')
                if path.stem != 'host_sentences' and 'host_texts' in path.read_text('utf-8')
                for node in ast.walk(parsed(path))
                if isinstance(node, ast.Attribute)
                and getattr(node.value, 'id', '') == 'host_texts')
    assert [row.code for rows in CATALOGUES.values() for row in rows.values()
            if row not in said] == []


def test_what_may_import_no_catalogue_says_rows_of_it() -> None:
    texts = {name: text for name, text in vars(host_texts).items()
             if isinstance(text, str) and not name.startswith('_')}
    rows = host_sentences.CODES
    assert {code: row.texts[0] for code, row in rows.items()} == {
        code: texts[code] for code in rows}
    assert sorted(texts.values()) == sorted(text for row in rows.values() for text in row.texts)


def named(files: Iterable[Path], *functions: str) -> Iterator[str]:
    """Return the texts that these functions are called with."""
    for path in files:
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Call) and getattr(node.func, 'id', '') in functions:
                for argument in node.args:
                    for each in ast.walk(argument):
                        if isinstance(each, ast.Constant):
                            yield str(each.value)


def test_every_complaint_has_a_story() -> None:
    """A story that passes has got what it names: at(PLACE, CODE), says(CODE), complaints.CODE."""
    told = {*named(STORIES, 'at', 'says')}
    told.update(code for path in STORIES for _, code, _ in rows_named_in(parsed(path), ''))
    assert complaints.CODES.keys() - told == set()


#: what a text for people is called, wherever it is handed on
TEXTS = {'advice', 'message', 'problem', 'reason', 'refusal', 'sentence', 'why'}
#: and where only its code is asked for
NAMED = TEXTS | {'said', 'text', 'told', 'what'}
#: how control flow would look into one
LOOKS = {'endswith', 'find', 'index', 'partition', 'removeprefix', 'removesuffix', 'rpartition',
         'split', 'startswith'}
#: modules that look into one all the same: what for
OTHER_TEXTS = {
    'cli/scan.py': 'a problem without its place',
    'cli/validate.py': 'a problem without its place',
    'configuration/problems.py': 'a problem with its place',
    'configuration/schema.py': 'a message of jsonschema',
    'core/messages.py': 'the catalogue itself',
    'core/requests.py': 'the one place where what came through ROS becomes a kind',
    'monitor/summary.py': 'an advice without the state before it',
    'panel/drive_page.py': 'a refusal without its remedy',
    'protocols/canopen_pkw/observer.py': 'a frame',
    'protocols/canopen_pkw/pkw.py': 'a frame',
}


def looks_into_texts(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Return where a text for people, its code or its fields decide about something."""
    def name(node: ast.expr) -> str:
        return str(getattr(node, 'attr', getattr(node, 'id', '')))

    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            among = any(isinstance(op, (ast.In, ast.NotIn)) for op in node.ops)
            a_word = any(isinstance(each, ast.Constant) and isinstance(each.value, str)
                         for each in sides)
            if any(isinstance(each, ast.Attribute) and each.attr == 'code'
                   and (among or a_word or name(each.value) in NAMED) for each in sides) or (
                       among and name(node.comparators[-1]) in TEXTS):
                yield node.lineno, ast.unparse(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and (
                node.func.attr in LOOKS and name(node.func.value) in TEXTS):
            yield node.lineno, ast.unparse(node)
        elif isinstance(node, ast.Attribute) and node.attr == 'fields' and (
                name(node.value) != 'self'):
            yield node.lineno, ast.unparse(node)


def test_no_control_flow_asks_for_a_code_or_a_text() -> None:
    """A failure has a kind (:class:`.FailureKind`), an advice and an event too."""
    paths = sorted(PRODUCT.rglob('*.py'))
    found = {str(path.relative_to(PRODUCT)): list(looks_into_texts(parsed(path)))
             for path in paths}
    assert [(path, looks) for path, looks in found.items()
            if looks and path not in OTHER_TEXTS] == []
    assert [path for path in OTHER_TEXTS if not found[path]] == []


@pytest.mark.parametrize('line', [
    'what.code in _ANSWERS', "advice.code == 'no_heartbeat'", 'each.message.code not in SILENCE',
    "'answers' in what.fields", "refusal.fields['why']", "reason.startswith('no answer')",
    "'offline' in reason"])
def test_which_looks_are_found(line: str) -> None:
    assert [at for at, _ in looks_into_texts(ast.parse(line))] == [1]


@pytest.mark.parametrize(('text', 'code'), [
    (sentences.no_answer(0.1, 3), 'no_answer'), ('no answer in 0.1 s, 3 attempts', 'no_answer'),
    ('busy', 'busy'), ('homed', 'homed'), ('', ''), ('what nobody says', ''),
    ('interrupted', ''),        # of two commands
    (sentences.interrupted(), 'interrupted'), (sentences.uncoded('bus down'), 'bus_down')])
def test_the_code_of_a_text_that_came_through_ros(text: str, code: str) -> None:
    assert code_of(text) == code


def test_no_text_makes_looking_for_its_code_take_long() -> None:
    rows = [row for about, rows in CODES.items() if about != 'files' for row in rows.values()]
    for form in {form for row in rows for form in row.texts}:
        parts = [before for before, *_ in Formatter().parse(form)]
        # each piece often, in the order of the row, and an end that is not its own
        hostile = ''.join(f'{part}x' * 300 for part in parts) + '!'
        began = process_time()
        for row in rows:
            if form in row.texts:
                row.places(hostile), row.places(hostile, whole=True)
        assert process_time() - began < 1.0, form
    for hostile in ('1' * 100_000, '1 attempt' * 20_000, ': ' * 50_000, 'a' * 200_000):
        began = process_time()
        assert code_of(hostile) == ''
        assert process_time() - began < 2.0, hostile[:20]


@pytest.mark.parametrize(('text', 'whole', 'letters'), [
    ('busy: lift: 12 drives here', True, 'drives'),
    ('busy: lift: 12 drives here', False, 'drives'),
    ('a line\nbusy: lift: 1 drive here\nmore', False, 'drive'),
    ('a line\nbusy: lift: 1 drive here', True, ''), ('busy: \nlift: 1 drive here', False, ''),
    ('busy: : 1 drive here', False, ''), ('busy: : : 1 drive here', True, 'drive'),
    ('busy: lift: 1 drive here and more', True, ''), ('not busy: lift: 1 drive here', True, ''),
    ('not busy: lift: 1 drive here, now', False, 'drive')])
def test_where_the_words_of_a_row_stand(text: str, whole: bool, letters: str) -> None:
    row = Text('busy: {name}: {count:#drive} here')
    places = sorted(row.places(text, whole=whole))
    assert ''.join(text[each] for each in places) == (f'busy{letters}here' if letters else '')


def test_a_kind_is_that_of_the_form_and_a_sentence_gets_further_fields() -> None:
    said = sentences.no_heartbeat(0.1)
    assert said.kind is Absence.NO_HEARTBEAT and said.also(answers=True).kind is Absence.ANSWERS
    assert said.also(answers=True) == 'answers, but there is no heartbeat for 0.1 s'
    assert sentences.node_state('stopped').kind is Absence.SILENT
    assert sentences.booted().kind is None and NOTHING.also(more=1) is NOTHING


#: who is handed what people read
SINKS = {
    'AccessRefusal', 'Answer', 'ArgumentTypeError', 'BusMisconfigured', 'BusUnavailable',
    'DriveCanError', 'Failure', 'Finding', 'GatewayError', 'ImportFailed', 'InUse', 'NoAnswer',
    'NoBridge', 'OperationOutcome', 'RemoteProtocolError', 'TransportError', 'Unasked',
    'UnknownFormat', 'Unusable', 'ValueRefused', 'WrongColumns', 'WrongUsage', '_Refused',
    '_complain', '_report', '_tell', 'complain', 'fatal', 'reject'}
#: and what it is called where it is handed on
CALLED = TEXTS | {'remark', 'told', 'trouble'}
#: parts of sentences that stand elsewhere, as terms of a protocol or of a library do; not counted
#: are help texts, headings, names of things (error codes, units) and defects of this program
LITERALS = {
    'cli/backup.py': 'the end of a sentence', 'cli/hand.py': 'a heading; what nobody reads',
    'cli/explain.py': 'what explains the catalogue is no part of it',
    'cli/jog.py': 'what goes on', 'cli/scan.py': 'counts of what was heard; the next command',
    'cli/simulate.py': 'a remark of the simulator', 'configuration/profiles.py': 'of a file',
    'configuration/yaml_nodes.py': 'of a file', 'protocols/cia402/observer.py': 'terms',
    'protocols/cia402/prober.py': 'what was read', 'ros/diagnostics.py': 'a state',
    'ros/log.py': 'the end of a line', 'simulation/simulation.py': 'a line of the simulator',
    'trace/measured.py': 'a format', 'transport/adapters.py': 'the name of a module'}


def literals_for_people(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Return the texts of three words and more that are handed to people as they stand."""
    def parts(node: ast.expr) -> Iterator[str]:
        if isinstance(node, ast.Constant):
            yield str(node.value)
        elif isinstance(node, ast.JoinedStr):
            yield ' '.join(str(each.value) for each in node.values
                           if isinstance(each, ast.Constant))
        elif isinstance(node, ast.IfExp):
            yield from (*parts(node.body), *parts(node.orelse))
        elif isinstance(node, ast.BinOp):
            yield from (*parts(node.left), *parts(node.right))
        elif isinstance(node, ast.BoolOp):
            yield from (each for value in node.values for each in parts(value))

    def name(node: ast.expr) -> str:
        return str(getattr(node, 'attr', getattr(node, 'id', '')))

    for node in ast.walk(tree):
        handed: list[ast.expr] = []
        if isinstance(node, ast.Call):
            handed += node.args if name(node.func) in SINKS else []
            handed += [each.value for each in node.keywords if each.arg in CALLED]
        elif isinstance(node, ast.Assign) and any(
                name(each).lstrip('_') in CALLED for each in node.targets):
            handed.append(node.value)
        for each in handed:
            for text in parts(each):
                if sum(any(map(str.isalpha, word)) for word in text.split()) >= 3:
                    yield node.lineno, text


def test_what_people_read_stands_in_the_catalogue() -> None:
    found = {str(path.relative_to(PRODUCT)): list(literals_for_people(parsed(path)))
             for path in sorted(PRODUCT.rglob('*.py'))}
    assert {path: texts for path, texts in found.items() if texts and path not in LITERALS} == {}
    assert [path for path in LITERALS if not found[path]] == []


@pytest.mark.parametrize('line', [
    "raise BusUnavailable('the adapter is gone')", "complain(f'{name}: it is gone')",
    "reason = 'it is gone' if gone else ''", "Finding(key, None, why or 'it is gone')",
    "show(reason='it ' + 'it is gone')"])
def test_which_texts_for_people_are_found(line: str) -> None:
    assert [at for at, _ in literals_for_people(ast.parse(line))] == [1]
