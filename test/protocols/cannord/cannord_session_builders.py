# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Frames of station 1 (002 and 003, 202 and 203), and the way to its first exchange."""

from typing import Any

from builders import drive, EEPROM, INT16, INT32, parameter, RAM, RO
from conversation import Conversation

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.cannord.states import InverterState

PERCENT = 100 / 16384

FREQUENCY = parameter('frequency_setpoint', None, type=INT16, scale=50 / 16384, unit='Hz',
                      minimum=-50.0, maximum=50.0)
SECOND = parameter('setpoint_2', None, type=INT16, scale=PERCENT, unit='%')
THIRD = parameter('setpoint_3', None, type=INT16, scale=PERCENT, unit='%')
FOURTH = parameter('setpoint_4', None, type=INT16, scale=PERCENT, unit='%')
FIFTH = parameter('setpoint_5', None, type=INT16, scale=PERCENT, unit='%')
ACTUAL = parameter('actual_frequency', None, type=INT16, scale=50 / 16384, unit='Hz', access=RO)
CURRENT = parameter('current', None, type=INT16, scale=PERCENT, unit='%', access=RO)
INPUTS = parameter('digital_inputs', None, access=RO)
VALUE_4 = parameter('actual_4', None, type=INT16, access=RO)
VALUE_5 = parameter('actual_5', None, type=INT16, access=RO)

ACCELERATION = parameter('acceleration_time', 102, scale=0.01, unit='s', storage=EEPROM)
ACCELERATION_2 = parameter('acceleration_time_2', 102, subindex=1, scale=0.01, unit='s',
                           storage=RAM)
OFFSET = parameter('offset', 411, type=INT16)
POSITION = parameter('position', 613, type=INT32, subindex=0x15, storage=EEPROM)
COUNTER = parameter('counter', 714, type=ParameterType.UINT32, storage=RAM)
FAULT_NUMBER = parameter('fault_number', 700, subindex=0, access=RO)
FLAG = parameter('flag', 120, type=ParameterType.BOOL, storage=RAM)
MONITORING = parameter('telegram_timeout', 513, type=INT16, scale=0.1, unit='s', storage=EEPROM)

SETPOINTS = (FREQUENCY, SECOND, THIRD, FOURTH, FIFTH)
VALUES = (ACTUAL, CURRENT, INPUTS, VALUE_4, VALUE_5)
PARAMETERS = (ACCELERATION, ACCELERATION_2, OFFSET, POSITION, COUNTER, FAULT_NUMBER, FLAG)

#: the state that most things end in, by its name
STANDING = InverterState.READY_TO_SWITCH_ON.value
READY_FRAME = '002#7E040000'
#: ready to switch on, standing still
READY = '003#310B0000'
#: operation enabled, standing still; the same at 50 %
ENABLED = '003#370B0000'
RUNNING = '003#370F0020'
FAULT = '003#380B0000'
#: more than what sums of periods are wrong by
TICK = 1e-6


def inverter(**options: Any) -> DriveConfiguration:
    """Configure a drive with one setpoint and one actual value, unless told otherwise."""
    return drive('cannord', **{'request': (FREQUENCY,), 'response': (ACTUAL,), 'table': (
        *SETPOINTS, *VALUES, *PARAMETERS), **options})


def started(**options: Any) -> Conversation:
    """Return a conversation whose first cycle is due at 10 s."""
    talk = Conversation(inverter(**options))
    assert talk.begins() == []
    assert talk.session.next_timer() == 10.0
    return talk


def online(answer: str = READY, **options: Any) -> Conversation:
    """Return a conversation with an inverter that answered its first cycle at 10.002 s."""
    talk = started(**options)
    assert talk.at(10.0)
    talk.hears(answer, 10.002)
    assert talk.session.online
    talk.events()
    return talk


def enabled(ready: str = READY, **options: Any) -> Conversation:
    """
    Return a conversation with an inverter that said "operation enabled" at 10.022 s.

    It is not armed. The next cycle is due at 10.04 s.

    :param ready: its first answer, which also says how long its answers are.
    """
    talk = online(ready, **options)
    assert talk.asks(ControlAction.ENABLE, 10.003) == []
    (_, request), *_ = talk.until(10.02 + TICK)
    assert request.startswith('002#7F04')
    talk.hears(f'003#370B{ready[8:]}', 10.022)
    assert talk.control_outcomes() == [('enable', True, 'operation enabled')]
    talk.events()
    return talk


def commanded(hertz: float, **options: Any) -> Conversation:
    """Return a conversation with an enabled inverter that was commanded 0 and then this."""
    talk = enabled(**options)
    assert talk.commands(0, 0.0, 10.023) is CommandOutcome.ARMED
    assert talk.commands(0, hertz, 10.024) is CommandOutcome.ACCEPTED
    return talk


def exchange(talk: Conversation, now: float, answer: str = READY) -> str:
    """Let one cycle pass at ``now``; return its request. Nothing else may be sent."""
    (_, request), = talk.until(now + TICK)
    assert talk.hears(answer, now + 0.002) == []
    return request
