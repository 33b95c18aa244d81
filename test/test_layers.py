# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who may import whom.

The tables are the architecture: an import that they do not name is an error, also inside functions
and below ``TYPE_CHECKING``. Whoever needs a new edge adds it here, and thereby shows it.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
import re
import sys
from typing import NamedTuple
from xml.etree import ElementTree

from drive_can_bridge.protocols.families import FAMILIES

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGE = CHECKOUT / 'drive_can_bridge'

#: Layer: the layers that it may import, besides itself. '' is the package's own __init__.
#: ``ros.client`` is a client of bridges, no part of one: it knows none of them.
INTERNAL: dict[str, set[str]] = {
    '': set(),
    # what the compiler is told, for everybody whose classes it may compile
    'compiled': {''},
    'resources': {''},
    'clock': {'', 'memory'},
    'memory': {''},
    # mere texts: for who may import no catalogue, and for the catalogue
    'host_texts': {''},
    'process': {'', 'clock', 'host_texts'},
    'core': {'', 'compiled', 'host_texts'},
    'protocols': {'', 'compiled', 'core'},
    'configuration': {'', 'core', 'protocols', 'resources'},
    'profiles': {'', 'core', 'configuration', 'protocols', 'resources'},
    'transport': {'', 'clock', 'compiled', 'core'},
    'exchange': {'', 'clock', 'compiled', 'core', 'process', 'protocols', 'transport'},
    'trace': {'', 'clock', 'core', 'protocols', 'transport'},
    'simulation': {'', 'clock', 'core', 'configuration', 'protocols', 'resources', 'transport'},
    'ros': {
        '', 'clock', 'core', 'configuration', 'protocols', 'resources', 'trace', 'transport',
        'exchange', 'host_texts', 'memory', 'process', 'ros.client', 'ros.messages', 'ros.rcl',
        'ros.recognition'},
    'monitor': {'', 'core'},
    'view': {'', 'clock', 'core', 'monitor'},
    # what it asks of drives comes from whoever starts it: it knows no ROS
    'panel': {'', 'clock', 'core', 'monitor'},
    'ros.messages': {'', 'core'},
    'ros.recognition': {''},
    'ros.client': {'', 'clock', 'core', 'process', 'ros.rcl', 'ros.recognition'},
    'ros.rcl': {'', 'core'},
    'ros.monitor': {
        '', 'core', 'monitor', 'ros.client', 'ros.messages', 'ros.rcl', 'ros.recognition'},
    'ros.demo': {
        '', 'core', 'configuration', 'process', 'simulation', 'monitor', 'ros', 'ros.monitor',
        'ros.rcl'},
    'demo': {'', 'process'},
    'client.drive': {'', 'core', 'process'},
    'client.way': {'', 'core'},
    'client.local': {'', 'clock', 'core', 'process', 'client.way'},
    'client.ros_way': {'', 'clock', 'core', 'client.way', 'ros.client', 'ros.messages'},
    'client.bridge': {'', 'core', 'client.drive', 'client.way'},
    'client.jog': {
        '', 'core', 'client.bridge', 'client.ros_way', 'ros.client', 'ros.messages',
        'ros.rcl', 'ros.recognition'},
    'client': {
        '', 'clock', 'core', 'configuration', 'protocols', 'transport', 'exchange', 'process',
        'client.bridge', 'client.drive', 'client.local', 'client.ros_way'},
    'backup': {'', 'core', 'configuration', 'protocols', 'client.drive'},
    'cli': {
        '', 'clock', 'compiled', 'core', 'configuration', 'protocols', 'resources', 'transport',
        'exchange', 'host_texts', 'process', 'profiles', 'simulation', 'trace', 'monitor', 'view',
        'panel', 'demo', 'client', 'client.drive', 'client.jog', 'client.local', 'backup', 'ros',
        'ros.client', 'ros.monitor', 'ros.demo'},
}

ROS_PACKAGES = {
    'builtin_interfaces', 'diagnostic_msgs', 'lifecycle_msgs', 'rcl_interfaces', 'rclpy',
    'sensor_msgs', 'std_msgs', 'std_srvs',
}

#: Layer: what it may import from outside, besides the standard library.
EXTERNAL: dict[str, set[str]] = {
    # for its types only
    'compiled': {'mypy_extensions'},
    'resources': {'ament_index_python'},
    'configuration': {'jsonschema', 'yaml'},
    # canopen: an optional extra, for EDS files
    'profiles': {'canopen'},
    'transport': {'can', 'serial'},
    # its file formats; and only where a picture is drawn
    'trace': {'can', 'matplotlib', 'scapy'},
    # yaml: only to tell which nodes a parameter file names when none of them is ours
    'ros': {*ROS_PACKAGES, 'yaml'},
    'ros.messages': ROS_PACKAGES,
    'ros.monitor': ROS_PACKAGES,
    'ros.client': ROS_PACKAGES,
    'ros.rcl': ROS_PACKAGES,
    'client.ros_way': {'rcl_interfaces'},
    'client.jog': ROS_PACKAGES,
    'ros.demo': ROS_PACKAGES,
    'view': {'rich'},
    # an optional extra
    'panel': {'fastapi', 'nicegui', 'starlette', 'uvicorn'},
    # argcomplete: an optional extra
    'cli': {'argcomplete', 'rich'},
}

#: Layer: edges that may be used inside functions only, so that importing the layer stays cheap and
#: works where the other side is missing.
LAZY = {('cli', 'ros'), ('cli', 'ros.client'), ('cli', 'ros.monitor'), ('cli', 'ros.demo'),
        ('cli', 'view'), ('cli', 'panel'), ('cli', 'client.jog'),
        ('client', 'client.ros_way')}

#: No clock, no thread, no log, no input or output in here: time and frames are arguments.
SANS_IO = {'core', 'protocols', 'monitor'}
IMPURE = {
    'asyncio', 'concurrent', 'datetime', 'logging', 'multiprocessing', 'os', 'pathlib', 'queue',
    'random', 'select', 'selectors', 'signal', 'socket', 'subprocess', 'threading', 'time',
}


class Import(NamedTuple):
    """One import statement: what, where, and whether it stands inside a function."""

    name: str
    line: int
    lazy: bool


def layer_of(module: str) -> str:
    """Return the layer of a module, given by its name below drive_can_bridge."""
    parts = module.split('.')
    nested = '.'.join(parts[:2])
    return nested if nested in INTERNAL else parts[0]


def module_name(path: Path) -> str:
    """Return a module's name below drive_can_bridge."""
    parts = list(path.relative_to(PACKAGE).with_suffix('').parts)
    if parts[-1] == '__init__':
        parts.pop()
    return '.'.join(parts)


def module_exists(name: str) -> bool:
    """Tell whether a full name is a module, not something inside one."""
    path = CHECKOUT.joinpath(*name.split('.'))
    return path.with_suffix('.py').is_file() or (path / '__init__.py').is_file()


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    """Return everything that a file consists of."""
    return list(ast.walk(ast.parse(path.read_text(encoding='utf-8'), str(path))))


@cache
def functions_of(path: Path) -> list[tuple[int, int]]:
    """Return the first and the last line of each function in a file."""
    return [(node.lineno, node.end_lineno or node.lineno) for node in nodes_of(path)
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]


@cache
def imports_of(path: Path) -> list[Import]:
    """Return the imports of a file; names of modules are complete."""
    return list(_imports_of(path))


def _imports_of(path: Path) -> Iterator[Import]:
    package = ['drive_can_bridge', *path.relative_to(PACKAGE).parent.parts]
    for node in nodes_of(path):
        lazy = isinstance(node, (ast.Import, ast.ImportFrom)) and any(
            first <= node.lineno <= last for first, last in functions_of(path))
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(alias.name, node.lineno, lazy)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            if node.level:
                above = package[:len(package) - node.level + 1]
                base = '.'.join([*above, base] if base else above)
            for alias in node.names:
                inner = f'{base}.{alias.name}'
                yield Import(inner if module_exists(inner) else base, node.lineno, lazy)


SOURCES = sorted(PACKAGE.rglob('*.py'))
LAYERS = {path: layer_of(module_name(path)) for path in SOURCES}


def test_layers_are_known() -> None:
    assert {str(path) for path, layer in LAYERS.items() if layer not in INTERNAL} == set()


def test_imports_of_ours_are_allowed() -> None:
    wrong = []
    for source, layer in LAYERS.items():
        for found in imports_of(source):
            top, _, rest = found.name.partition('.')
            if top != PACKAGE.name:
                continue
            other = layer_of(rest)
            if other != layer and other not in INTERNAL[layer]:
                wrong.append(f'{source}:{found.line}: {layer} must not import {found.name}')
            elif (layer, other) in LAZY and not found.lazy:
                wrong.append(f'{source}:{found.line}: import {found.name} inside a function')
    assert not wrong, '\n'.join(wrong)


def test_imports_of_others_are_allowed() -> None:
    wrong = []
    for source, layer in LAYERS.items():
        for found in imports_of(source):
            top = found.name.partition('.')[0]
            if top == PACKAGE.name:
                continue
            if top in sys.stdlib_module_names:
                if layer in SANS_IO and top in IMPURE:
                    wrong.append(f'{source}:{found.line}: {layer} is sans-IO: no {top}')
            elif top not in EXTERNAL.get(layer, set()):
                wrong.append(f'{source}:{found.line}: {layer} must not import {top}')
    assert not wrong, '\n'.join(wrong)


def test_simulated_drives_share_no_session_with_the_bridge() -> None:
    # They share the codecs; sharing the conversation too, they would agree on its mistakes.
    wrong = [
        f'{source}:{found.line}: {found.name}' for source, layer in LAYERS.items()
        if layer == 'simulation' for found in imports_of(source)
        if found.name.startswith(PACKAGE.name) and any(
            part == 'session' or part.endswith('_session') for part in found.name.split('.'))
    ]
    assert not wrong, '\n'.join(wrong)


def test_no_part_of_a_family_needs_its_row_of_the_table() -> None:
    # which names the parts: what both need stands in a third place
    wrong = [
        f'{source}:{found.line}: {found.name}' for source in SOURCES
        for found in imports_of(source)
        if source.relative_to(PACKAGE).parts[0] == 'protocols'
        and source.name != 'families.py' and len(found.name.split('.')) > 3
        and found.name.split('.')[1] == 'protocols'
        and any(part == 'family' or part.endswith('_family') for part in found.name.split('.')[3:])
    ]
    assert not wrong, '\n'.join(wrong)


#: where families are named beside their folders, and why that is no question to ask a family
NAMED = {
    'protocols/families.py': 'the table', 'simulation/simulation.py': 'the table of their drives',
    'protocols/storing.py': 'said behind a write, which does not wait until families are read',
    'core/status_bits.py': 'for views, which import no family',
    'core/complaints.py': 'advice to people, and what they call families'}


def test_families_are_named_in_their_tables_only() -> None:
    # whoever needs to know something of one asks it: see protocols/family.py
    folders = {name: family.__class__.__module__.split('.')[2]
               for name, family in FAMILIES.items()}
    named = re.compile(rf'\b({"|".join(folders)})\b')
    found = set()
    for source in SOURCES:
        inside = source.relative_to(PACKAGE).as_posix()
        if inside.startswith(tuple(f'{layer}/{folder}' for folder in folders.values()
                                   for layer in ('protocols', 'simulation'))):
            continue
        prose = {id(node.body[0].value) for node in nodes_of(source)     # docstrings
                 if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
                 and node.body and isinstance(node.body[0], ast.Expr)}
        found |= {(inside, node.value) for node in nodes_of(source)
                  if isinstance(node, ast.Constant) and isinstance(node.value, str)
                  and id(node) not in prose and named.search(node.value)}
        if LAYERS[source] != 'simulation':
            found |= {(inside, each.name) for each in imports_of(source)
                      if each.name.split('.')[1:2] == ['protocols']
                      and each.name.split('.')[2:3] and each.name.split('.')[2] in {
                          *folders.values()}}
    assert {place for place, _ in found} == NAMED.keys(), found


def test_tables_have_no_cycle() -> None:
    remaining = {layer: set(others) for layer, others in INTERNAL.items()}
    while remaining:
        free = {layer for layer, others in remaining.items() if not others & remaining.keys()}
        assert free, f'cycle among {sorted(remaining)}'
        remaining = {layer: others for layer, others in remaining.items() if layer not in free}


def test_ros_packages_are_declared() -> None:
    manifest = ElementTree.parse(CHECKOUT / 'package.xml').getroot()
    declared = {node.text for node in manifest.iter('exec_depend')}
    assert ROS_PACKAGES <= declared


# -- names ----------------------------------------------------------------------------------------

#: modules that each family has under the same name; those for all families stand above them
FLOOR_PLAN = {'family', 'observer', 'options', 'prober', 'procedures', 'scanner',
              'session', 'states', 'transactor'}


def test_a_name_of_a_class_stands_for_one_thing() -> None:
    places: dict[str, list[str]] = {}
    for path in SOURCES:
        for node in nodes_of(path):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(f'{path}:{node.lineno}')
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_a_name_of_a_module_stands_once_in_its_layer() -> None:
    places: dict[tuple[str, str], list[str]] = {}
    for path, layer in LAYERS.items():
        if path.stem != '__init__' and not (layer == 'protocols' and path.stem in FLOOR_PLAN):
            places.setdefault((layer, path.stem), []).append(str(path))
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


# -- inheritance ----------------------------------------------------------------------------------

#: steps from a class to the base of all its ancestors in this package: a base, and its subclasses
STEPS_MAX = 1


class Class(NamedTuple):
    """One class of the package: the names of its bases, and of its methods."""

    name: str
    source: Path
    bases: tuple[str, ...]
    methods: frozenset[str]


@cache
def classes() -> dict[str, Class]:
    """Return all classes of the package by name."""
    found: dict[str, Class] = {}
    for path in SOURCES:
        for node in nodes_of(path):
            if isinstance(node, ast.ClassDef):
                bases = [base.value if isinstance(base, ast.Subscript) else base
                         for base in node.bases]
                names = tuple(base.id for base in bases if isinstance(base, ast.Name))
                methods = frozenset(each.name for each in node.body
                                    if isinstance(each, ast.FunctionDef))
                found[node.name] = Class(node.name, path, names, methods)
    return found


def ancestors(name: str) -> Iterator[tuple[int, Class]]:
    """Go through the ancestors of a class in this package, each with its distance."""
    for base in classes()[name].bases:
        if base in classes() and base != name:
            yield 1, classes()[base]
            yield from ((steps + 1, other) for steps, other in ancestors(base))


def test_no_class_has_many_generations_above_it() -> None:
    deep = [f'{name}: {other.name}' for name in classes()
            for steps, other in ancestors(name) if steps > STEPS_MAX]
    assert not deep


def test_private_methods_are_overridden_inside_their_package_only() -> None:
    wrong = [
        f'{each.source}: {name}.{method} overrides {other.name}'
        for name, each in classes().items() for _, other in ancestors(name)
        for method in each.methods & other.methods
        if method.startswith('_') and not method.startswith('__')
        and each.source.parent != other.source.parent]
    assert not wrong, '\n'.join(wrong)


def private(node: ast.AST) -> bool:
    """Tell whether this is an attribute whose name begins with one underscore."""
    return (isinstance(node, ast.Attribute) and node.attr.startswith('_')
            and not node.attr.startswith('__'))


def of_self(node: ast.AST) -> bool:
    """Tell whether this is an attribute of ``self`` or ``cls``."""
    return (isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
            and node.value.id in ('self', 'cls'))


@cache
def own_names(path: Path) -> set[str]:
    """Return the private names that the classes of a module give to what is their own."""
    names = set()
    for node in nodes_of(path):
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif (isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
                and private(node) and of_self(node)):
            names.add(node.attr)
    return {name for name in names if name.startswith('_')}


def test_what_is_private_is_used_in_its_own_module_only() -> None:
    # ``_replace`` and its like belong to every named tuple
    everywhere = set().union(*map(own_names, SOURCES)) - set(dir(Import))
    wrong = [
        f'{source}:{node.lineno}: {ast.unparse(node)}'
        for source in SOURCES for node in nodes_of(source)
        if isinstance(node, ast.Attribute) and private(node) and not of_self(node)
        and node.attr in everywhere and node.attr not in own_names(source)
        and not ast.unparse(node).startswith('super()')]
    assert not wrong, '\n'.join(wrong)


def test_no_session_uses_anything_private_of_what_all_share() -> None:
    base = own_names(classes()['Session'].source)
    wrong = []
    for name, found in classes().items():
        if any(each.name == 'Session' for _, each in ancestors(name)):
            shared = base - own_names(found.source)
            wrong += [
                f'{found.source}:{node.lineno}: {ast.unparse(node)}'
                for node in nodes_of(found.source)
                if isinstance(node, ast.Attribute) and private(node) and node.attr in shared]
    assert not wrong, '\n'.join(wrong)


# -- the stop duty --------------------------------------------------------------------------------


def test_whether_a_stop_is_pending_is_asked_of_the_session_only() -> None:
    # everybody else says what happened, and carries out what comes back; `runs`: what a writer
    # has told last itself
    inside = {'core/session.py', 'core/stop_duty.py'}
    wrong = [
        f'{source}:{node.lineno}: {ast.unparse(node)}'
        for source in SOURCES if source.relative_to(PACKAGE).as_posix() not in inside
        for node in nodes_of(source)
        if isinstance(node, ast.Attribute) and node.attr not in ('happened', 'channel', 'runs')
        and (isinstance(node.value, ast.Attribute) and node.value.attr == 'duty'
             or isinstance(node.value, ast.Name) and node.value.id == 'duty')]
    assert not wrong, '\n'.join(wrong)


# -- clocks: only the steady one decides when something happens -----------------------------------

#: Who may look at the system clock, or write down a day, and how often.
ALLOWED = {
    # everybody else asks this one
    'clock.py': 3,
    # no look at the clock: a day and a time as text, or in a file
    'trace/candump.py': 1,
    'trace/writers.py': 1,
    'trace/blf.py': 1,
    'trace/flight.py': 2,
    'cli/backup.py': 1,
    'panel/pages.py': 2,
}
SYSTEM_CLOCK = {'time', 'time_ns', 'localtime', 'gmtime', 'strftime', 'ctime', 'asctime',
                'CLOCK_REALTIME', 'datetime'}
#: who may wait by himself, or ask for a time that nobody injects: processes, descriptors, signals,
#: and a thread that never goes on
OWN_WAYS = {'clock.py', 'process/locks.py', 'process/scheduling.py',
            'process/signals.py', 'process/standard_outputs.py', 'ros/demo/commander.py',
            'ros/rcl/escaped.py', 'view/live.py'}
WAYS = {'monotonic', 'monotonic_ns', 'perf_counter', 'sleep', 'thread_time', 'process_time',
        'clock_gettime', 'Thread', 'Event', 'Condition', 'Timer', 'Semaphore', 'SimpleQueue',
        'Queue'}


def uses(path: Path, modules: tuple[str, ...], names: set[str]) -> int:
    """Count the places where a file uses one of these names of these modules."""
    return sum(isinstance(node, ast.Attribute) and node.attr in names
               and isinstance(node.value, ast.Name) and node.value.id in modules
               for node in nodes_of(path))


def test_who_looks_at_the_system_clock() -> None:
    found = {}
    for path in SOURCES:
        count = uses(path, ('time', 'datetime'), SYSTEM_CLOCK)
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom) and node.module in ('time', 'datetime'):
                count += sum(alias.name in SYSTEM_CLOCK for alias in node.names)
            elif isinstance(node, ast.Import):
                count += sum(alias.name == 'datetime' for alias in node.names)
        if count:
            found[path.relative_to(PACKAGE).as_posix()] = count
    assert found == ALLOWED


def test_everybody_else_is_handed_a_clock() -> None:
    assert {path.relative_to(PACKAGE).as_posix() for path in SOURCES
            if uses(path, ('time', 'threading', 'queue'), WAYS)} == OWN_WAYS


def test_what_heirs_that_stay_python_may_change_is_a_class_variable() -> None:
    """A compiled class looks up nothing else in the class of an object."""
    for path in sorted(PACKAGE.rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.ClassDef) and any(
                    'allow_interpreted_subclasses' in ast.unparse(each)
                    for each in node.decorator_list):
                for line in node.body:
                    assert not isinstance(line, ast.Assign) or ast.unparse(
                        line.targets[0]) == '__slots__', (path, node.name, ast.unparse(line))
                    assert not isinstance(line, ast.AnnAssign) or line.value is None or (
                        'ClassVar' in ast.unparse(line.annotation)), (path, ast.unparse(line))


def _compiled_sources() -> set[Path]:
    """Return what setup.py compiles."""
    for node in nodes_of(CHECKOUT / 'setup.py'):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == 'COMPILED':
            return {PACKAGE / f'{module}.py' for module in ast.literal_eval(node.value)}
    raise AssertionError('setup.py has no COMPILED')


def _own_names(node: ast.ClassDef) -> tuple[set[str], set[str]]:
    """Return what the body of a class gives values, and what each object has by its place."""
    body, places = set(), set()
    for line in node.body:
        if isinstance(line, ast.FunctionDef):
            body.add(line.name)
        for target in line.targets if isinstance(line, ast.Assign) else ():
            body.add(ast.unparse(target))
        if isinstance(line, ast.AnnAssign) and 'ClassVar' not in ast.unparse(line.annotation):
            places.add(ast.unparse(line.target))
        if isinstance(line, ast.AnnAssign) and line.value is not None:
            body.add(ast.unparse(line.target))
    for each in ast.walk(node):
        if (isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store)
                and ast.unparse(each.value) == 'self'):
            places.add(each.attr)
    return body - {'__slots__'}, places


def test_no_heir_that_stays_python_replaces_what_compiled_code_finds_by_its_place() -> None:
    """
    Nobody would say so: compiled code would go on with its own.

    Methods, properties and class variables of a class that allows such heirs are looked up.
    """
    compiled = _compiled_sources()
    classes = {node.name: (path, node) for path in SOURCES for node in nodes_of(path)
               if isinstance(node, ast.ClassDef)}

    def ancestors(name: str) -> Iterator[str]:
        for base in classes[name][1].bases:
            above = ast.unparse(base).split('[')[0].split('.')[-1]
            if above in classes:
                yield above
                yield from ancestors(above)
    heirs = 0
    for name, (path, node) in classes.items():
        body, places = _own_names(node)
        for above in ancestors(name) if path not in compiled else ():
            whose, ancestor = classes[above]
            words = {ast.unparse(base) for base in ancestor.bases}
            if whose not in compiled or words & {'Enum', 'IntEnum', 'NamedTuple'}:
                continue
            heirs += 1
            assert any('allow_interpreted_subclasses=True' in ast.unparse(each)
                       for each in ancestor.decorator_list), (name, above)
            defined, kept = _own_names(ancestor)
            # a property is set by its name, too
            methods = {line.name for line in ancestor.body if isinstance(line, ast.FunctionDef)}
            assert not body & (kept - methods), (path, name, above)
            assert not places & methods, (path, name, above)
    assert heirs > 5


def test_no_compiled_code_asks_whether_a_number_that_may_be_a_flag_is_one() -> None:
    """``bool | int`` is an ``int`` there, and no number is True or False: not even a True."""
    either = {node.target.id for path in SOURCES for node in nodes_of(path)
              if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
              and set(ast.unparse(node.annotation).split(' | ')) == {'bool', 'int'}}
    assert 'continuous' in either
    for path in _compiled_sources():
        for node in nodes_of(path):
            if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
                asked = node.left.attr if isinstance(node.left, ast.Attribute) else ''
                assert asked not in either, (path, ast.unparse(node))
