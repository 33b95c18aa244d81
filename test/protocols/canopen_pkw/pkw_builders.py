# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Registers, frames and conversations of node 5, in candump's notation."""

from collections.abc import Callable
from typing import Any

from builders import drive, INT32, parameter, RAM, RO, WO
from conversation import Conversation

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.core.setpoints import CommandOutcome

UINT32 = ParameterType.UINT32

STATUS = parameter('system_status_1', 455, index=0x2004, subindex=0x06, access=RO)
STATUS_2 = parameter('system_status_2', 456, index=0x2004, subindex=0x07, access=RO)
LEVEL = parameter('thermal_level', 465, index=0x2004, subindex=0x10, access=RO, unit='%')
RATIO = parameter('current_ratio', 466, index=0x2004, subindex=0x11, access=RO, unit='%')
CURRENT = parameter('average_current', 500, index=0x2004, subindex=0x33, access=RO, type=UINT32,
                    scale=0.01, unit='A')
CLASS = parameter('trip_class', 606, index=0x2006, subindex=0x07)
FLC = parameter('full_load_current', 652, index=0x2007, subindex=0x03, minimum=5.0,
                maximum=100.0, unit='%')
FLC_2 = parameter('full_load_current_2', 653, index=0x2007, subindex=0x04, unit='%')
WORD = parameter('control_register_1', 704, index=0x2008, subindex=0x05, storage=RAM)
WORD_2 = parameter('control_register_2', 705, index=0x2008, subindex=0x06, storage=RAM)
SPEED = parameter('speed', 710, index=0x2008, subindex=0x0B, storage=RAM, scale=0.1, unit='Hz',
                  minimum=0.0, maximum=500.0)
TORQUE = parameter('torque', 712, index=0x2008, subindex=0x0D, storage=RAM)
POSITION = parameter('position', 720, index=0x2008, subindex=0x15, storage=RAM, type=INT32)
KEY = parameter('key', 730, index=0x2008, subindex=0x1F, access=WO)
TABLE = (STATUS, STATUS_2, LEVEL, RATIO, CURRENT, CLASS, FLC, FLC_2, WORD, WORD_2, SPEED, TORQUE,
         POSITION, KEY)

CONTROL = ControlTable(
    parameter='control_register_1', disable=0x0000, enable=0x0001, reset_fault=0x0008,
    status_parameter='system_status_1', ready=StatusPattern(0x0001, 0x0001),
    enabled=StatusPattern(0x0080, 0x0080), fault=StatusPattern(0x0004, 0x0004))

START = '000#0105'
BOOT_UP = '705#00'
OPERATIONAL = '705#05'
PRE_OPERATIONAL = '705#7F'
STOPPED = '705#04'
IDLE = '505#0000000000000000'
IDLE_ANSWER = '485#0000000000000000'
#: read of 455 and 456, toggle 1 and 0, and what the device says: ready, controller power; nothing
READ_1 = '505#C70100A600000000'
READ_0 = '505#C701002600000000'
ANSWER_1 = '485#C70100A641000000'
ANSWER_0 = '485#C701002641000000'
#: the same of a tripped device
TRIPPED_1 = '485#C70100A644000000'
TRIPPED_0 = '485#C701002644000000'
#: the same of a motor that runs: ready, on, controller power, running
RUNS_1 = '485#C70100A6C3200000'
RUNS_0 = '485#C7010026C3200000'
#: 704 = 0
DISABLE_0 = '505#C002002A00000000'
DISABLE_1 = '505#C00200AA00000000'
DISABLED_0 = '485#C002002A00000000'
DISABLED_1 = '485#C00200AA00000000'
#: 704 = 1
ENABLE_0 = '505#C002002A01000000'
ENABLE_1 = '505#C00200AA01000000'
ENABLED_0 = '485#C002002A00000000'
ENABLED_1 = '485#C00200AA00000000'
#: 710 = 100
SPEED_0 = '505#C602002A64000000'
SPEED_1 = '505#C60200AA64000000'
STILL_0 = '505#C602002A00000000'
STILL_1 = '505#C60200AA00000000'


def configuration(**options: Any) -> DriveConfiguration:
    """Make node 5 with two status registers in the round."""
    return drive('canopen_pkw', **{
        'station': 5, 'table': TABLE, 'request': (), 'response': (STATUS, STATUS_2),
        'parameter_timeout': 0.5, **options})


def started(**options: Any) -> Conversation:
    """Return a conversation whose first round is due at 10.05 s."""
    talk = Conversation(configuration(**options))
    assert talk.begins() == ([START] if options.get('nmt_start', True) else [])
    return talk


def reading(**options: Any) -> tuple[Conversation, list[str]]:
    """Return a conversation in its first round, and the read that it sent at 10.051 s."""
    talk = started(**options)
    assert talk.at(10.05) == [IDLE]
    return talk, talk.hears(IDLE_ANSWER, 10.051)


def online(**options: Any) -> Conversation:
    """
    Return a conversation with a device that answered its first round at 10.053 s.

    Control word and setpoints, if any, are written. The next round is due at 10.07 s; without any
    it begins with toggle 0.
    """
    talk = started(**options)
    begin = 10.05 if options.get('nmt_start', True) else 10.0
    assert talk.at(begin) == [IDLE]
    assert talk.hears(IDLE_ANSWER, begin + 0.001) == [READ_1]
    sent = talk.hears(ANSWER_1, begin + 0.002)
    assert talk.session.online
    assert {text[12:] for text in answered(talk, sent, begin + 0.003)} <= {'00000000'}
    talk.events()
    return talk


def ready(**options: Any) -> Conversation:
    """Return a drive that is online, disabled and ready; the last read had toggle 1."""
    options.setdefault('control', CONTROL)
    talk = online(**options)
    assert talk.until(10.0701) == [(10.07, READ_1)]
    assert talk.hears(ANSWER_1, 10.071) == []
    return talk


def running(**options: Any) -> Conversation:
    """Return a drive that was enabled; the last read had toggle 1."""
    talk = ready(**options)
    assert talk.asks(ControlAction.ENABLE, 10.075) == [ENABLE_0]
    assert talk.hears(ENABLED_0, 10.076) == []
    assert talk.until(10.0901) == [(10.09, READ_1)]
    assert talk.hears(RUNS_1, 10.091) == []
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    talk.events()
    return talk


def echo(text: str, status: str = 'C320') -> str:
    """Return the device's answer to a request; what it reads is the status register."""
    reply = text.replace('505#', '485#')
    return f'{reply[:12]}{status}0000' if text[10:12] in ('26', 'A6') else reply[:12] + '00000000'


def denied(text: str, code: str = '22000008') -> str:
    """Return how the device refuses a request: 0800 0022h, not in its present state."""
    return f'485#{text[4:10]}{"CE" if text[10] in "8A" else "4E"}{code}'


def answered(talk: Conversation, sent: list[str], now: float, status: str = '4100') -> list[str]:
    """Let the device answer from ``now`` on until nothing more is sent; return what was sent."""
    found = []
    while sent:
        text, = sent
        found.append(text)
        sent = talk.hears(echo(text, status), now)
        now += 0.0005
    return found


def commanding(talk: Conversation, index: int, value: float) -> Callable[[float], list[str]]:
    """Return a step of a timeline: a command."""
    def step(now: float) -> list[str]:
        talk.commands(index, value, now)
        return []
    return step


def driven(request: tuple[Parameter, ...] = (SPEED,), **options: Any) -> Conversation:
    """Return a drive that was enabled and runs at 10 Hz; the next round is due at 10.13 s."""
    options.setdefault('control', CONTROL)
    talk = online(request=request, **options)
    answered(talk, talk.at(10.07), 10.071)
    *neutral, enable = answered(talk, talk.asks(ControlAction.ENABLE, 10.075), 10.0755)
    assert [text[12:] for text in neutral] == ['00000000'] * len(request)
    assert enable in (ENABLE_0, ENABLE_1)
    answered(talk, talk.at(10.09), 10.091, 'C320')
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.commands(0, 0.0, 10.095) is CommandOutcome.ARMED
    assert talk.commands(0, 10.0, 10.095) is CommandOutcome.ACCEPTED
    assert answered(talk, talk.at(10.11), 10.111, 'C320')[0] in (SPEED_0, SPEED_1)
    talk.events()
    return talk
