# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The local way: packets, and what callers may do to a bridge."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import os
import pwd
import socket
import subprocess
import sys
import threading
import time

from clocks import REAL
from hypothesis import given, strategies as st
import pytest
from waiting import wait_for

from drive_can_bridge import __version__
from drive_can_bridge.compiled import build
from drive_can_bridge.process import local_server, presence
from drive_can_bridge.process.local_server import LocalRequest, LocalServer
from drive_can_bridge.process.local_way import (
    ASKED_MAX, Inbound, Line, matches, meant, PACKET, packets_of, Rubbish, value_of, value_text)
from drive_can_bridge.process.presence import bridges, Presence

TEXT = st.text(st.characters(blacklist_categories=['Cs'], blacklist_characters='\0'))


@given(st.lists(TEXT, min_size=1), st.integers(0, 3))
def test_a_message_of_any_length_arrives_as_it_was(texts: list[str], long: int) -> None:
    message = [*texts, 'x' * long * (PACKET - 1)]
    inbound = Inbound(1 << 20)
    packets = packets_of(message)
    assert max(map(len, packets)) <= PACKET
    found = [inbound.take(each) for each in packets]
    assert found == [None] * (len(packets) - 1) + [message]


def test_what_a_shell_hands_over_is_kept_and_a_zero_is_a_blank() -> None:
    assert Inbound(99).take(packets_of(['\udcff', 'a\0b'])[0]) == ['\udcff', 'a b']
    assert packets_of(['stop', 'lift']) == [b'.stop\0lift']


@pytest.mark.parametrize('packet', [b'', b'x', b'.' + PACKET * b'x', b'\xff'])
def test_rubbish(packet: bytes) -> None:
    with pytest.raises(Rubbish):
        Inbound(1 << 20).take(packet)


def test_a_message_without_end() -> None:
    inbound = Inbound(100)
    inbound.take(b'+' + 90 * b'x')
    with pytest.raises(Rubbish):
        inbound.take(b'+' + 90 * b'x')


@given(st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(),
    st.lists(st.text(st.characters(blacklist_characters='\n'), min_size=1)).map(tuple)))
def test_values(value: object) -> None:
    found = value_of(value_text(value))
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize('text', ['x', 'iten', 'd', 'z3'])
def test_no_values(text: str) -> None:
    with pytest.raises(Rubbish):
        value_of(text)


@pytest.mark.parametrize(('word', 'means'), [
    ('lift', True), ('/a/lift', True), ('l*', True), ('/a/*', True), ('/*', True),
    ('/lift', False), ('/b/*', False), ('hoist', False), ('', False)])
def test_what_words_mean(word: str, means: bool) -> None:
    assert matches(word, '/a/lift') is means
    assert meant([word, 'crane'], '/a/lift') is means


# -- a server, and callers ------------------------------------------------------------------------


class Host:
    """A bridge that answers what it is asked."""

    def __init__(self, *, open_to_all: bool = True) -> None:
        self.presence = Presence(3, '/cell/bridge')
        self.asked: list[LocalRequest] = []
        self.reports: list[str] = []
        self.serve: Callable[[LocalRequest], None] = self.echo
        self.server = LocalServer(
            self.presence.socket, self._serve, open_to_all=open_to_all,
            report=self.reports.append, prepare_thread=lambda: None,
            keep_share=lambda: lambda: None, clock=REAL)

    def _serve(self, asked: LocalRequest) -> None:
        self.asked.append(asked)
        self.serve(asked)

    @staticmethod
    def echo(asked: LocalRequest) -> None:
        """Say what was asked."""
        asked.answer(asked.action, *asked.words)
        asked.end()

    def call(self) -> Line:
        """Be a caller."""
        found, = (each for each in bridges() if each.process == os.getpid())
        return Line(found)

    def raw(self) -> socket.socket:
        """Be a caller of another kind."""
        made = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        made.settimeout(10.0)
        made.connect(self.call_address)
        return made

    @property
    def call_address(self) -> str:
        """Where it listens."""
        found, = (each for each in bridges() if each.process == os.getpid())
        return found.address

    def close(self) -> None:
        """End."""
        self.server.stop()
        self.presence.withdraw()
        assert not self.reports


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch, threads: None) -> Iterator[Host]:
    """Listen by a name that nobody else on this machine looks for."""
    monkeypatch.setattr(presence, 'PREFIX', f'test_{os.getpid()}')
    monkeypatch.setattr(local_server, 'PATIENCE', 60.0)     # whoever else has the processors
    made = Host()
    yield made
    made.close()


def answers(line: Line, *, patience: float = 20.0) -> list[list[str]]:
    """Wait for all that is said, up to the end."""
    found: list[list[str]] = []
    deadline = time.monotonic() + patience
    while not found or found[-1][0] not in ('end', 'no'):
        assert time.monotonic() < deadline
        message = line.take()
        if message is None:
            time.sleep(0.001)
        else:
            found.append(message)
    return found


def ask(host: Host, *words: str) -> list[list[str]]:
    """Ask with a line of its own."""
    line = host.call()
    try:
        line.ask(*words)
        return answers(line)
    finally:
        line.close()


def whose(host: Host) -> str:
    """Ask, and return whom that is of for the log."""
    ask(host, 'stop')
    return host.asked[-1].whom


def test_question_and_answer_on_one_connection(host: Host) -> None:
    line = host.call()
    assert line.believed
    for words in (['who'], ['stop', '*', 'x' * 9000], ['get', '/lift', 'ramp_time']):
        line.ask(*words)
        assert answers(line) == [words, ['end']]
    line.close()


def test_a_bridge_knows_whose_process_asks(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    name = pwd.getpwuid(os.geteuid()).pw_name
    wait_for(lambda: whose(host) == f'user {name}, process {os.getpid()}', 'its name')
    monkeypatch.setattr(local_server, 'peer_of', lambda _: (0, 4321))   # another name space
    assert whose(host) == 'user 4321'


def test_names_that_take_long_to_look_up_hold_up_nobody(
        monkeypatch: pytest.MonkeyPatch, threads: None) -> None:
    """They may be on a network that is not there yet, when a computer starts."""
    found = threading.Event()

    def look_up(_: int) -> str:
        found.wait(5.0)
        return 'user late'
    monkeypatch.setattr(local_server, 'user_name', look_up)
    monkeypatch.setattr(presence, 'PREFIX', f'test_{os.getpid()}')
    host = Host()
    try:
        assert whose(host) == f'user {os.geteuid()}, process {os.getpid()}'
        found.set()
        wait_for(lambda: whose(host) == f'user late, process {os.getpid()}', 'the name')
    finally:
        host.close()


def test_a_user_without_a_name_has_a_number() -> None:
    assert local_server.user_name(0) == 'user root'
    assert local_server.user_name(4_000_000_000) == 'user 4000000000'


def test_whoever_asks_nothing_or_rubbish_is_hung_up_on(
        host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, 'PATIENCE', 0.1)
    for packets in ([], [b''], [b'hello'], [b'.\xff\xfe'], [b'+half'], [b'.' + PACKET * b'x'],
                    [b'.1\0\0\0\0'], [b'.0\0stop'], [b'+' + (PACKET - 1) * b'x'] * 17):
        caller = host.raw()
        with suppress(OSError):     # it hangs up before all is said
            for packet in packets:
                caller.send(packet)
        received = []
        with suppress(ConnectionResetError):
            while packet := caller.recv(PACKET):
                received.append(packet)
                if packets[0].startswith(b'.'):
                    break
        assert all(b'no\0' in each or each in (b'.end', b'.\0\0\0') for each in received)
        caller.close()
    monkeypatch.setattr(local_server, 'PATIENCE', 60.0)
    assert ask(host, 'who')[-1] == ['end']


def test_a_flood_that_asks_nothing_makes_room(host: Host) -> None:
    silent = []
    for _ in range(2 * local_server.CALLERS_MAX):
        silent.append(host.raw())
    assert ask(host, 'stop', '*') == [['stop', '*'], ['end']]
    for each in silent:
        each.close()


def test_a_caller_that_does_not_read_costs_nobody_anything(
        host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, 'UNREAD_PATIENCE', 0.2)

    def flood(asked: LocalRequest) -> None:
        for _ in range(3000 if asked.action == 'much' else 1):
            asked.answer('x' * 1000)
        asked.end()
    host.serve = flood
    deaf = host.call()
    deaf.ask('much')
    assert len(ask(host, 'who')) == 2
    wait_for(lambda: len(host.server._callers) == 0, 'that it is thrown out')
    with pytest.raises(ConnectionResetError):
        for _ in range(4000):
            deaf.take()
    deaf.close()
    monkeypatch.setattr(local_server, 'UNREAD_PATIENCE', 60.0)
    reader = host.call()    # the same, read
    reader.ask('much')
    assert len(answers(reader)) == 3001
    reader.close()


def test_two_hundred_stops_at_once(host: Host) -> None:
    found = []

    def stop() -> None:
        found.append(ask(host, 'stop', '*'))
    callers = [threading.Thread(target=stop) for _ in range(200)]
    for each in callers:
        each.start()
    for each in callers:
        each.join()
    assert found == [[['stop', '*'], ['end']]] * 200


def test_so_many_may_ask_for_anything_but_a_stop(host: Host) -> None:
    host.serve = lambda asked: None if asked.action == 'get' else host.echo(asked)
    waiting = [host.call() for _ in range(local_server.BUSY_MAX + 1)]
    for each in waiting[:-1]:
        each.ask('get', '/lift')
    while len(host.asked) < local_server.BUSY_MAX:
        time.sleep(0.001)
    waiting[-1].ask('get', '/lift')
    assert answers(waiting[-1]) == [['no', 'too many ask']]
    assert ask(host, 'stop', '*') == [['stop', '*'], ['end']]
    for each in waiting:
        each.close()
    while ask(host, 'who') != [['who'], ['end']]:   # soon, they are forgotten
        time.sleep(0.001)


def test_a_caller_that_has_gone_is_answered_all_the_same(host: Host) -> None:
    host.serve = lambda asked: None
    line = host.call()
    line.ask('get', '/lift')
    while not host.asked:
        time.sleep(0.001)
    line.close()
    for _ in range(100):
        host.asked[0].answer('late', 'x' * 5000)
    host.asked[0].end()
    host.serve = host.echo
    assert ask(host, 'who')[-1] == ['end']


def test_a_defect_in_an_answer_is_told_and_the_next_is_served(host: Host) -> None:
    def fail(asked: LocalRequest) -> None:
        raise ValueError('broken')
    host.serve = fail
    line = host.call()
    line.ask('who')
    while not host.reports:
        time.sleep(0.001)
    assert host.reports.pop() == 'internal error in the local way: ValueError: broken'
    host.serve = host.echo
    assert ask(host, 'who')[-1] == ['end']
    line.close()


@contextmanager
def stranger() -> Iterator[None]:
    """Be somebody else for a while; root can."""
    if os.geteuid() != 0:
        pytest.skip('root alone can be somebody else')
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.mark.parametrize('open_to_all', [True, False])
def test_a_stranger_may_stop_and_nothing_else(
        monkeypatch: pytest.MonkeyPatch, threads: None, open_to_all: bool) -> None:
    monkeypatch.setattr(presence, 'PREFIX', f'test_{os.getpid()}')
    host = Host(open_to_all=open_to_all)
    heard = []
    for action in ('stop', 'enable', 'set', 'who'):
        with stranger():
            line = host.call()
        with suppress(OSError):
            line.ask(action, '*')
            heard.append(answers(line)[-1])
        line.close()
    assert heard == ([['end'], *[['no', 'another user']] * 3] if open_to_all else [])
    assert {each.action for each in host.asked} == ({'stop'} if open_to_all else set())
    host.close()


def test_a_flood_of_a_stranger_leaves_room_for_ours(host: Host) -> None:
    host.serve = lambda asked: host.echo(asked) if asked.trusted else None
    with stranger():
        flood = [host.call() for _ in range(40)]
    for each in flood:
        with suppress(OSError):
            each.ask('stop', '*')
    wait_for(lambda: len(host.asked) >= local_server.OF_A_STRANGER, 'so many')
    assert ask(host, 'stop', '*') == [['stop', '*'], ['end']]
    wait_for(lambda: all(each.busy for each in list(host.server._callers.values())),
             'that all who may stay are heard')
    assert len(host.asked) == local_server.OF_A_STRANGER + 1
    for each in flood:
        each.close()


def test_a_bridge_of_a_stranger_is_not_believed(
        monkeypatch: pytest.MonkeyPatch, threads: None) -> None:
    monkeypatch.setattr(presence, 'PREFIX', f'test_{os.getpid()}')
    with stranger():
        host = Host()   # who listens is known by whom he was then
    monkeypatch.setattr(os, 'geteuid', lambda: 1000)
    line = host.call()
    assert not line.believed
    line.close()
    host.close()


def busy(host: Host) -> tuple[Line, threading.Event]:
    """Have a host be asked something that takes until the event; return who asked."""
    goes_on = threading.Event()

    def wait(asked: LocalRequest) -> None:
        goes_on.wait(60.0)
        host.echo(asked)
    host.serve = wait
    first = host.call()
    first.ask('who')
    while not host.asked:
        time.sleep(0.001)
    return first, goes_on


def test_what_nobody_waits_for_any_more_is_not_done_but_a_stop(host: Host) -> None:
    first, goes_on = busy(host)
    for action in ('enable', 'stop', 'set'):    # by who loses patience, or is ended
        line = host.call()
        line.ask(action, '/lift')
        line.close()
    goes_on.set()
    assert ask(host, 'who') == [['who'], ['end']]
    assert [each.action for each in host.asked] == ['who', 'stop', 'who']
    first.close()


def test_ours_are_heard_before_strangers(host: Host) -> None:
    first, goes_on = busy(host)
    with stranger():
        strange = [host.call() for _ in range(10)]
    for each in strange:
        each.ask('stop', '*')
    ours = host.call()
    ours.ask('stop', '*', 'lift')
    host.serve = host.echo
    goes_on.set()
    assert answers(ours) == [['stop', '*', 'lift'], ['end']]
    assert host.asked[1].words == ['*', 'lift'] and host.asked[1].trusted
    for each in strange:    # whoever they are, they are heard
        assert answers(each) == [['stop', '*'], ['end']]
    assert not any(each.trusted for each in host.asked[2:])
    for each in (first, ours, *strange):
        each.close()


def test_longer_questions_than_allowed(host: Host) -> None:
    line = host.call()
    with pytest.raises(OSError):
        line.ask('who', 'x' * (ASKED_MAX + 1))
        answers(line)
    line.close()


@pytest.mark.usefixtures('programs')
def test_the_version_needs_no_argparse() -> None:
    code = ('import sys; sys.argv = ["drive_can", "--version"]\n'
            'before = set(sys.modules)\n'
            'from drive_can_bridge.cli.start import main; assert main() == 0\n'
            'assert not {"argparse", "drive_can_bridge.core"} & (set(sys.modules) - before)')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == f'drive_can {__version__} ({build()})\n'


# -- what is imported before a stop is sent -------------------------------------------------------

NEEDED = {'drive_can_bridge', 'drive_can_bridge.cli', 'drive_can_bridge.cli.start',
          'drive_can_bridge.host_texts',
          'drive_can_bridge.process', 'drive_can_bridge.process.beginning',
          'drive_can_bridge.process.local_stop', 'drive_can_bridge.process.local_way',
          'drive_can_bridge.process.presence'}
HEAVY = {'argparse', 'json', 'typing', 'hashlib', 'dataclasses', 'inspect', 'threading', 'pathlib',
         'rclpy', 'fnmatch', 'yaml', 'can', 'subprocess', 'logging', 'importlib.metadata'}


@pytest.mark.usefixtures('programs')
def test_a_stop_imports_nothing_that_it_does_not_need_to_be_sent() -> None:
    code = ('import sys; before = set(sys.modules)\n'
            'import drive_can_bridge.cli.start\n'
            'from drive_can_bridge.process import local_stop\n'
            'local_stop.begin(["lift", "--namespace", "cell", "--json"])\n'
            'assert local_stop._early\n'
            'print(*sorted(set(sys.modules) - before))')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          check=True, env={**os.environ, 'DRIVE_CAN_LOCAL': 'on',
                                           'ROS_DOMAIN_ID': '231'})
    imported = set(done.stdout.split())
    assert {name for name in imported if name.startswith('drive_can_bridge')} == NEEDED
    assert not imported & HEAVY


#: what is imported besides where all bridges are of this host, until the command has ended
TO_ITS_END = {'drive_can_bridge.cli.saying', 'drive_can_bridge.cli.stopping'}
ENDING = """
import os, sys
before, leave = set(sys.modules), os._exit

def told(code):
    print(*sorted(set(sys.modules) - before), file=sys.stderr, flush=True)
    leave(code)
os._exit = told
from drive_can_bridge.cli.start import main
from drive_can_bridge.process.local_stop import LocalStop
wait = LocalStop.wait
LocalStop.wait = lambda stop, timeout: wait(stop, 60.0)     # a busy machine answers later
main()
"""


@pytest.mark.usefixtures('programs', 'threads')
@pytest.mark.parametrize(('success', 'said'), [
    ('1', 'of_a_test/lift: ready\n'), ('0', 'of_a_test/lift: NOT STOPPED: no answer\n')])
def test_a_stop_that_is_answered_imports_nothing_more(success: str, said: str) -> None:
    name = f'/of_a_test/bridge{os.getpid()}'
    presence = Presence(231, name)

    def serve(asked: LocalRequest) -> None:
        assert (asked.action, asked.words) == ('stop', ['/of_a_test', 'lift'])
        asked.answer('drives', '/of_a_test/lift')
        asked.answer('bridge', name, '231', name)
        time.sleep(0.01)
        asked.answer('drive', '/of_a_test/lift', success, '1',
                     'ready' if success == '1' else 'no answer')
        asked.end()
    server = LocalServer(
        presence.socket, serve, open_to_all=True, report=print, prepare_thread=lambda: None,
        keep_share=lambda: lambda: None, clock=REAL)
    try:
        command = [sys.executable, '-c', ENDING, 'stop', 'lift', '--namespace=of_a_test']
        environment = {**os.environ, 'DRIVE_CAN_LOCAL': 'on', 'ROS_DOMAIN_ID': '231'}
        done = subprocess.run(command, capture_output=True, text=True, check=False,
                              env=environment)
        environment.pop('PYTHONUNBUFFERED', None)
        with open('/dev/full', 'w', encoding='utf-8') as full:
            lost = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True,
                                  check=False, env=environment)
    finally:
        server.stop()
        presence.withdraw()
    assert (done.returncode, done.stdout) == (1 - int(success), said)
    assert lost.returncode == 1     # and nothing of it is told as an error
    assert lost.stderr.splitlines()[0] == 'drive_can stop: No space left on device'
    assert 'lift' not in lost.stderr
    imported = set(done.stderr.split())
    assert {name for name in imported if name.startswith('drive_can_bridge')} == (
        NEEDED | TO_ITS_END)
    assert not imported & HEAVY


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize('command', ['read', 'write', 'enable'])
def test_what_goes_through_a_bridge_of_this_host_imports_no_part_of_one(command: str) -> None:
    code = ('import sys\n'
            f'sys.argv[1:] = [{command!r}, "lift", "ramp_time=1", "--json"]\n'
            'from drive_can_bridge.cli import start\n'
            'from drive_can_bridge.cli.main import understood\n'
            f'understood(sys.argv[1:] if {command!r} != "enable" else ["enable", "lift"])\n'
            'from drive_can_bridge.client import bridge, local\n'
            'print(*sorted(sys.modules))')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    imported = set(done.stdout.split())
    assert not imported & {
        'rclpy', 'yaml', 'can', 'subprocess', 'logging', 'tempfile', 'rich', 'numpy', 'ctypes',
        'importlib.metadata', 'drive_can_bridge.configuration.load',
        *(f'drive_can_bridge.core.{name}' for name in (
            'codes', 'complaints', 'configuration', 'process_image', 'profile', 'session')),
        'drive_can_bridge.protocols.families', 'drive_can_bridge.transport.library_logs'}
