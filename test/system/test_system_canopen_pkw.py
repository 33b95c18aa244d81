# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""An LTMR in literal text, and the bytes between it and the bridge."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from parameter_files import bridge_file
import plant
from processes import Client, Processes
from slcan_peer import Answers, Peer
from waiting import wait_for

PUMP: dict[str, Any] = {
    **plant.PUMP,
    'cyclic_response': ['system_status_1', 'system_status_2', 'thermal_capacity',
                        'average_current_ratio', 'average_current'],
    # generous: nothing here may depend on how busy the machine is
    'missed_limit': 25, 'parameter_timeout': 2.0, 'control_timeout': 30.0,
}


READ_455 = 't5058C7010025', 't5058C70100A5'
#: registers 62, 64 to 74 and 76: what the bridge reads once to know who it talks to
IDENTITY = {f'{register:02X}00': '3412' for register in (62, *range(64, 75), 76)}


class Controller:
    """An LTMR in literal text: what it answers to which line, and nothing that is ours."""

    def __init__(self) -> None:
        self.words = {'C701': '4100', '8C02': '2100', 'C002': '0000', **IDENTITY}
        self.function = '00'
        self.operational = False
        self.acknowledges = True

    def __call__(self, line: str) -> list[str]:
        if line.startswith('t000'):
            self.operational = True
            return []
        register, low, function, value = line[5:9], line[9:11], line[11:13], line[13:17]
        if not self.operational or function == self.function:
            return []
        self.function = function
        head = f't4858{register}{low}'
        if function in ('00', '80'):
            return [f'{head}{function}00000000']
        if register not in self.words:
            return [f'{head}{"CE" if function[0] in "AB" else "4E"}00000206']
        if function in ('2A', 'AA'):
            self.words[register] = value
            if register == 'C002':
                # run forward: ready, on
                self.words['C701'] = '4300' if value == '0100' else '4100'
            value = '0000'
            if not self.acknowledges:
                return []
        else:
            value = self.words[register]
        return [f'{head}{function}{value}0000']


def test_bytes_of_the_manual(processes: Processes, client: Client, namespace: str,
                             tmp_path: Path, connect: Callable[[Answers], Peer]) -> None:
    controller = Controller()
    peer = connect(dict.fromkeys(['t00020105', 't5058'], controller))
    file = bridge_file(tmp_path, bus={'bitrate': 250_000}, drives={
        'pump': {**PUMP, 'cyclic_response': ['system_status_1']}})
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/pump'
    client.online(drive)
    client.value(f'{drive}/system_status_1', 0x41, 0x41, kind='Int64')
    for head in READ_455:
        peer.wait_for(head)
    frames = [line for line in peer.lines if line[:1] in ('t', 'T')]
    assert frames[0] == 't00020105'
    # whatever the first function byte is, the next request has another
    functions = [line[11:13] for line in frames if line.startswith('t505')]
    assert all(one != other for one, other in zip(functions, functions[1:]))
    wait_for(lambda: {line for line in peer.lines if line.startswith('t5058C701')} == {
        f'{head}00000000' for head in READ_455}, 'reads of 455 with both toggles')

    assert client.get(drive, 'flc1_ratio') == [33.0]
    assert client.set(drive, flc1_ratio=50.0) == [(True, '')]
    assert controller.words['8C02'] == '3200'
    assert client.get(drive, 'p9999') == [None]
    bridge.error('pump: read p9999 .*06020000h')
    assert client.control(f'{drive}/enable', True)[0]
    assert controller.words['C002'] == '0100'

    # a write whose answer is lost has been executed: it is reported, and never repeated
    sent = len(peer.lines)
    controller.acknowledges = False
    (success, reason), = client.set(drive, flc1_ratio=60.0)
    controller.acknowledges = True
    assert not success
    assert reason.startswith('no answer')
    assert len([line for line in peer.lines[sent:] if line.startswith('t50588C0200')
                and line[12] == 'A']) == 1
    assert client.get(drive, 'flc1_ratio') == [60.0]
    assert bridge.end() == 0
    # the last word to the controller is to stop
    assert controller.words['C002'] == '0000'
    known = ('t00020105', 't50588C0200', 't5058C00200', 't5058000000')
    frames = [line for line in peer.lines if line[:1] in ('t', 'T')]
    # beside these only reads of one or two registers: the round, 9999, who it is
    assert {(line[:5], line[11:]) for line in frames if not line.startswith(known)} <= {
        ('t5058', f'{function}00000000') for function in ('25', 'A5', '26', 'A6')}
