# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""CAN interfaces of the kernel, by what a kernel (6.1) has answered: ``links.hex``."""

from pathlib import Path

from pytest import MonkeyPatch

from drive_can_bridge.transport import kernel_interfaces
from drive_can_bridge.transport.kernel_interfaces import KernelInterface, parsed, why_lost

#: its messages: lo, vcan0, can0 (slcan at 125 kbit/s, up), and the end
LINKS = [bytes.fromhex(line) for line in Path(__file__).with_name('links.hex').read_text().split()]
VCAN = KernelInterface('vcan0', 2, True, 'vcan')
CAN = KernelInterface('can0', 3, True, 'can', 125000, 'error-active')


def test_what_a_kernel_has_answered() -> None:
    assert parsed(b''.join(LINKS[:-1])) == ([VCAN, CAN], True)
    assert parsed(LINKS[-1]) == ([], False)


def test_what_is_torn_is_no_interface() -> None:
    """The kernel does not do that."""
    whole = LINKS[2]
    for length in range(len(whole)):
        parsed(whole[:length])
    assert parsed(bytes(40)) == ([], False)


def test_the_kernel_is_asked() -> None:
    """Whatever this one has: no exception."""
    assert all(each.name for each in kernel_interfaces.kernel_interfaces())


def test_one_without_a_bit_rate_needs_one() -> None:
    assert CAN._replace(bitrate=0).how_up == 'ip link set can0 up type can bitrate 500000'
    assert CAN.how_up == 'ip link set can0 up' and VCAN.how_up == 'ip link set vcan0 up'


def test_what_has_become_of_one(monkeypatch: MonkeyPatch) -> None:
    """As user-mode Linux 6.1 shows it: down, renamed, deleted."""
    monkeypatch.setattr(kernel_interfaces, 'has_can', lambda: False)

    def shows(*interfaces: KernelInterface) -> None:
        monkeypatch.setattr(kernel_interfaces, 'kernel_interfaces', lambda: list(interfaces))
        monkeypatch.setattr(kernel_interfaces, 'index_of', {
            each.name: each.number for each in interfaces}.get)
        monkeypatch.setattr(kernel_interfaces, 'name_of', lambda index: {
            each.number: each.name for each in interfaces}.get(index, ''))
    shows()
    assert why_lost('can0', 0) == ''    # the kernel has no CAN, which its error says
    monkeypatch.setattr(kernel_interfaces, 'has_can', lambda: True)
    shows(CAN, VCAN)
    assert why_lost('can0', 3) == ''
    shows(CAN._replace(up=False), VCAN)
    assert why_lost('can0', 3) == 'interface can0 is down: ip link set can0 up'
    shows(CAN._replace(name='left'), VCAN)
    assert why_lost('can0', 3) == (
        'interface can0 is called left now: write it as channel, or "ip link set left down", '
        '"ip link set left name can0"')
    shows(VCAN)
    assert why_lost('can0', 3) == 'interface can0 is gone: unplugged, or deleted'
    assert why_lost('can0', 0) == 'there is no interface can0; CAN interfaces here: vcan0'
    shows()
    assert why_lost('can0', 0) == 'there is no interface can0; CAN interfaces here: none'
