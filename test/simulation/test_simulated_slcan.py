# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The SLCAN adapter: its commands byte by byte, and the pseudo-terminal under python-can."""

import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

from builders import frame
import can
from clocks import REAL
from hypothesis import given, strategies as st
import pytest
from simulation_builders import bridge
from waiting import wait_for

from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.frame import EXTENDED_IDENTIFIER_MAX, Frame
from drive_can_bridge.simulation.simulation import Simulation
from drive_can_bridge.simulation.terminal import BACKLOG, SlcanAdapter, SlcanTerminal


def opened() -> SlcanAdapter:
    adapter = SlcanAdapter()
    adapter.receive_bytes(b'C\rS4\rO\r')
    assert adapter.take_replies() == b'\r\r\r'
    return adapter


class TestCommands:

    @pytest.mark.parametrize(('command', 'reply'), [
        (b'S0\r', b'\r'), (b'S8\r', b'\r'), (b'S9\r', b'\r'), (b'SA\r', b'\a'), (b'S\r', b'\a'),
        (b's031C\r', b'\r'), (b's03\r', b'\a'), (b'O\r', b'\r'), (b'L\r', b'\r'), (b'C\r', b'\r'),
        (b'V\r', b'V1013\r'), (b'N\r', b'NSIM1\r'), (b'F\r', b'\a'), (b'Z0\r', b'\r'),
        (b'Z1\r', b'\a'), (b'M00000000\r', b'\r'), (b'mFFFFFFFF\r', b'\r'), (b'X1\r', b'\r'),
        (b'\r', b''), (b'\r\r', b''), (b'?\r', b'\a'), (b'\xff\xfe\r', b'\a'),
        (b't1230\r', b'\a'),
    ])
    def test_while_closed(self, command: bytes, reply: bytes) -> None:
        adapter = SlcanAdapter()
        assert adapter.receive_bytes(command) == []
        assert adapter.take_replies() == reply

    @pytest.mark.parametrize(('command', 'expected'), [
        (b'T003FFFF0805DC000000000000\r', '003FFFF0#05DC000000000000'),
        (b'T003ffff0805dc000000000000\r', '003FFFF0#05DC000000000000'),
        (b'T1FFFFFFF0\r', '1FFFFFFF#'), (b't7F1811223344AABBCCDD\r', '7F1#11223344AABBCCDD'),
        (b't0000\r', '000#'),
    ])
    def test_frame(self, command: bytes, expected: str) -> None:
        adapter = opened()
        assert adapter.receive_bytes(command) == [frame(expected)]
        assert adapter.take_replies() == b''

    @pytest.mark.parametrize('command', [
        b't8000\r', b'T200000000\r', b't1239\r', b't1232AB\r', b't1231ABCD\r', b't12\r', b't\r',
        b'T003FFFF0\r', b't123G\r', b't1231+5\r', b'r1231AB\r', b'S4\r', b't' + 100 * b'0' + b'\r',
    ])
    def test_refused_while_open(self, command: bytes) -> None:
        adapter = opened()
        assert adapter.receive_bytes(command) == []
        assert adapter.take_replies() == b'\a'
        assert adapter.receive_bytes(b't1230\r') == [frame('123#')]

    def test_remote_frames_lead_nowhere(self) -> None:
        adapter = opened()
        assert adapter.receive_bytes(b'r1238\rR003FFFF00\r') == []
        assert adapter.take_replies() == b''

    def test_listen_only_sends_nothing(self) -> None:
        adapter = SlcanAdapter()
        assert adapter.receive_bytes(b'L\rt1230\r') == []
        assert adapter.take_replies() == b'\r\a'
        assert adapter.is_open

    @pytest.mark.parametrize(('setting', 'passes'), [
        (b'S6', True), (b'S4', False), (b's031C', True), (b'', True)])
    def test_only_the_bit_rate_of_the_bus_will_do(self, setting: bytes, passes: bool) -> None:
        adapter = SlcanAdapter(500_000)
        assert not adapter.connected
        assert adapter.receive_bytes(setting + b'\rO\rt1230\r') == [frame('123#')] * passes
        assert adapter.take_replies() == b'\r' * (2 if setting else 1)
        assert (adapter.is_open, adapter.connected) == (True, passes)
        # closed, and opened with the right one
        assert adapter.receive_bytes(b'C\rS6\rO\rt1230\r') == [frame('123#')]
        assert adapter.connected

    def test_commands_in_pieces(self) -> None:
        adapter = opened()
        pieces = [b'T003F', b'FFF0', b'200', b'FF\rt12', b'30\r']
        assert [len(adapter.receive_bytes(piece)) for piece in pieces] == [0, 0, 0, 1, 1]

    def test_a_command_that_is_too_long_is_refused_when_it_ends(self) -> None:
        adapter = SlcanAdapter()
        # a filter of 64 characters may be, one of 65 is none
        for piece in (b'C\rM' + 63 * b'0', b'\rM' + 60 * b'0', b'0000', b'', b'\rC\r'):
            assert adapter.receive_bytes(piece) == []
        assert adapter.take_replies() == b'\r\r\a\r'

    def test_encode(self) -> None:
        adapter = opened()
        assert adapter.encode(frame('103FFFF0#1122')) == b'T103FFFF021122\r'
        assert adapter.encode(frame('7F1#')) == b't7F10\r'

    @given(st.lists(st.binary(max_size=90), max_size=10))
    def test_any_bytes_will_do(self, chunks: list[bytes]) -> None:
        adapter = opened()
        for chunk in chunks:
            for received in adapter.receive_bytes(chunk):
                assert received.identifier <= EXTENDED_IDENTIFIER_MAX


def client(terminal: SlcanTerminal | str, **options: Any) -> can.BusABC:
    path = terminal if isinstance(terminal, str) else terminal.path
    return can.Bus(interface='slcan', channel=path, bitrate=125_000, sleep_after_open=0.0,
                   ignore_config=True, **options)


def receive(terminal: SlcanTerminal, timeout: float = 10.0) -> Frame | None:
    """Wait for a frame; commands may come before it."""
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline:
        found = terminal.receive(0.1)
        if found is not None:
            return found
    return None


@pytest.fixture
def terminal() -> Any:
    made = SlcanTerminal(REAL.now)
    yield made
    made.close()


class TestTerminal:

    def test_a_client_at_another_bit_rate_hears_nothing(self) -> None:
        terminal = SlcanTerminal(REAL.now, 500_000)
        try:
            with client(terminal) as bus:
                bus.send(can.Message(arbitration_id=0x3FFFF0, data=[1, 2, 3]))
                wait_for(lambda: terminal.receive(0.01) is not None or terminal.is_open)
                terminal.send(frame('7F1#CC'))
                assert bus.recv(0.2) is None
                assert receive(terminal, 0.1) is None
        finally:
            terminal.close()

    def test_frames_pass_both_ways(self, terminal: SlcanTerminal) -> None:
        with client(terminal) as bus:
            bus.send(can.Message(arbitration_id=0x3FFFF0, data=[1, 2, 3]))
            bus.send(can.Message(arbitration_id=0x3F1, data=[], is_extended_id=False))
            assert receive(terminal) == frame('003FFFF0#010203')
            assert receive(terminal) == frame('3F1#')
            terminal.send(frame('103FFFF0#AABB'))
            terminal.send(frame('7F1#CC'))
            first, second = bus.recv(10.0), bus.recv(10.0)
            assert first is not None and second is not None
            assert (first.arbitration_id, first.is_extended_id, bytes(first.data)) == (
                0x103FFFF0, True, b'\xAA\xBB')
            assert (second.arbitration_id, second.is_extended_id, bytes(second.data)) == (
                0x7F1, False, b'\xCC')
            assert bus.recv(0.0) is None

    def test_clients_come_and_go(self, terminal: SlcanTerminal) -> None:
        for number in range(3):
            bus = client(terminal)
            wait_open(terminal)
            terminal.send(frame(f'10{number}#'))
            terminal.send(frame('7FF#'))            # never read
            message = bus.recv(10.0)
            assert message is not None
            assert message.arbitration_id == 0x100 + number
            bus.shutdown()
            wait_for(lambda: terminal.receive(0.0) is None and not terminal.is_open, 'close')

    def test_client_that_dies_without_closing(self, terminal: SlcanTerminal) -> None:
        first = os.open(terminal.path, os.O_RDWR | os.O_NOCTTY)
        os.write(first, b'O\r')
        wait_open(terminal)
        for _ in range(3000):
            terminal.send(frame('7FF#1122334455667788'))
        os.close(first)
        with client(terminal) as bus:
            # the channel was open all the time: what shows the new client is its command
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False))
            assert receive(terminal) == frame('123#')
            terminal.send(frame('321#'))
            seen = []
            while not seen or seen[-1] != 0x321:
                message = bus.recv(10.0)
                assert message is not None
                seen.append(message.arbitration_id)
            assert len(seen) <= BACKLOG

    def test_nobody_reads(self, terminal: SlcanTerminal) -> None:
        reader = os.open(terminal.path, os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(reader, b'O\r')
            wait_open(terminal)
            begin = time.monotonic()
            for number in range(10_000):
                terminal.send(Frame(number, bytes(8), True))
            assert time.monotonic() - begin < 5.0
            # the newest arrive, none of them in pieces
            text = b''
            while f'T{9999:08X}8'.encode() not in text:
                assert terminal.receive(0.0) is None
                text += os.read(reader, 4096)
            while not text.endswith(b'\r'):
                text += os.read(reader, 4096)
            lines = text.replace(b'\r', b' ').split()
            assert {len(line) for line in lines} == {26}
            assert BACKLOG <= len(lines) < 10_000
        finally:
            os.close(reader)

    def test_closed(self, terminal: SlcanTerminal) -> None:
        terminal.close()
        terminal.close()
        with pytest.raises(BusUnavailable, match='closed'):
            terminal.receive(0.0)
        with pytest.raises(BusUnavailable, match='closed'):
            terminal.send(frame('123#'))


class TestLink:

    def test_points_at_the_terminal_until_it_closes(
            self, terminal: SlcanTerminal, tmp_path: Path) -> None:
        link = tmp_path / 'links' / 'main'
        terminal.link(link)
        assert os.readlink(link) == terminal.path
        with client(str(link)):
            wait_open(terminal)
        terminal.close()
        assert not link.is_symlink()
        assert list(link.parent.iterdir()) == []

    def test_leaves_a_link_that_another_took_over(
            self, terminal: SlcanTerminal, tmp_path: Path) -> None:
        link = tmp_path / 'main'
        terminal.link(link)
        other = SlcanTerminal(REAL.now)
        other.link(link)
        terminal.close()
        assert os.readlink(link) == other.path
        other.close()
        assert not link.is_symlink()

    def test_spares_what_is_no_link(self, terminal: SlcanTerminal, tmp_path: Path) -> None:
        file = tmp_path / 'main'
        file.write_text('precious')
        with pytest.raises(OSError, match='not a symbolic link'):
            terminal.link(file)
        assert file.read_text() == 'precious'


CLIENT = """
import sys
import can
bus = can.Bus(interface='slcan', channel=sys.argv[1], bitrate=125000, sleep_after_open=0.0)
for _ in range(100):
    bus.send(can.Message(arbitration_id=0x003FFFF0, data=bytes(8)))
    answer = bus.recv(10.0)
    assert answer is not None and answer.arbitration_id == 0x103FFFF0, answer
print(answer.data.hex())
bus.shutdown()
"""


@pytest.mark.real
def test_client_in_another_process() -> None:
    terminal = SlcanTerminal(REAL.now)
    with Simulation(bridge(), REAL, open_bus=lambda bus: terminal) as simulation:
        for _ in range(2):
            done = subprocess.run([sys.executable, '-c', CLIENT, terminal.path], text=True,
                                  capture_output=True, timeout=60, check=False)
            assert done.stderr == ''
            assert done.stdout == '000000c80003a5a5\n'
        assert simulation.drives['conveyor'].answers == 200
        assert not simulation.drives['conveyor'].violations
    with pytest.raises(BusUnavailable):
        terminal.receive(0.0)


def wait_open(terminal: SlcanTerminal) -> None:
    """Let the adapter obey the commands that open it."""
    wait_for(lambda: terminal.receive(0.01) is None and terminal.is_open, 'open channel')
