# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A simulated LTMR, the bridge and a ROS node in three processes; and the bytes between them."""

from pathlib import Path
from typing import Any

from parameter_files import bridge_file
from processes import Client, Process, Processes, Simulator
from slcan_peer import Peer
from waiting import wait_for

PUMP: dict[str, Any] = {
    'bus': 'main', 'protocol': 'canopen_pkw', 'station': 5, 'profile': 'tesys_t_ltmr',
    'period': 0.1,
    'cyclic_response': ['system_status_1', 'system_status_2', 'thermal_capacity',
                        'average_current_ratio', 'average_current'],
    # generous: nothing here may depend on how busy the machine is
    'missed_limit': 25, 'parameter_timeout': 2.0, 'control_timeout': 30.0,
}


def pump_file(directory: Path, **options: Any) -> Path:
    """Write a parameter file with one LTMR."""
    return bridge_file(directory, drives={'pump': {**PUMP, **options}},
                       bus={'bitrate': 250_000})


def started(processes: Processes, client: Client, namespace: str, directory: Path,
            **options: Any) -> tuple[Simulator, Process, str]:
    """Start a simulated LTMR and a bridge; return both, and the drive's name in ROS."""
    file = pump_file(directory, **options)
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/pump'
    client.online(drive)
    return simulator, bridge, drive


def status_of(namespace: str) -> str:
    return f'{namespace}/drive_can_bridge: drive pump'


def on_the_wire(simulator: Simulator, request: str, response: str) -> None:
    """Wait for a request and its response on the bus, one right after the other."""
    requests = {f'505#{data} R' for data in (request, toggled(request))}
    responses = {f'485#{data} T' for data in (response, toggled(response))}

    def find() -> bool:
        frames = [frame for frame in simulator.frames() if frame[:3] in ('505', '485')]
        return any(one in requests and other in responses
                   for one, other in zip(frames, frames[1:]))
    wait_for(find, f'505#{request} and 485#{response}')


def toggled(data: str) -> str:
    """Return mailbox data with the other toggle bit."""
    return f'{data[:6]}{int(data[6:8], 16) ^ 0x80:02X}{data[8:]}'


def test_all_eight_functions(processes: Processes, client: Client, namespace: str,
                             tmp_path: Path) -> None:
    simulator, bridge, drive = started(processes, client, namespace, tmp_path)

    # NMT start goes first; nothing was sent as a PDO before
    ours = simulator.frames(' R$')
    assert ours[0] == '000#0105 R'
    assert {frame[:4] for frame in ours} == {'000#', '505#'}
    # the round: 455 with 456, 465 with 466, 500 with 501
    on_the_wire(simulator, 'C701002600000000', 'C701002641000000')
    on_the_wire(simulator, 'D101002600000000', 'D101002600000000')
    on_the_wire(simulator, 'F401002600000000', 'F401002600000000')
    client.value(f'{drive}/system_status_1', 0x0041, 0x0041, kind='Int64')
    client.value(f'{drive}/average_current', 0.0, 0.0)

    # by register: one and two, read and written
    assert client.get(drive, 'flc1_ratio') == [33.0]
    on_the_wire(simulator, '8C02002500000000', '8C02002521000000')
    assert client.set(drive, flc1_ratio=40.0) == [(True, '')]
    on_the_wire(simulator, '8C02002A28000000', '8C02002A00000000')
    assert client.get(drive, 'flc1_ratio', 'flc2_ratio') == [40.0, 33.0]
    on_the_wire(simulator, '8C02002600000000', '8C02002628002100')
    assert client.set(drive, atomic=True, flc2_ratio=60.0, flc1_ratio=45.0) == [(True, '')]
    on_the_wire(simulator, '8C02002B2D003C00', '8C02002B00000000')
    assert client.get(drive, 'p652', 'p653') == [45, 60]
    # a value of 32 bits takes two
    assert client.get(drive, 'l1_current') == [0.0]
    on_the_wire(simulator, 'F601002600000000', 'F601002600000000')

    # by CANopen address, which raw names choose
    assert client.get(drive, 'x2007.3') == [45]
    on_the_wire(simulator, '0720033500000000', '072003352D000000')
    assert client.set(drive, **{'x2007.3': 50}) == [(True, '')]
    on_the_wire(simulator, '0720033A32000000', '0720033A00000000')
    assert client.get(drive, 'x2007.3', 'x2007.4') == [50, 60]
    on_the_wire(simulator, '0720033600000000', '0720033632003C00')
    assert client.set(drive, atomic=True, **{'x2007.3': 55, 'x2007.4': 65}) == [(True, '')]
    on_the_wire(simulator, '0720033B37004100', '0720033B00000000')
    assert client.get(drive, 'flc1_ratio', 'flc2_ratio') == [55.0, 65.0]

    assert not any('violation' in line for line in simulator.lines)
    assert bridge.end() == 0
    assert simulator.end() == 0


def test_refusals(processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    simulator, bridge, drive = started(processes, client, namespace, tmp_path)

    # an illegal value: refused with code and text, and the register keeps its value
    assert client.get(drive, 'motor_trip_class') == [5.0]
    (success, reason), = client.set(drive, motor_trip_class=7.0)
    assert not success
    assert '06090030h' in reason
    assert 'value out of range' in reason
    on_the_wire(simulator, '5E02002A07000000', '5E02004E30000906')
    assert client.get(drive, 'motor_trip_class') == [5.0]
    (success, reason), = client.set(drive, **{'x2006.7': 8})
    assert not success
    assert '06090030h' in reason
    assert client.set(drive, motor_trip_class=10.0) == [(True, '')]
    assert client.get(drive, 'motor_trip_class', 'p606') == [10.0, 10]

    # registers and objects that the device lacks; what is asked for with them is still read
    assert client.get(drive, 'p9999', 'flc1_ratio', 'x2004.ff') == [None, 33.0, None]
    assert '06020000h' in bridge.error('pump: read p9999 ')
    assert '06090011h' in bridge.error('pump: read x2004.ff ')
    on_the_wire(simulator, '0F27002500000000', '0F27004E00000206')
    (success, reason), = client.set(drive, p9999=1)
    assert not success
    assert '06020000h' in reason
    facts = client.diagnostics(status_of(namespace))
    assert '06020000h' in facts['last_parameter_error']

    # what the bridge does not even send
    before = len(simulator.frames('^505#........0[1-9A-F]'))
    for values, words in (({'system_status_1': 1}, 'read-only'), ({'p455': 1}, 'read-only'),
                          ({'flc1_ratio': 101.0}, '5 to 100'), ({'p652': 101}, '5 to 100'),
                          ({'control_register_1': 1}, 'use ~/enable'),
                          ({'p704': 1}, 'use ~/enable'), ({'x2008.5': 1}, 'use ~/enable')):
        (success, reason), = client.set(drive, **values)
        assert not success
        assert words in reason
    (success, reason), = client.set(drive, atomic=True, flc1_ratio=50.0, motor_trip_class=5.0)
    assert not success
    assert 'one frame' in reason
    assert len(simulator.frames('^505#........0[1-9A-F]')) == before
    assert client.get(drive, 'flc1_ratio') == [33.0]

    client.diagnostics(status_of(namespace), state='^online$', level='^0$')
    assert not any('violation' in line for line in simulator.lines)
    assert bridge.end() == 0


def test_run_trip_and_reset(processes: Processes, client: Client, namespace: str,
                            tmp_path: Path) -> None:
    simulator, bridge, drive = started(processes, client, namespace, tmp_path)
    status = status_of(namespace)
    facts = client.diagnostics(status, state='^online$', nmt_state='^operational$')
    assert facts['emergency'] == 'none'

    assert client.control(f'{drive}/reset_fault')[0]
    success, message = client.control(f'{drive}/enable', True)
    assert success, message
    on_the_wire(simulator, 'C002002A01000000', 'C002002A00000000')
    client.bit(f'{drive}/system_status_1/on', True)
    client.bit(f'{drive}/system_status_1/motor_running', True)
    client.value(f'{drive}/average_current', 6.0, 6.6)
    client.value(f'{drive}/average_current_ratio', 70.0, 72.0)
    assert client.get(drive, 'l1_current') != [0.0]

    success, message = client.control(f'{drive}/enable', False)
    assert success, message
    client.bit(f'{drive}/system_status_1/on', False)
    client.value(f'{drive}/average_current', 0.0, 0.0)

    # a trip of the controller ends it; nothing but reset and enable starts the motor again
    assert client.control(f'{drive}/enable', True)[0]
    before = len(simulator.frames())
    simulator.write('pump trip')
    client.bit(f'{drive}/system_status_1/trip', True)
    client.bit(f'{drive}/system_status_1/on', False)
    facts = client.diagnostics(status, state='^fault$', emergency='FF00h')
    assert int(facts['level']) > 0
    assert client.get(drive, 'trip_code', 'trip_register_1') == [10, 1 << 9]
    success, message = client.control(f'{drive}/enable', True)
    assert not success
    assert 'reset it first' in message
    simulator.frame('^505#C00200[2A]A00000000 R', since=before)
    success, message = client.control(f'{drive}/reset_fault')
    assert success, message
    on_the_wire(simulator, 'C002002A08000000', 'C002002A00000000')
    client.bit(f'{drive}/system_status_1/trip', False)
    client.diagnostics(status, state='^online$', emergency='^none$', level='^0$')
    client.bit(f'{drive}/system_status_1/on', False)
    assert client.control(f'{drive}/enable', True)[0]

    # a stop of the bridge is told to the controller, and acknowledged
    assert bridge.end() == 0
    assert simulator.frames('^505#C00200[2A]A')[-1][12:] == '00000000 R'
    assert not any('violation' in line for line in simulator.lines)


def test_restart_of_the_device(processes: Processes, client: Client, namespace: str,
                               tmp_path: Path) -> None:
    simulator, bridge, drive = started(processes, client, namespace, tmp_path,
                                       missed_limit=100)
    assert client.control(f'{drive}/enable', True)[0]
    frames = len(simulator.frames())
    simulator.write('pump restart=0.5')
    bridge.error('pump: offline: .*restarted')
    boot = simulator.frame('^705#00 T', since=frames)
    assert boot == ['705#00 T']
    client.online(drive)
    client.diagnostics(status_of(namespace), state='^online$', nmt_state='^operational$')
    # it was started anew before anything else, and the motor is off
    later = simulator.frames(since=frames)
    after = later[later.index('705#00 T'):]
    first_answer = next(place for place, frame in enumerate(after) if frame.endswith(' T')
                        and frame.startswith('485#'))
    assert '000#0105 R' in after[:first_answer]
    client.bit(f'{drive}/system_status_1/on', False)
    assert not simulator.frames('^505#C00200[2A]A01000000', since=frames)
    assert client.control(f'{drive}/enable', True)[0]
    client.bit(f'{drive}/system_status_1/on', True)
    assert bridge.end() == 0


def test_device_without_power(processes: Processes, client: Client, namespace: str,
                              tmp_path: Path) -> None:
    simulator, bridge, drive = started(processes, client, namespace, tmp_path,
                                       heartbeat_timeout=3.0, missed_limit=1000)
    # it was online before its first heartbeat
    client.diagnostics(status_of(namespace), nmt_state='^operational$')
    simulator.write('pump off')
    client.online(drive, wanted=False)
    bridge.error('pump: offline: no heartbeat for 3 s')
    facts = client.diagnostics(status_of(namespace), state='^offline$')
    assert facts['level'] == '2'
    assert client.set(drive, flc1_ratio=40.0) == [(False, 'no answer; drive offline')]
    # looked for by NMT start, once a second
    simulator.frame('^000#0105 R', since=len(simulator.frames()), count=2)
    simulator.write('pump ok')
    client.online(drive)
    assert client.get(drive, 'flc1_ratio') == [33.0]
    assert bridge.end() == 0


def test_addressing_by_object(processes: Processes, client: Client, namespace: str,
                              tmp_path: Path) -> None:
    simulator, bridge, drive = started(
        processes, client, namespace, tmp_path, addressing='canopen', layout='word_be',
        word_order='low_first', request_cob_id=0x321, response_cob_id=0x432)
    assert client.set(drive, flc1_ratio=40.0) == [(True, '')]
    assert client.get(drive, 'flc1_ratio', 'p652') == [40.0, 40]
    assert client.control(f'{drive}/enable', True)[0]
    client.value(f'{drive}/average_current', 6.0, 6.6)
    requests = simulator.frames('^321#.* R$')
    # 455 and 456, 500 and 501, 652 := 40, 652, run forward; high bytes first
    for pattern in ('2004[3B]60600000000 R', '2004[3B]63300000000 R', '2007[3B]A0300280000 R',
                    '028C[2A]50000000000 R', '2008[3B]A0500010000 R'):
        assert simulator.frames(f'^321#{pattern}'), pattern
    # 630 = 0276h in the lower register
    simulator.frame('^432#2004[3B]63302760000 T')
    assert not simulator.frames('^(505|485)#')
    # by register only where a raw name said so
    assert {frame[8] for frame in requests if frame[8] in '2A'} <= {'2', 'A'}
    assert len([frame for frame in requests if frame[8] in '2A']) == 1
    assert bridge.end() == 0


# -- against literal bytes ------------------------------------------------------------------------

READ_455 = 't5058C7010025', 't5058C70100A5'
WITNESS = {**PUMP, 'cyclic_response': ['system_status_1']}


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

    def restart(self) -> None:
        """Begin anew after a loss of power."""
        self.function, self.operational = '00', False
        self.words.update(C701='4100', C002='0000')

    def connect(self, link: Path) -> Peer:
        """Stand behind an adapter."""
        registers = [*self.words, '0F27', '0000']
        keys = ['t00020105', *(f't5058{register}0' for register in registers)]
        return Peer(link, dict.fromkeys(keys, self))


def witnessed(processes: Processes, client: Client, namespace: str, directory: Path,
              controller: Controller, **options: Any) -> tuple[Peer, Process, str]:
    """Start a bridge that talks to the literal controller."""
    peer = controller.connect(directory / 'links' / 'main')
    file = bridge_file(directory, drives={'pump': {**WITNESS, **options}},
                       bus={'bitrate': 250_000})
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/pump'
    client.online(drive)
    return peer, bridge, drive


def test_bytes_of_the_manual(processes: Processes, client: Client, namespace: str,
                             tmp_path: Path) -> None:
    controller = Controller()
    peer, bridge, drive = witnessed(processes, client, namespace, tmp_path, controller)
    try:
        client.value(f'{drive}/system_status_1', 0x41, 0x41, kind='Int64')
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
        assert '06020000h' in bridge.error('pump: read p9999 ')
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
        known = ('t00020105', 't5058C701002', 't5058C70100A', 't50588C02002', 't50588C0200A',
                 't50580F27', 't5058C00200', 't5058000000',
                 *(f't5058{register}002' for register in IDENTITY),
                 *(f't5058{register}00A' for register in IDENTITY))
        frames = [line for line in peer.lines if line[:1] in ('t', 'T')]
        assert not [line for line in frames if not line.startswith(known)]
    finally:
        peer.close()


def test_rubbish_and_unasked_answers(processes: Processes, client: Client, namespace: str,
                                     tmp_path: Path) -> None:
    controller = Controller()
    peer, bridge, drive = witnessed(processes, client, namespace, tmp_path, controller)
    try:
        client.value(f'{drive}/system_status_1', 0x41, 0x41, kind='Int64')
        for line in ('t4858C7010025FFFF0000', 't4858C70100A5FFFF0000', 't4858C8010025FFFF0000',
                     't4854C7010025', 't4850', 't4858000000FFFFFFFFFF', 't70520000', 't7051FF',
                     't0858FFFF', 't0852FFFF', 't5858430316012001FF30', 't4868C7010025FFFF0000',
                     'T000004858C7010025FFFF0000', 't4858C701004E00000206',
                     't4858C70100CE00000206'):
            for _ in range(5):
                peer.send(line.encode() + b'\r')
        status = client.diagnostics(status_of(namespace), frames_rejected='[1-9]')
        assert status['state'] in ('online', 'offline')
        client.online(drive)
        client.value(f'{drive}/system_status_1', 0x41, 0x41, kind='Int64')
        assert client.values(f'{drive}/system_status_1')[-1] == 0x41
        # a busy machine may be too late for one answer, but never wrong
        wait_for(lambda: client.get(drive, 'flc1_ratio') == [33.0], 'flc1_ratio of 33')
        # a boot-up frame of a controller that lost its power
        controller.restart()
        peer.send(b't705100\r')
        bridge.error('pump: offline: .*restarted')
        client.online(drive)
        wait_for(lambda: client.get(drive, 'flc1_ratio') == [33.0], 'flc1_ratio of 33')
        assert bridge.end() == 0
    finally:
        peer.close()
