# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The simulated drive of CiA 402: objects, PDOs, states and modes, in literal frames and times."""

from typing import Any

import cia402_builders
from cia402_builders import BEGINNING, Servo
import pytest
from simulation_builders import RULES

from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.simulation.canopen.pdos import Checks
from drive_can_bridge.simulation.cia402 import SimulatedServoDrive
from drive_can_bridge.simulation.cia402_plant import Habits
from drive_can_bridge.simulation.motor import MotorPlant

# -- objects --------------------------------------------------------------------------------------


def test_objects_as_manuals_print_them() -> None:
    servo = Servo()
    assert servo.ask('605#4000100000000000') == ['585#4300100092010200']
    assert servo.ask('605#4041600000000000') == ['585#4B41600050020000']
    assert servo.ask('605#4061600000000000') == ['585#4F61600000000000']
    assert servo.ask('605#2F60600009000000') == ['585#6060600000000000']
    assert servo.ask('605#4061600000000000') == ['585#4F61600009000000']
    # by segments: a name, and back a number that would have fitted one frame
    assert servo.ask('605#4008100000000000') == ['585#410810001D000000']
    assert servo.ask('605#6000000000000000') == ['585#0073696D756C6174']
    assert servo.ask('605#6000000000000000') == ['585#8008100000000305']
    assert servo.ask('605#21FF600004000000') == ['585#60FF600000000000']
    assert servo.ask('605#07E803000000AAAA') == ['585#2000000000000000']
    assert servo.read(0x60FF) == 1000


@pytest.mark.parametrize(('request_', 'code'), [
    ('4000500000000000', 0x06020000), ('4099600700000000', 0x06090011),
    ('4010100100000000', None), ('2B41600006000000', 0x06010002),
    ('2F40600006000000', 0x06070013), ('2360600006000000', 0x06070012),
    ('2F60600005000000', 0x06090030), ('2310100100000000', 0x08000020),
    ('2310100273617665', 0x06090011), ('2F16100001000000', 0x06010002),
    ('4099600000000000', None), ('2F99600002000000', 0x06010002),
    ('A041600000000000', 0x05040001), ('6000000000000000', 0x05040001)])
def test_refuses_in_the_codes_of_cia_301(request_: str, code: int | None) -> None:
    servo = Servo()
    answer, = servo.ask(f'605#{request_}')
    assert (answer[4:6] == '80') is (code is not None)
    if code is not None:
        assert int.from_bytes(bytes.fromhex(answer[-8:]), 'little') == code


def test_a_segmented_write_that_does_not_fit_changes_nothing() -> None:
    servo = Servo()
    assert servo.ask('605#21FF600008000000') == ['585#60FF600000000000']
    assert servo.ask('605#00E8030000000000') == ['585#2000000000000000']
    assert servo.ask('605#1D00000000000000') == ['585#80FF600012000706']
    assert servo.read(0x60FF) == 0
    servo.ask('605#21FF600004000000')
    assert servo.ask('605#15E8030000000000') == ['585#80FF600000000305']
    servo.ask('605#21FF600004000000')
    assert servo.ask('605#0BE8030000000000') == ['585#80FF600013000706']


def test_keeps_what_was_stored_and_nothing_else() -> None:
    servo = Servo()
    servo.write(0x6081, 0, 1000, 4)
    servo.set_up(9)
    servo.write(0x1010, 1, 0x65766173, 4)
    servo.write(0x6083, 0, 77, 4)
    servo.drive.fault('restart', 1.0)
    assert servo.at(1.5) == ['705#00']
    assert servo.read(0x6081) == 1000
    assert servo.read(0x6083) != 77
    assert servo.read(0x1600, 2) == 0x60FF0020
    servo.drive.fault('forget', 2.0)
    servo.at(2.5)
    assert servo.read(0x1600, 0) == 1


def test_wants_a_plant_of_its_own() -> None:
    with pytest.raises(ConfigurationError, match='ServoPlant'):
        SimulatedServoDrive(cia402_builders.configuration(), plant=MotorPlant)


# -- PDOs -----------------------------------------------------------------------------------------


def test_a_mapping_is_changed_in_the_order_of_the_standard_only() -> None:
    servo = Servo()
    # valid: neither entries nor their number, nor another identifier
    assert servo.refused(0x1A00, 0, 0, 1) == 0x06010000
    assert servo.refused(0x1A00, 1, 0x60640020, 4) == 0x06010000
    assert servo.refused(0x1800, 1, 0x40000186, 4) == 0x06090030
    assert servo.read(0x1800, 1) == 0x40000185
    servo.write(0x1800, 1, 0xC0000185, 4)
    # entries only while their number is 0
    assert servo.refused(0x1A00, 1, 0x60640020, 4) == 0x06010000
    servo.write(0x1A00, 0, 0, 1)
    # codes of CANopenNode 4 (9b8beed)
    assert servo.refused(0x1A00, 1, 0x60640028, 4) == 0x06040041     # more than it has
    assert servo.refused(0x1A00, 1, 0x6064000C, 4) == 0x06040041     # one and a half bytes
    assert servo.refused(0x1A00, 1, 0x10180120, 4) == 0x06040041     # no process data
    assert servo.refused(0x1A00, 1, 0x50000010, 4) == 0x06020000     # does not exist
    assert servo.refused(0x1A00, 1, 0x60C10520, 4) == 0x06090011
    for place in (1, 2, 3):
        servo.write(0x1A00, place, 0x60640020, 4)
    assert servo.refused(0x1A00, 0, 3, 1) == 0x06040042
    assert servo.refused(0x1A00, 0, 9, 1) == 0x06040042
    servo.write(0x1A00, 0, 2, 1)
    servo.write(0x1800, 2, 1, 1)
    servo.write(0x1800, 1, 0x40000185, 4)
    assert servo.ask('000#0105') == []
    assert servo.ask('080#') == [f'185#{BEGINNING.to_bytes(4, "little").hex().upper() * 2}']


def test_fewer_bytes_than_an_object_has_are_taken() -> None:
    servo = Servo()
    servo.write(0x1800, 1, 0xC0000185, 4)
    servo.write(0x1A00, 0, 0, 1)
    servo.write(0x1A00, 1, 0x60640010, 4)
    servo.write(0x1A00, 0, 1, 1)
    servo.write(0x1800, 2, 1, 1)
    servo.write(0x1800, 1, 0x40000185, 4)
    servo.ask('000#0105')
    assert servo.ask('080#') == [f'185#{BEGINNING.to_bytes(2, "little").hex().upper()}']


@pytest.mark.parametrize(('checks', 'operational'), [
    (Checks.OPERATIONAL, False), (Checks.UNCHECKED, False), (Checks.UNCHECKED, True)])
def test_stacks_that_check_no_mapping(checks: Checks, operational: bool) -> None:
    """As Lely core 2.4 does while pre-operational, CanFestival 3 and durand 0.5 always."""
    servo = Servo(habits=Habits(mapping=checks))
    if operational:
        servo.ask('000#0105')
    # in no order, an object that does not exist, more bytes than it has; all is read back
    servo.write(0x1800, 2, 1, 1)
    servo.write(0x1800, 1, 0x40000285, 4)
    servo.write(0x1A00, 1, 0x50000010, 4)
    servo.write(0x1A00, 2, 0x60410020, 4)
    servo.write(0x1A00, 0, 2, 1)
    assert [servo.read(0x1A00, place) for place in range(3)] == [2, 0x50000010, 0x60410020]
    servo.write(0x1600, 0, 2, 1)
    servo.write(0x1600, 1, 0x50000010, 4)
    servo.write(0x1600, 2, 0x60400010, 4)
    servo.ask('000#0105')
    # what does not exist is 0 there, and has no effect
    assert servo.ask('080#') == ['285#000050020000']
    servo.ask('205#34120600')
    assert servo.read(0x6040) == 6


def test_lely_checks_while_operational() -> None:
    servo = Servo(habits=Habits(mapping=Checks.OPERATIONAL))
    servo.ask('000#0105')
    assert servo.refused(0x1800, 1, 0x40000285, 4) == 0x06090030
    assert servo.refused(0x1A00, 1, 0x60640020, 4) == 0x06010000


def test_a_start_that_takes_its_time() -> None:
    servo = Servo(habits=Habits(start=0.3))
    servo.ask('000#0105', 1.0)
    servo.ask('000#0105', 1.2)      # a second one does not delay it
    assert servo.node_state is NmtState.PRE_OPERATIONAL
    assert servo.drive.next_timer() == 1.3
    assert servo.at(1.3) == ['185#5002']
    assert servo.node_state is NmtState.OPERATIONAL
    servo.ask('000#8005', 2.0)
    servo.ask('000#0105', 2.1)
    servo.ask('000#8005', 2.2)      # taken back
    servo.at(3.0)
    assert servo.node_state is NmtState.PRE_OPERATIONAL


def test_objects_that_were_taken_away() -> None:
    servo = Servo()
    servo.drive.take_away([(0x605A, None), (0x1800, 5), (0x6072, None), (0x1017, None)])
    assert servo.ask('605#405A600000000000') == ['585#805A600000000206']
    assert servo.ask('605#2B5A600002000000') == ['585#805A600000000206']
    assert servo.ask('605#4000180500000000') == ['585#8000180500000206']
    assert servo.read(0x1800, 3) == 0
    servo.write(0x1400, 1, 0x80000205, 4)
    servo.write(0x1600, 0, 0, 1)
    assert servo.refused(0x1600, 1, 0x60720010, 4) == 0x06020000
    servo.drive.fault('restart', 1.0)
    assert servo.at(1.5) == ['705#00']
    assert servo.at(9.0) == [], 'no heartbeat, and nothing to switch it on'
    assert servo.ask('605#2B17100064000000') == ['585#8017100000000206']


def test_without_6007h_a_lost_master_is_told_and_the_axis_moves_on() -> None:
    """As Lely core 2.4 (620d185) was seen to do: 8130h, register 11h, never taken back."""
    servo = Servo()
    servo.drive.take_away([(0x6007, None)])
    servo.set_up(9)
    servo.write(0x1016, 1, 0x7F0064, 4)
    servo.enable()
    servo.target = 10_000
    servo.ask('77F#05')
    servo.run(0.09)
    told = servo.at(servo.now + 0.02)
    assert '085#3081110000000000' in told
    status, _ = servo.run(1.0)
    assert status & 0x6F == 0x27
    assert servo.speed == pytest.approx(1.0)


def test_an_rpdo_of_type_1_counts_from_the_sync_on() -> None:
    servo = Servo().set_up(9)
    assert servo.ask('205#060000000000') == []
    assert servo.read(0x6040) == 0
    answer, = servo.ask('080#')
    assert answer.startswith('185#3102')
    assert servo.read(0x6040) == 6


def test_an_rpdo_that_is_too_short_is_ignored() -> None:
    servo = Servo().set_up(9)
    assert servo.ask('205#0600') == servo.ask('080#')[1:] == []
    assert servo.read(0x6040) == 0
    assert list(servo.drive.violations.values()) == [1]


def test_tpdos_by_event_and_timer() -> None:
    servo = Servo()
    # the status word is in TPDO1 from the factory, on change
    assert servo.ask('000#0105') == ['185#5002']
    assert servo.ask('205#0600', 0.1) == ['185#3102']
    assert servo.at(0.2) == []
    servo.ask('000#8005')
    servo.write(0x1800, 1, 0xC0000185, 4)
    servo.write(0x1800, 3, 50, 2)
    servo.write(0x1800, 1, 0x40000185, 4)
    servo.write(0x1800, 5, 20, 2)
    assert servo.ask('000#0105') == ['185#3102']
    # not before 5 ms have passed, and else every 20 ms
    assert servo.ask('205#0700', 0.201) == []
    assert servo.drive.next_timer() == pytest.approx(0.205)
    assert servo.at(servo.drive.next_timer()) == ['185#3302']
    assert servo.drive.next_timer() == pytest.approx(0.225)
    assert servo.at(servo.drive.next_timer()) == ['185#3302']
    # PDOs stop with the node
    servo.ask('000#8005')
    assert servo.at(0.3) == []
    assert servo.ask('205#0600') == []


def test_a_second_node_with_its_number_is_seen() -> None:
    servo = Servo()
    servo.ask('705#05')
    servo.ask('185#5002')
    assert servo.drive.violations == {RULES['alone']: 2}


# -- states ---------------------------------------------------------------------------------------


def test_walks_one_state_at_a_time() -> None:
    servo = Servo().set_up(9)
    for word, state in (
            (0x0F, 0x40), (0x07, 0x40), (0x06, 0x21), (0x0F, 0x23), (0x0F, 0x27), (0x07, 0x23),
            (0x06, 0x21), (0x07, 0x23), (0x00, 0x40), (0x06, 0x21), (0x02, 0x40)):
        servo.word = word
        status, _ = servo.cycle()
        assert status & (0x4F if state == 0x40 else 0x6F) == state, f'{word:02X}'


def test_a_fault_is_reset_by_a_rising_edge_once_its_cause_is_gone() -> None:
    servo = Servo().set_up(9)
    servo.target = 100_000
    servo.enable()
    servo.run(0.5)
    servo.drive.fault('trip=1', servo.now)
    # 10 rev/s by the quick-stop ramp of 250 rev/s²: 40 ms in fault reaction active
    assert servo.sent() == ['085#1023030000000000']
    assert servo.cycle()[0] & 0x4F == 0x0F
    assert servo.run(0.1)[0] & 0x4F == 0x08
    assert (servo.read(0x603F), servo.read(0x1001), servo.speed) == (0x2310, 3, 0.0)
    servo.word = 0x80
    assert servo.run(0.1)[0] & 0x4F == 0x08
    servo.word = 0
    servo.run(1.0)
    servo.word = 0x80
    assert servo.cycle()[0] & 0x4F == 0x40
    assert servo.read(0x603F) == 0
    servo.word = 0
    servo.cycle()
    servo.enable()


def test_sto_low_lets_no_torque_be() -> None:
    servo = Servo()
    servo.drive.fault('sto', 0.0)
    assert servo.drive.faults_text == 'sto'
    servo.set_up(9)
    for word in (6, 7, 0x0F):
        servo.word = word
        assert servo.run(0.05)[0] == 0x0240         # no voltage: bit 4
    assert servo.read(0x60FD) & 8 == 0
    servo.drive.fault('ok', servo.now)
    assert servo.cycle()[0] == 0x0250
    servo.target = 10_000
    servo.enable()
    servo.run(0.5)
    assert servo.speed == 1.0
    # and at speed: it coasts
    servo.drive.fault('sto', servo.now)
    assert servo.cycle()[0] & 0x4F == 0x40
    assert 0.5 < servo.speed < 1.0


# -- modes ----------------------------------------------------------------------------------------


def test_a_step_in_csp_is_a_fault() -> None:
    servo = Servo().set_up(8)
    servo.target = 0
    servo.write(0x6065, 0, 5000, 4)
    servo.enable()
    assert servo.run(0.1)[0] & 0x4F == 0x0F
    assert servo.run(0.2)[0] & 0x4F == 0x08
    assert servo.read(0x603F) == 0x8611
    # it went for it: whoever enables with a wrong target moves the axis
    assert servo.read(0x6064) != BEGINNING


def test_pp_takes_targets_by_bit_4() -> None:
    servo = Servo().set_up(1)
    servo.target = 50_000
    servo.enable()
    assert servo.run(0.5) == (0x0637, BEGINNING)
    servo.word |= 0x10
    assert servo.cycle()[0] & 0x1000
    # acknowledged until bit 4 falls; the next one counts at once
    servo.word &= ~0x10
    assert not servo.cycle()[0] & 0x1000
    servo.target = 40_000
    servo.word |= 0x10
    assert max(servo.cycle()[1] for _ in range(200)) < 45_000
    assert servo.run(1.0) == (0x1637, 40_000)
    # halt
    servo.word &= ~0x10
    servo.cycle()
    servo.target, servo.word = 90_000, servo.word | 0x10
    servo.run(0.2)
    servo.word |= 0x100
    where = servo.run(0.5)[1]
    assert servo.run(0.5) == (servo.cycle()[0], where)
    servo.word &= ~0x100
    assert servo.run(2.0)[1] == 90_000


@pytest.mark.parametrize(('method', 'status', 'position'), [
    (35, 0x1637, 0), (37, 0x1637, 0), (17, 0x1637, 0), (33, 0x1637, 0), (0, 0x2237, BEGINNING)])
def test_homing(method: int, status: int, position: int) -> None:
    servo = Servo().set_up(6)
    servo.write(0x6098, 0, method, 1)
    servo.enable()
    assert servo.run(0.5) == (0x0237, BEGINNING)            # not by itself
    servo.word |= 0x10
    assert servo.run(3.0) == (status, position)
    assert servo.speed == 0.0


# -- ways out, told by the motor ------------------------------------------------------------------


def running(mode: int = 9, **options: Any) -> Servo:
    """Return a drive at 10 revolutions per second."""
    servo = Servo(**options).set_up(mode)
    servo.write(0x6084, 0, 100_000, 4)          # 10 rev/s²: 1 s
    servo.target = 100_000
    servo.enable()
    servo.run(1.0)
    assert servo.speed == 10.0
    return servo


@pytest.mark.parametrize('mode', [9, 3])
def test_disable_operation_brakes_by_ramp_and_shutdown_coasts(mode: int) -> None:
    servo = running(mode)
    servo.word = 0x07
    # 605Ch = 1: enabled until it stands
    assert servo.run(0.5)[0] & 0x6F == 0x27
    assert servo.speed == pytest.approx(5.0, abs=0.2)
    assert servo.run(0.6)[0] & 0x6F == 0x23
    assert servo.speed == 0.0
    servo = running(mode)
    servo.word = 0x06
    # 605Bh = 0: no torque at once; 12.5 rev/s² are those of friction
    assert servo.cycle()[0] & 0x6F == 0x21
    servo.run(0.5)
    assert servo.speed == pytest.approx(10.0 - 0.5 * 12.5, abs=0.3)
    assert servo.read(0x6077) == 0


@pytest.mark.parametrize(('option', 'seconds', 'state'), [
    (0, 0.0, 0x40), (1, 1.0, 0x40), (2, 0.04, 0x40), (3, 0.01, 0x40), (5, 1.0, 0x07),
    (6, 0.04, 0x07), (7, 0.01, 0x07)])
def test_quick_stop(option: int, seconds: float, state: int) -> None:
    servo = running()
    servo.write(0x605A, 0, option, 2)
    servo.word = 0x02
    status, began = servo.cycle()
    if not option:
        assert status & 0x4F == 0x40
        assert servo.speed > 9.0
        return
    if seconds > 0.03:
        assert status & 0x6F == 0x07
        assert not status & 0x400
    status, end = servo.run(seconds + 0.02)
    assert (status & (0x4F if state == 0x40 else 0x6F), servo.speed) == (state, 0.0)
    assert bool(status & 0x400) is (state == 0x07)
    assert end - began == pytest.approx(100_000 * seconds / 2, abs=1100)
    # 0006h is no way out of it
    servo.word = 0x06
    assert servo.cycle()[0] & 0x6F == (0x07 if state == 0x07 else 0x21)
    servo.word = 0x0F
    assert servo.cycle()[0] & 0x6F == (0x27 if state == 0x07 else 0x23)


def test_some_drives_leave_quick_stop_by_0000h_only() -> None:
    servo = Servo(habits=Habits(leaves_quick_stop=False, stand_bit=False)).set_up(9)
    servo.write(0x605A, 0, 6, 2)
    servo.enable()
    servo.word = 0x02
    assert servo.run(0.1)[0] == 0x0217
    servo.word = 0x0F
    assert servo.cycle()[0] == 0x0217
    servo.word = 0x00
    assert servo.cycle()[0] & 0x4F == 0x40


def watched(option: int, **options: Any) -> Servo:
    """Return a drive at speed that watches node 127 for 600 ms, and has heard it once."""
    servo = running(**options)
    servo.write(0x6007, 0, option, 2)
    servo.write(0x1016, 1, 0x007F0258, 4)
    # nobody is missed who was never heard
    servo.run(1.0)
    assert servo.speed == 10.0
    assert servo.ask('77F#05') == []
    return servo


@pytest.mark.parametrize(('option', 'state', 'speed'), [
    (0, 0x27, 10.0), (1, 0x08, 0.0), (2, 0x40, 5.0), (3, 0x40, 0.0)])
def test_the_bridge_is_missed(option: int, state: int, speed: float) -> None:
    servo = watched(option)
    heard = servo.now
    servo.run(0.59)
    assert servo.speed == 10.0
    assert servo.drive.next_timer() <= heard + 0.6
    sent = servo.at(heard + 0.6)
    assert (sent == ['085#3081110000000000']) is (option == 1)
    status, _ = servo.run(0.4)
    assert status & (0x6F if state == 0x27 else 0x4F) == state
    assert servo.speed == pytest.approx(speed, abs=0.2)
    assert servo.read(0x603F) == (0x8130 if option == 1 else 0)
    assert servo.drive.take_notices()[-1] == 'axis: no heartbeat of node 127'


def test_the_node_stopped_is_a_lost_connection() -> None:
    servo = running()
    servo.ask('000#0205')
    assert servo.drive.plant.operation.faulted
