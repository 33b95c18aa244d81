# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A model that was told what bridges tell, with fixed times and values."""

from collections.abc import Sequence
import math
from typing import Any

from drive_can_bridge.core.parameters import ValueKind
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import Place, Snapshot, Status
from drive_can_bridge.monitor.values import ParameterInfo

#: the time at which golden pages are looked at: a steady clock, and 12:34:56 UTC
NOW, AT = 1000.0, 1_700_051_696.0
BRIDGE = '/drive_can_bridge'
NOT_ARMED = 'not armed: publish 0 to /lift/command/speed_setpoint'
SILENT = ('not seen since start: no answer to mapping read: drive silent, wrong station, bit rate '
          'or identifier mode; check its power, cable, station number and bit rate')

#: what a bridge says of a drive when it takes its leave
ENDED: dict[str, Any] = {'level': 3, 'state': 'offline', 'code': 'bridge_ended',
                         'message': 'bridge ended: start it again'}
ENDED_IN_DOUBT: dict[str, Any] = {
    'level': 2, 'state': 'offline', 'code': 'bridge_ended_may_run',
    'message': 'bridge ended: it may still be running'}


def info(name: str, unit: str = '', kind: str = 'int16', scale: str = '1.0', **facts: str,
         ) -> ParameterInfo:
    """Make what a descriptor says."""
    double = bool(unit) or scale != '1.0'
    limits = (-3000.0, 3000.0) if facts.get('access') == 'rw' and double else (None, None)
    return ParameterInfo(
        name, ValueKind.DOUBLE if double else ValueKind.INTEGER,
        facts.get('access', 'ro') == 'ro', f'Description of {name}', *limits,
        {'unit': unit, 'type': kind, 'scale': scale, **facts})


SPEED = info('speed_setpoint', 'rpm', scale='0.1', access='rw', role='cyclic', number='50')
LIMIT = info('torque_limit', '%', 'uint16', '0.1', access='rw', role='cyclic', number='51')
PARAMETERS = (
    SPEED, LIMIT,
    info('actual_speed', 'rpm', scale='0.1', role='cyclic', number='209'),
    info('motor_current', 'A', scale='0.01', role='cyclic', number='210'),
    info('status_word', kind='uint16', role='cyclic', number='211'),
    info('ramp_time', 's', 'uint16', '0.01', access='rw', storage='eeprom', number='30'),
    info('user_command', kind='uint16', access='wo', number='99'))


def drive_status(name: str = 'conveyor', *, bridge: str = 'drive_can_bridge', level: int = 0,
                 state: str = 'online', message: str = 'online', **facts: str) -> Status:
    """Make what a bridge says about a drive."""
    return Status(f'{bridge}: drive {name}', level, message, {
        'state': state, 'exchanges': '12345', 'missed_exchanges': '3',
        'latency_mean_ms': '0.512', 'latency_p99_ms': '2.134', 'latency_max_ms': '9.876',
        'period_error_mean_ms': '0.012', 'period_error_p99_ms': '0.156',
        'period_error_max_ms': '4.321', 'command_age_s': '0.020', 'commands_refused': '0',
        'frames_rejected': '0', 'parameter_requests_ok': '25', 'parameter_requests_failed': '1',
        'last_parameter_error': 'read ramp_time (P30): no answer in 0.1 s, 3 attempts', **facts})


def bus_status(name: str = 'main', *, bridge: str = 'drive_can_bridge', level: int = 0,
               message: str = 'socketcan can0', **facts: str) -> Status:
    """Make what a bridge says about a bus."""
    return Status(f'{bridge}: bus {name}', level, message, {
        'state': 'up', 'load_percent': '36.4', 'frames_sent': '1500', 'frames_received': '1498',
        'frames_rejected': '0', 'error_frames': '0', 'bus_off_count': '0', 'reconnections': '0',
        'send_failures': '0', **facts})


def counted(status: Status, ago: float) -> Status:
    """Return the same some seconds before, at 50 exchanges and 156 frames a second."""
    rates = {'exchanges': 50, 'frames_sent': 156, 'frames_received': 156}
    return Status(status.name, status.level, status.message, {
        key: str(int(value) - int(rates[key] * ago)) if key in rates and int(value) else value
        for key, value in status.facts.items()})


def model_of(statuses: Sequence[Status], namespace: str = '') -> Model:
    """Make a model that has heard of bridges for some seconds, until :data:`NOW`."""
    model = Model(namespace)
    for ago in (2.0, 1.0, 0.0):
        model.diagnosed([counted(status, ago) for status in statuses], AT - ago, NOW - ago)
    return model


def feed(model: Model, drive: str, *, speed: float = 900.0) -> None:
    """Let a drive move for half a minute."""
    model.described(drive, PARAMETERS)
    for step in range(120):
        ago = 0.25 * (119 - step)
        wave = math.sin(step / 10)
        model.requested(drive, [('speed_setpoint', speed * wave), ('torque_limit', 100.0)],
                        NOW - ago)
        model.responded(drive, [('actual_speed', 0.99 * speed * wave), ('motor_current', 2.44),
                                ('status_word', 3)], NOW - ago)


def three_drives() -> Model:
    """Make a bridge with a drive that moves, one that is not armed, and one that is silent."""
    model = model_of([
        bus_status(), drive_status(),
        drive_status('lift', level=1, state='not armed', message=NOT_ARMED,
                     control_state='enabled'),
        drive_status('turntable', level=3, state='offline', message=SILENT, exchanges='0',
                     missed_exchanges='0', **dict.fromkeys(
                         [f'{name}_{kind}_ms' for name in ('latency', 'period_error')
                          for kind in ('mean', 'p99', 'max')], 'nan'))])
    feed(model, '/conveyor')
    feed(model, '/lift', speed=0.0)
    for name, station in (('conveyor', '1'), ('lift', '2'), ('turntable', '3')):
        model.placed(f'/{name}', Place('main', station, 'datamodel_extended', 0.02))
    for bit, state in (('ready', True), ('enabled', True), ('fault', False), ('warning', False)):
        model.bit('/conveyor', 'status_word', bit, state)
    model.read('/conveyor', [('ramp_time', 1.5), ('speed_setpoint', -12.34),
                             ('motor_current', None)], NOW - 3.0)
    for ago, level, text in (
            (30.0, 'INFO', 'bus main: open'), (29.0, 'INFO', 'conveyor: online'),
            (28.0, 'INFO', 'lift: online'),
            (2.0, 'WARN', 'conveyor: frame rejected: cyclic response that nobody asked for; it '
             'came from station 1, whose last request had been answered already (and 2 more '
             'like it)')):
        model.logged(AT - ago, level, 'drive_can_bridge', text)
    return model


def many_drives(count: int = 40) -> Model:
    """Make a bridge with many drives, half of them with the same trouble."""
    model = model_of([bus_status(), *(
        drive_status(f'axis_{number}', **({} if number % 2 else {
            'level': 2, 'state': 'offline', 'message': 'offline: 3 responses missed'}))
        for number in range(count))])
    for number in range(count):
        feed(model, f'/axis_{number}')
    return model


def fifteen_drives() -> Model:
    """Make a bridge with two dead drives, one that was never seen, four unarmed, and others."""
    lost = 'silent since 12:33:{:02}, was online before: check its power and its cable'
    states = {'axis_3': ('fault', 2, 'fault 7 overcurrent: remove its cause, then reset it'),
              'axis_8': ('offline', 2, lost.format(8)), 'axis_13': ('offline', 2, lost.format(13)),
              'axis_14': ('offline', 3, SILENT)}
    for number in (1, 4, 6, 7):
        states[f'axis_{number}'] = ('not armed', 1, 'not armed: publish 0 to '
                                    f'/axis_{number}/command/speed_setpoint')
    for number in (2, 5):
        states[f'axis_{number}'] = ('disabled', 0, f'disabled: call ~/enable (drive_can enable '
                                                   f'axis_{number})')
    model = model_of([bus_status(), *(
        drive_status(name, level=level, state=state, message=message)
        for name, (state, level, message) in (
            (f'axis_{number}', states.get(f'axis_{number}', ('online', 0, 'online')))
            for number in range(15)))])
    for number in range(15):
        feed(model, f'/axis_{number}')
    return model


def seen(model: Model) -> Snapshot:
    """Look at the time of the golden pages."""
    return model.look(NOW, AT)
