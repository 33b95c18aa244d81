# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which CAN adapters this host has, as far as that shows without opening one.

python-can's interfaces are asked each in a thread of its own, because makers' libraries may not
come back, and only those that list devices without opening them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
import os
from typing import Any

import can
import can.interfaces

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.text import printable
from drive_can_bridge.transport.adapters import detected, quiet
from drive_can_bridge.transport.kernel_interfaces import kernel_interfaces, KernelInterface
from drive_can_bridge.transport.known_adapters import row_of_port
from drive_can_bridge.transport.usb_serial import latency_timer, serial_ports, usb_device

#: s that all libraries together have
PATIENCE = 5.0
#: interfaces that are not asked: found here, found by everybody everywhere, or by opening a device
NOT_ASKED = frozenset((
    'socketcan', 'serial', 'slcan', 'seeedstudio', 'robotell', 'virtual', 'udp_multicast',
    'cantact'))
#: keys that select one of several devices
_WHICH = ('host', 'port', 'serial', 'unique_hardware_id', 'app_name', 'device', 'index')
#: a timer that no period of ours minds, in s
_SHORT = 0.002


@dataclass(frozen=True)
class FoundAdapter:
    """
    An adapter that was found.

    :param what: it is, in words.
    :param options: further keys of the file.
    :param adapter: its row of docs/adapters.md; '': that does not show.
    :param state: of an interface of the kernel: ``up``, ``down``, and that of its controller.
    :param bitrate: that is set; 0: not known.
    :param latency: s that the host's driver keeps what it has received; None: not known.
    :param remarks: what to do, or to know.
    """

    interface: str
    channel: str | int
    what: str
    options: dict[str, Any] = field(default_factory=dict)
    adapter: str = ''
    state: str = ''
    bitrate: int = 0
    latency: float | None = None
    remarks: list[str] = field(default_factory=list)


def of_host() -> Iterator[FoundAdapter]:
    """Yield the kernel's adapters: CAN interfaces, and serial ports."""
    for each in kernel_interfaces():
        yield _of_kernel(each)
    for port in serial_ports():
        yield _of_port(port)


def _of_kernel(each: KernelInterface) -> FoundAdapter:
    state = ' '.join(filter(None, ('up' if each.up else 'down', each.state if each.up else '')))
    rate = f'{each.bitrate} bit/s' if each.bitrate else 'no bit rate'
    kinds = {'can': 'a CAN controller', 'vcan': 'virtual, no hardware', 'vxcan': 'a tunnel'}
    parts = [state, *([rate] if each.kind == 'can' else []), kinds.get(each.kind, each.kind)]
    remarks: list[str] = [] if each.up else [bus_sentences.switch_on(each.how_up)]
    return FoundAdapter('socketcan', each.name, ', '.join(filter(None, parts)),
                        {'bitrate': each.bitrate} if each.bitrate else {}, 'socketcan', state,
                        each.bitrate, remarks=remarks)


def _of_port(port: str) -> FoundAdapter:
    usb, row, timer = usb_device(port), row_of_port(port), latency_timer(port)
    named = [] if usb is None else list(filter(None, (usb.maker, usb.product)))
    what = ' '.join(named) or 'a serial port'
    if usb is not None:
        what += f', USB {usb.number}'
        what += f', serial number {usb.serial}' if usb.serial else ''
    remarks: list[str] = []
    if row is None:
        remarks.append(bus_sentences.behind_port_unknown())
    if timer is not None and timer.seconds > _SHORT:
        remarks.append(bus_sentences.port_keeps(1e3 * timer.seconds, timer.remedy))
    if os.path.exists(port) and not os.access(port, os.R_OK | os.W_OK):
        remarks.append(bus_sentences.port_not_allowed())
    return FoundAdapter('slcan' if row is None else row.interface, port, what,
                        adapter='' if row is None else row.name,
                        latency=None if timer is None else timer.seconds, remarks=remarks)


def ask_libraries(clock: Clock, interfaces: Callable[[], Any] = lambda: can.interfaces.BACKENDS,
                  ) -> tuple[list[FoundAdapter], list[str]]:
    """Return what vendors' libraries find, and the interfaces whose library has not returned."""
    answers: dict[str, list[FoundAdapter] | None] = {}
    asked, workers = [], []
    for name in sorted(set(interfaces()) - NOT_ASKED):
        answers[name] = None
        done = clock.wake_event()
        asked.append((name, done))

        def ask(name: str = name, done: Any = done) -> None:
            try:
                answers[name] = list(_found_by(name))
            except Exception:   # noqa: BLE001  a library that is not there, in whatever words
                answers[name] = []
            done.ring()
        workers.append(clock.worker(ask, f'adapters {name}'))
    with quiet():
        for worker in workers:
            worker.start()
        until = clock.now() + PATIENCE
        for _, done in asked:
            done.wait(until)
    return ([each for name, _ in asked for each in answers[name] or ()],
            [name for name, _ in asked if answers[name] is None])


def _found_by(interface: str) -> Iterator[FoundAdapter]:
    for each in detected(interface):
        options = {key: each[key] for key in _WHICH if isinstance(each.get(key), (int, str))}
        channel = each.get('channel', 0)
        names = [str(each[key]) for key in ('device_name', 'vector_channel_config', 'device_type')
                 if isinstance(each.get(key), str)]
        yield FoundAdapter(interface,
                           channel if isinstance(channel, int) else printable(str(channel)),
                           printable(' '.join(names)) or 'found by its library', options,
                           interface)
