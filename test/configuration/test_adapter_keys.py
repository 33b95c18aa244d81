# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What python-can's adapters know, found without opening one."""

import can.interfaces
import pytest
from saying import says

from drive_can_bridge.transport.adapters import (
    adapter_keywords, check_bitrate, check_channel, check_interface, missing_keywords,
)
from drive_can_bridge.transport.known_adapters import ROWS, what_helps


def test_keywords_of_an_adapter() -> None:
    found = adapter_keywords('slcan')
    assert found is not None
    # named by the class, by what it inherits from
    assert {'sleep_after_open', 'bitrate', 'can_filters', 'channel'} <= found
    assert not {'self', 'kwargs', 'bitrat'} & found


def test_interfaces_that_every_linux_has() -> None:
    for interface in ('virtual', 'socketcan', 'slcan'):
        assert check_interface(interface) is None
        assert adapter_keywords(interface) is not None


def test_unknown_interface() -> None:
    assert check_interface('slcam') == says(
        'no_interface', name='slcam', hint=says('did_you_mean', word='slcan'))
    found = check_interface('zzzzzz')
    assert found == says('no_interface', name='zzzzzz', hint=says('allowed'))
    assert found.fields['hint'].fields['words'].startswith('canalystii, ')
    assert adapter_keywords('zzzzzz') is None
    assert check_bitrate('zzzzzz', 5) is None


def test_driver_that_cannot_be_imported(monkeypatch: pytest.MonkeyPatch,
                                        capfd: pytest.CaptureFixture[str]) -> None:
    backends = {**can.interfaces.BACKENDS, 'own': ('no_such_module', 'Bus'),
                'odd': ('math', 'Bus')}
    monkeypatch.setattr(can.interfaces, 'BACKENDS', backends)
    for interface, why in (('own', "No module named 'no_such_module'"),
                           ('odd', "module 'math' has no attribute 'Bus'")):
        assert check_interface(interface) == says('driver_missing', interface=interface, why=why)
    assert adapter_keywords('own') is None
    assert capfd.readouterr() == ('', '')


def test_serial_adapter_without_pyserial(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('can.interfaces.slcan.serial', None)
    why = 'Python module pyserial'
    assert check_interface('slcan') == says(
        'driver_missing', interface='slcan', why=why, helps='pip install pyserial')


@pytest.mark.parametrize(('interface', 'helps'), [
    ('canalystii', 'pip install canalystii'), ('gs_usb', 'pip install gs_usb'),
    ('ixxat', "IXXAT's driver for SocketCAN: socketcan"),
    ('usb2can', "the kernel's driver usb_8dev: socketcan"),
    ('sontheim', 'pip install python-can-sontheim'),
    ('wuensche', 'pip install python-can-wuensche')])
def test_a_missing_driver_is_told_with_what_helps(
        interface: str, helps: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Plug-ins of python-can, too, which are no interfaces before they are installed."""
    monkeypatch.setattr(can.interfaces, 'BACKENDS', {
        name: ('no_such_module', 'Bus') for name in can.interfaces.BACKENDS
        if name not in ('sontheim', 'wuensche')})
    assert str(check_interface(interface)).endswith(f'allowed is one that is installed: {helps}')


def test_what_helps_of_every_interface_with_a_row() -> None:
    """Nothing is in back-ticks, and nothing that is none helps."""
    for row in ROWS:
        helps = what_helps(row.interface)
        assert '`' not in helps and not helps.startswith('none')
    assert what_helps('neousys') == what_helps('zzzzzz') == ''


def test_bit_rates() -> None:
    assert check_bitrate('slcan', 125000) is None
    assert check_bitrate('slcan', 800000) is None     # CiA 301, LAWICEL's manual
    assert check_bitrate('virtual', 123456) is None
    found = check_bitrate('slcan', 123456)
    assert found == says('no_bitrate', bitrate=123456, interface='slcan')
    assert found.fields['allowed'].startswith('10000, 20000, ')


@pytest.mark.parametrize('interface', ['slcan', 'robotell', 'seeedstudio', 'serial'])
def test_channels_of_serial_interfaces(interface: str) -> None:
    for good in ('/dev/ttyACM0', '/dev/ttyACM0@115200', 'COM3', 'can0', 'socket://host:7000',
                 'RFC2217://host:7000'):
        assert check_channel(interface, good) is None, good
    # URLs of pyserial: this one overwrites a file
    for bad in ('spy:///dev/ttyACM0?file=/etc/passwd', 'loop://', 'alt:///dev/ttyS0',
                'hwgrep://.*', 'file:///dev/ttyS0', 'xsocket://host:1', 0):
        assert check_channel(interface, bad) == says('no_serial_port', channel=bad)


@pytest.mark.parametrize(('interface', 'channel'), [
    ('socketcan', 'can0'), ('pcan', 'PCAN_USBBUS1'), ('kvaser', 0), ('virtual', 'a://b')])
def test_channels_of_others_are_theirs(interface: str, channel: str | int) -> None:
    assert check_channel(interface, channel) is None


def test_keys_without_which_there_is_no_adapter() -> None:
    assert missing_keywords('socketcand', {'port': 29536}) == ['host']
    assert missing_keywords('socketcand', {'host': '10.0.0.5', 'port': 29536}) == []
    assert missing_keywords('slcan', ()) == []
    assert missing_keywords('zzzzzz', ()) == []


@pytest.mark.usefixtures('programs')
def test_every_adapter_can_be_looked_at() -> None:
    for interface in can.interfaces.BACKENDS:
        missing = check_interface(interface)
        assert missing is None or interface in missing
        assert adapter_keywords(interface) is None or 'channel' in (
            adapter_keywords(interface) or ()) or missing is None
