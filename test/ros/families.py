# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the contract of the ROS side has to know about each protocol family: one row of facts.

Every row describes the same drive as far as its protocol lets it: a speed, an integer and a bool
each way, a status word, a setting in EEPROM. Numbers and words are those of the profile texts.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Any

#: s
PERIOD = 0.05
#: keys of diagnostics that every bus has
BUS_KEYS = {
    'state', 'code', 'load_percent', 'frames_sent', 'frames_received', 'frames_rejected',
    'error_frames', 'bus_off_count', 'reconnections', 'send_failures'}
#: that every drive has
KEYS = {
    'state', 'code', 'exchanges', 'missed_exchanges', 'latency_mean_ms', 'latency_p99_ms',
    'latency_max_ms', 'period_error_mean_ms', 'period_error_p99_ms', 'period_error_max_ms',
    'command_age_s', 'commands_refused', 'frames_rejected', 'late_answers',
    'parameter_requests_ok', 'parameter_requests_failed', 'last_parameter_error'}
#: of an adapter that keeps frames; with a control word; section ``fault``; a broadcast group
SOMETIMES = {'adapter_latency_ms', 'control_state', 'fault_code', 'broadcast'}
SAME_EVERYWHERE = """
  ramp_time:
    {number: 102, type: uint16, scale: 0.01, unit: s, access: rw, storage: eeprom, minimum: 0.01,
     maximum: 60, description: Ramp}
  gain: {number: 110, type: uint16, access: rw, storage: ram, description: Gain}
  damping: {number: 111, type: int16, access: rw, storage: ram}
  flag: {number: 112, type: bool, access: rw, storage: ram}
  order: {number: 114, type: uint16, access: wo, storage: ram}
  far_away: {number: 120, type: uint16, access: rw, storage: ram}
  actual_ramp: {number: 130, type: uint16, scale: 0.5, offset: -10, access: ro}
"""
#: process data with addresses of their own
NUMBERED = """
  speed_setpoint:
    {number: 150, type: int16, scale: 0.1, unit: rpm, access: rw, storage: ram, minimum: -3000,
     maximum: 3000, neutral: 0, description: Speed reference}
  mode: {number: 151, type: uint16, access: rw, storage: ram, maximum: 9}
  brake: {number: 152, type: bool, access: rw, storage: ram}
  control_word: {number: 153, type: uint16, access: rw, storage: ram}
  actual_speed: {number: 209, type: int16, scale: 0.1, unit: rpm, access: ro}
  counts: {number: 210, type: uint16, access: ro}
  braked: {number: 211, type: bool, access: ro}
  status_word:
    {number: 212, type: uint16, access: ro, bits: {ready: 0, enabled: 1, fault: 3}}
"""
CONTROL = """
control:
  parameter: control_word
  words: {disable: 0, enable: 1, quick_stop: 4, reset_fault: 8}
  status:
    {parameter: status_word, ready: [1, 1], enabled: [2, 2], fault: [8, 8]}
"""
#: the same as words that exist in process data only
UNNUMBERED = """
  speed_setpoint:
    {type: int16, scale: 0.1, unit: rpm, access: rw, minimum: -3000, maximum: 3000, neutral: 0,
     description: Speed reference}
  mode: {type: uint16, access: rw, maximum: 9}
  brake: {type: bool, access: rw}
  actual_speed: {type: int16, scale: 0.1, unit: rpm, access: ro}
  counts: {type: uint16, access: ro}
  braked: {type: bool, access: ro}
"""
CANNORD_BITS = (
    'ready_to_switch_on', 'ready', 'enabled', 'fault', 'voltage_enabled', 'no_quick_stop',
    'switch_on_disabled', 'warning', 'setpoint_reached', 'bus_control', 'bit_10',
    'rotating_right', 'rotating_left', 'bit_13')


@dataclass(frozen=True)
class Facts:
    """
    One family.

    :param profile: parameters beside those that all have.
    :param keys: of the drive, beside those that all have.
    :param more: the parameters that all have, as the family addresses them.
    :param address: raw name -> address as messages print it.
    :param status_mapped: the status word takes a place in ``cyclic_response``.
    :param word: the built-in control word of an enabled drive.
    :param states: of the control services: enabled, disabled.
    :param raw: raw name -> (a parameter that it reaches, what it reads with ``SETTINGS`` there);
        one at least of ramp_time, gain, damping and flag.
    :param no_names: look like raw names and are none here.
    :param absent: a raw name that the drive does not have, and what reading or writing it says.
    :param stuck: the reason when a write has no effect; '' where an acknowledgement is believed.
    :param order_note: what is said after writing what cannot be read back.
    :param atomic: parameters that fit one frame.
    :param scattered: parameters that do not, and what is said then.
    :param diagnostics: keys beyond those of every drive.
    :param missed_limit: for a drive that is to be noticed soon when it is missing.
    """

    protocol: str
    profile: str
    keys: dict[str, Any] = field(default_factory=dict)
    more: str = SAME_EVERYWHERE
    address: Callable[[str], str] = str.upper
    status_mapped: bool = True
    word: int | None = None
    bits: tuple[str, ...] = ('ready', 'enabled', 'fault')
    states: tuple[str, str] = ('enabled', 'ready')
    raw: dict[str, tuple[str, int]] = field(default_factory=dict)
    no_names: tuple[str, ...] = ()
    absent: tuple[str, str] = ('', '')
    stuck: str = ''
    order_note: str = ''
    atomic: dict[str, Any] = field(default_factory=dict)
    scattered: dict[str, Any] = field(default_factory=dict)
    scattered_reason: str = ''
    diagnostics: frozenset[str] = frozenset()
    missed_limit: int = 20

    def raw_name(self, name: str) -> str:
        """Return the raw name that reaches a parameter."""
        return next(raw for raw, (reached, _) in self.raw.items() if reached == name)

    def address_of(self, name: str) -> str:
        """Return the address of a parameter as messages print it."""
        return self.address(self.raw_name(name))

    @property
    def hasty(self) -> dict[str, Any]:
        """Keys of a drive that tells soon when something is missing, but not a busy machine."""
        return {'missed_limit': self.missed_limit, 'parameter_timeout': 0.2}

    @property
    def response(self) -> list[str]:
        """Parameters of ``~/response``, in order."""
        return [*(['status_word'] if self.status_mapped else []), 'actual_speed', 'counts',
                'braked']

    @property
    def listed(self) -> list[str]:
        """Names of the profile."""
        return re.findall(r'^  ([a-z_]+):', self.table, re.MULTILINE)

    @property
    def table(self) -> str:
        """The ``parameters`` of the profile."""
        return self.profile.partition('control:')[0] + self.more

    def write_profile(self, directory: Path) -> Path:
        """Write the profile file."""
        head, control, rest = self.profile.partition('control:')
        path = directory / f'{self.protocol}.yaml'
        path.write_text(f'protocols: [{self.protocol}]\nparameters:{head}{self.more}'
                        f'{control}{rest}', encoding='utf-8')
        return path

    def drive(self, directory: Path, **keys: Any) -> dict[str, Any]:
        """Return the drive's section of a parameter file."""
        return {
            'bus': 'main', 'protocol': self.protocol, 'station': 1,
            'profile': str(self.write_profile(directory)), 'period': PERIOD,
            'cyclic_request': ['speed_setpoint', 'mode', 'brake'],
            'cyclic_response': self.response,
            # generous: nothing may depend on how busy the machine is
            'command_timeout': 60.0, 'missed_limit': 100, 'parameter_timeout': 2.0,
            'control_timeout': 30.0, **self.keys, **keys}


CANNORD_MORE = """
  wide: {number: 600, type: int32, access: rw, storage: ram}
  position: {number: 613, subindex: 1, type: uint16, access: rw, storage: ram}
"""
PKW_MORE = """
  wide: {number: 600, type: int32, access: rw, storage: ram}
  ratio: {number: 652, index: 0x2007, subindex: 0x03, type: uint16, access: rw, storage: eeprom}
"""
#: the same as objects of CiA 402 in mode vl
OBJECTS = """
  speed_setpoint:
    {index: 0x6042, type: int16, scale: 0.1, unit: rpm, access: rw, storage: ram, minimum: -3000,
     maximum: 3000, neutral: 0, description: Speed reference}
  mode: {index: 0x2151, type: uint16, access: rw, storage: ram, maximum: 9}
  brake: {index: 0x2152, type: bool, access: rw, storage: ram}
  actual_speed: {index: 0x6044, type: int16, scale: 0.1, unit: rpm, access: ro}
  counts: {index: 0x2210, type: uint16, access: ro}
  braked: {index: 0x2211, type: bool, access: ro}
  wide: {index: 0x2600, type: int32, access: rw, storage: ram}
"""
OBJECTS_EVERYWHERE = re.sub(r'number: (\d)', r'index: 0x2\1', SAME_EVERYWHERE)
SERVO_BITS = (
    'ready_to_switch_on', 'switched_on', 'enabled', 'fault', 'voltage_enabled', 'no_quick_stop',
    'switch_on_disabled', 'warning', 'bit_8', 'remote', 'target_reached', 'internal_limit',
    'bit_12', 'bit_13', 'bit_14', 'bit_15')
UNACKNOWLEDGED = 'sent; this protocol does not acknowledge writes'
NO_ANSWER = 'no answer in 0.2 s, 3 attempts'
RAW = {'p102': ('ramp_time', 150), 'p110': ('gain', 7), 'p111': ('damping', 0x10000 - 5),
       'p112': ('flag', 1)}
#: values that the tests put into the drives
SETTINGS: dict[str, Any] = {
    'ramp_time': 1.5, 'gain': 7, 'damping': -5, 'flag': True, 'far_away': 11,
    'actual_ramp': 4.5, 'wide': -100_000, 'position': 12, 'ratio': 33}

FAMILIES = [
    Facts(
        'datamodel_extended', NUMBERED + CONTROL, raw=RAW,
        keys={'cyclic_request': ['speed_setpoint', 'mode', 'brake', 'control_word']},
        no_names=('p110.1', 'x2007.3', 'p70000'), absent=('p115', NO_ANSWER),
        stuck='read back 7 instead of 9', order_note=UNACKNOWLEDGED,
        atomic={'gain': 3, 'damping': -3, 'flag': False}, scattered={'gain': 4, 'far_away': 4},
        scattered_reason='consecutive', diagnostics=frozenset(['short_frames'])),
    Facts(
        'datamodel_standard', NUMBERED + CONTROL, raw=RAW,
        no_names=('p110.1', 'x2007.3', 'p70000'), absent=('p115', NO_ANSWER),
        stuck='read back 7 instead of 9', order_note=UNACKNOWLEDGED,
        atomic={'gain': 3}, scattered={'gain': 4, 'damping': 4},
        scattered_reason='one parameter fits', diagnostics=frozenset(['short_frames']),
        missed_limit=10),
    Facts(
        'cannord', UNNUMBERED + CANNORD_MORE, status_mapped=False, bits=CANNORD_BITS,
        keys={'cyclic_response': ['actual_speed', 'counts', 'braked']},
        states=('operation enabled', 'ready to switch on'), word=0x047F,
        raw={**RAW, 'p600': ('wide', (1 << 32) - 100_000), 'p613.1': ('position', 12)},
        no_names=('x2007.3', 'p2048', 'p110.256'),
        absent=('p115', 'refused by the drive: error 0: invalid parameter number'),
        stuck='read back 7 instead of 9', atomic={'gain': 3},
        scattered={'gain': 4, 'damping': 4}, scattered_reason='carries one parameter'),
    Facts(
        'canopen_pkw', NUMBERED + PKW_MORE + CONTROL, keys={'period': 0.1},
        raw={**RAW, 'p652': ('ratio', 33), 'x2007.3': ('ratio', 33)},
        no_names=('p110.1', 'p70000', 'x2007'),
        absent=('p115', 'refused by the drive: 06020000h (no such register or object)'),
        atomic={'gain': 3, 'damping': -3}, scattered={'gain': 4, 'far_away': 4},
        scattered_reason='adjacent', diagnostics=frozenset(['nmt_state', 'emergency']),
        missed_limit=6),
    Facts(
        'cia402', OBJECTS, status_mapped=False, bits=SERVO_BITS, more=OBJECTS_EVERYWHERE,
        keys={'cyclic_response': ['actual_speed', 'counts', 'braked'], 'mode': 'vl',
              'request_pdos': [1, 2], 'response_pdos': [1, 2]},
        address=lambda name: f'{name[1:5].upper()}h.{int(name[6:], 16):02X}h',
        states=('operation enabled', 'ready to switch on'), word=0x007F,
        raw={'x2102.0': ('ramp_time', 150), 'x2110.0': ('gain', 7),
             'x2111.0': ('damping', 0x10000 - 5), 'x2112.0': ('flag', 1),
             'x2600.0': ('wide', (1 << 32) - 100_000)},
        no_names=('p110', 'p110.1', 'x2007'),
        absent=('x2115.0', 'refused by the drive: 06020000h (no such register or object)'),
        atomic={'gain': 3}, scattered={'gain': 4, 'damping': 4},
        scattered_reason='carries one object',
        diagnostics=frozenset(['nmt_state', 'emergency', 'stops_by'])),
]
