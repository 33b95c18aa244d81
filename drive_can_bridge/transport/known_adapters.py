# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
CAN adapters that people own: the rows from which docs/adapters.md and ``validate`` are made.

``docs/adapters.py`` writes the page in a checkout; a test compares it.
"""

from dataclasses import dataclass

from drive_can_bridge.core.adapter import AdapterTraits, Dropped
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.frame import Route
from drive_can_bridge.transport.bus_identity import device_of
from drive_can_bridge.transport.usb_serial import latency_timer, port_name, usb_device

#: how a row was tried, in the letters of :data:`TRIED`
REAL, BYTES, PARSER, SOURCE = 'R', 'B', 'F', 'S'
TRIED = {
    REAL: 'real drivers and daemons in CI',
    BYTES: "python-can's code, 4.3.1 and 4.6.1, over bytes in tests",
    PARSER: 'the same, against the parser of the firmware',
    SOURCE: "by the source of python-can 4.3.1 and 4.6.1, never with its maker's library"}


@dataclass(frozen=True, slots=True)
class Row:
    """
    One adapter, or one interface of python-can.

    :param name: its name in the key ``adapter`` of a bus.
    :param title: what people call it.
    :param interface: of python-can.
    :param channel: an example.
    :param options: further keys of the example.
    :param differs: what it does otherwise, in words.
    :param cure: which setting helps.
    :param instead: what else does, also where its driver is missing.
    :param tried: how this is known: a letter of :data:`TRIED`, or words.
    :param usb: how the USB device begins to name itself: number, then product.
    :param uart: a real serial line is behind the port, whose speed counts.
    :param line_bits: bits on that line for each bit on the bus.
    :param latency: s that it may keep what it has received, whatever the host shows.
    :param listen_only: what makes it listen only.
    :param drops: what it never sends.
    :param module: of Python, as pip calls it, without which there is no such interface.
    """

    name: str
    title: str
    interface: str
    channel: str | int
    differs: str
    cure: str
    tried: str
    options: tuple[tuple[str, object], ...] = ()
    usb: tuple[str, ...] = ()
    uart: bool = False
    line_bits: float = 1.7
    latency: float = 0.0
    listen_only: str = ''
    drops: tuple[Dropped, ...] = ()
    module: str = ''
    instead: str = ''

    @property
    def helps(self) -> str:
        """What to do where its driver is missing, in plain text; '': nothing is known."""
        if self.module:
            return f'pip install {self.module}'
        helps = (self.instead or self.cure).replace('`', '')
        return '' if helps.startswith('none ') else helps


ROWS: tuple[Row, ...] = (
    # -- the kernel
    Row('socketcan', 'a CAN controller of Linux: on the board, PCI, SPI', 'socketcan', 'can0',
        "bit rate and restart are the interface's, not the file's (another bit rate there is a "
        "warning); stamps are the host's; what was sent waits in the kernel until a node "
        'acknowledges it; goes bus-off for good unless set to restart',
        '`ip link set can0 type can bitrate 500000 restart-ms 100`, `ip link set can0 up`',
        f'{REAL}: vcan, SJA1000 (emulated), the slcan driver',
        listen_only='"ip link set can0 type can listen-only on"'),
    Row('candlelight', 'candleLight, CANable with candleLight, CANtact, gs_usb devices, by the '
        'kernel', 'socketcan', 'can0',
        'the kernel has its driver (gs_usb): the device is a network interface by itself',
        'as for any interface of the kernel; better than `gs_usb`',
        'the driver by its source (Linux 6.1)',
        listen_only='"ip link set can0 type can listen-only on"'),
    Row('virtual_kernel', 'vcan: no hardware', 'socketcan', 'vcan0', 'no bit rate, no arbitration',
        '`ip link add vcan0 type vcan`, `ip link set vcan0 up`', REAL),
    # -- serial lines with text
    Row('slcan', 'any adapter with SLCAN (LAWICEL) commands', 'slcan', '/dev/ttyACM0',
        'answers, rates and limits are those of its firmware, below; stamps of its own clock, or '
        'none; it may still send what it had been handed when the bridge ends; S7 is 800 kbit/s, '
        'or 750 kbit/s (CANable 1 and 2)',
        '`adapter:` with the name of its row, where there is one', PARSER,
        listen_only='listen_only: true', module='pyserial'),
    Row('canable', 'CANable 1 with slcan firmware', 'slcan', '/dev/ttyACM0',
        'answers nothing at all: a refused bit rate or a full queue is not heard; an empty line '
        'carries out the line before again (the bridge never sends one); no command L: with '
        '`listen_only` it does not open',
        'candleLight firmware makes it a network interface', f'{PARSER} (canable-fw 8ca5d39)',
        usb=('ad50:60c4',)),
    Row('canable2', 'CANable 2 with slcan firmware', 'slcan', '/dev/ttyACM0',
        'as CANable 1', 'candleLight firmware (fork for it) makes it a network interface',
        f'{PARSER} (canable2-fw b158aa7)', usb=('16d0:117e',)),
    Row('canable25', 'CANable with firmware 2.5 (slcan)', 'slcan', '/dev/ttyACM0',
        'answers each command but C; no command L: with `listen_only` it does not open',
        'candleLight firmware makes it a network interface', f'{PARSER} (ElmueSoft 3c94657)'),
    Row('weact', 'WeAct USB2CANFDV1', 'slcan', '/dev/ttyACM0',
        'answers each command, and an empty line by a refusal (BEL), which is no fault',
        'none is needed', f'{PARSER} (by its source)', listen_only='listen_only: true'),
    Row('usbtin', 'USBtin', 'slcan', '/dev/ttyACM0',
        'answers each command; lines of 99 characters at most; a whole line that lacks its end is '
        'sent at the next start', 'none is needed', f'{PARSER} (firmware 1.4)',
        usb=('04d8:000a',), listen_only='listen_only: true'),
    Row('lawicel', 'LAWICEL CANUSB', 'slcan', '/dev/ttyUSB0',
        'answers each command; FTDI chip: received bytes wait up to 16 ms',
        'latency timer to 1 ms: `echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/'
        'latency_timer`, for good by a udev rule', f'{PARSER} (by its manual)',
        usb=('0403:ffa8',), latency=0.016, listen_only='listen_only: true'),
    Row('vscom', 'VSCOM USB-CAN Plus', 'slcan', '/dev/ttyUSB0',
        'FTDI chip: received bytes wait up to 16 ms; echoes what it sends in some of its modes',
        'latency timer to 1 ms, as for LAWICEL; echo off in its set-up', 'untested',
        usb=('0403:6015 USB-CAN',), latency=0.016, listen_only='listen_only: true'),
    Row('esp32_slcan', 'ESP32-SLCAN', 'slcan', '/dev/ttyUSB0@500000',
        'says yes, and never sends: identifier 0 (NMT), frames without data (SYNC), 29-bit '
        'identifiers; digits a to f in lower case are read as 0; no rates under 100 kbit/s; a '
        'real serial line of 500 kbaud', 'another adapter for CANopen and for 29-bit drives; '
        '`@500000` in `channel`', f'{PARSER} (mintynet f1f6b22)',
        options=(('adapter', 'esp32_slcan'),), uart=True,
        drops=(Dropped('NMT (identifier 000h)', Route.of(0)),
               Dropped('SYNC (no data)', Route.of(0x80)),
               Dropped('29-bit identifiers', Route(0, 0, True)))),
    Row('slcan_tcp', 'SLCAN over TCP: ser2net, ESP8266 and ESP32 bridges', 'slcan',
        'socket://10.0.0.5:7000',
        'a second client may be let in by the other end; what is lost on the way is heard only '
        'when the connection ends', '`TCP_NODELAY` is set; a cable rather than radio',
        f'{BYTES}, through a connection', listen_only='listen_only: true'),
    # -- serial lines with packets
    Row('seeedstudio', 'Seeed USB-CAN Analyzer', 'seeedstudio', '/dev/ttyUSB0',
        'acknowledges nothing and says nothing of errors; receives one kind of identifier only; '
        'receive waits 0.1 s whatever is asked; a torn packet is one rejected frame; unplugged, '
        'it is recognised by the name that is gone',
        '`frame_type: EXT` for 29-bit drives; `timeout: 0.01`', BYTES,
        options=(('frame_type', 'STD'),), uart=True, line_bits=1.2,
        listen_only='operation_mode: silent', module='pyserial'),
    Row('robotell', 'Robotell USB-CAN, and the like', 'robotell', '/dev/ttyUSB0',
        'keeps its bit rate; acknowledges settings only', 'none is needed', BYTES,
        uart=True, line_bits=1.6, module='pyserial'),
    Row('serial', "python-can's own format over a serial line: Arduino sketches", 'serial',
        '/dev/ttyUSB0', "bit rate and listen-only are the other end's; has no check sum; before "
        '4.6 python-can takes every identifier for one of 29 bits',
        '`baudrate:` as the other end has it; python-can 4.6 for 11-bit drives', BYTES,
        uart=True, line_bits=1.3, module='pyserial'),
    Row('bluetooth', 'serial ports over Bluetooth', 'slcan', '/dev/rfcomm0',
        'answers come in bursts, tens of ms late', 'a cable; else a `period` of 0.1 and more',
        'untested', latency=0.05),
    # -- the network
    Row('socketcand', 'socketcand: a CAN interface of another computer', 'socketcand', 'can0',
        'stamps of the other computer; no more of an error than its class; a gateway that ends is '
        'reported; the bridge speaks its protocol itself, since python-can waits without a limit',
        '`tcp_tune: true` is the default (without it every second frame is 40 ms late)',
        'the protocol by the source of socketcand 6dd5d33; fakes of it, and one over TCP at speed '
        '(bench)', options=(('host', '10.0.0.5'), ('port', 29536))),
    Row('udp_multicast', 'frames in UDP multicast: no hardware', 'udp_multicast', '239.74.163.2',
        'no acknowledgement; frames may be lost or doubled; needs the module msgpack; own frames '
        'are recognised by the address', 'only to try things; never for a motor', SOURCE,
        module='msgpack'),
    Row('virtual', 'inside one process: no hardware', 'virtual', 'demo',
        'no other process hears it', 'for tests; `drive_can simulate --pty` for two processes',
        BYTES),
    # -- USB without the kernel
    Row('gs_usb', 'candleLight, CANtact, gs_usb devices, past the kernel', 'gs_usb', 'can0',
        'hands back what it has sent, marked; has no filters; fails when it is unplugged in '
        'words of libusb; needs the modules gs_usb and pyusb, and rights to the USB device',
        "the kernel's driver: `socketcan`", 'by the source of python-can 4.3.1 and 4.6.1',
        options=(('index', 0),), module='gs_usb'),
    Row('cantact', "CANtact, by its maker's module", 'cantact', 0,
        'needs the module cantact, which opens the first device it finds',
        "the kernel's driver: `socketcan`", SOURCE, listen_only='monitor: true', module='cantact'),
    Row('canalystii', 'CANalyst-II', 'canalystii', 0,
        'needs the module canalystii; is polled: an answer may be some ms late; no error frames, '
        'no listen-only', 'a `period` of 0.02 and more', SOURCE, latency=0.005,
        options=(('device', 0),), module='canalystii'),
    # -- makers' libraries
    Row('pcan', 'PEAK PCAN', 'pcan', 'PCAN_USBBUS1',
        "needs libpcanbasic.so and PEAK's driver (with it, or with the kernel's peak_usb); "
        'stamps of its own clock; one program for each channel',
        "the kernel's driver peak_usb: `socketcan`", SOURCE),
    Row('kvaser', 'Kvaser', 'kvaser', 0,
        'needs libcanlib.so; channels count from 0; shares a channel with other programs, whose '
        'frames it shows, too; takes virtual channels for real ones',
        '`accept_virtual: false`', SOURCE, listen_only='driver_mode: false',
        instead="the kernel's driver kvaser_usb: `socketcan`"),
    Row('ixxat', 'IXXAT (HMS)', 'ixxat', 0,
        'python-can knows its Windows library only', "IXXAT's driver for SocketCAN: `socketcan`",
        SOURCE),
    Row('vector', 'Vector', 'vector', 0,
        'python-can knows its Windows library only',
        'another adapter, or the computer that has it as a gateway', SOURCE,
        listen_only='listen_only: true', options=(('app_name', 'CANalyzer'),)),
    Row('usb2can', '8devices USB2CAN', 'usb2can', 'ED000200',
        'python-can knows its Windows library only', "the kernel's driver usb_8dev: `socketcan`",
        SOURCE),
    Row('neovi', 'Intrepid neoVI, ValueCAN', 'neovi', 1,
        'needs the module python-ics and its library',
        "Intrepid's driver for SocketCAN: `socketcan`", SOURCE, module='python-ics'),
    Row('systec', 'SYS TEC USB-CANmodul', 'systec', 0,
        'python-can knows its Windows library only', "SYS TEC's driver for SocketCAN: `socketcan`",
        SOURCE),
    Row('nixnet', 'National Instruments XNET', 'nixnet', 'CAN1',
        'needs the module nixnet and NI-XNET', 'none is known', SOURCE,
        listen_only='listen_only: true', module='nixnet'),
    Row('neousys', 'Neousys computers with CAN', 'neousys', 0,
        'needs libwdt_dio.so', 'none is known', SOURCE, options=(('device', 0),)),
    Row('sontheim', 'Sontheim CANfox and others (plug-in python-can-sontheim)', 'sontheim', 105,
        "needs Sontheim's library; an unknown bit rate becomes 500 kbit/s without a word",
        'look at the bit rate twice', 'by the source of python-can-sontheim 0.1.3',
        module='python-can-sontheim'),
    Row('wuensche', 'EMS Dr. Thomas Wünsche (plug-in python-can-wuensche)', 'wuensche', 'CHAN00',
        'needs libcpc.so; channels are those of /etc/cpcconf.ini',
        "the kernel's drivers ems_usb, ems_pci: `socketcan`",
        'by the source of python-can-wuensche 1.0.0', module='python-can-wuensche'),
    Row('remote', "python-can's interfaces of another computer (plug-in python-can-remote)",
        'remote', 'ws://10.0.0.5:54701/',
        'stamps of the other computer; where that hangs, the end of the bridge waits 2 s for it',
        '`socketcand`, where the other computer has SocketCAN',
        'its server 0.3.0, with a simulated servo', module='python-can-remote'),
    Row('cannelloni', 'cannelloni over TCP (plug-in can-cannelloni)', 'cannelloni',
        '10.0.0.5:20000', 'connects again by itself: a loss is seen when something is sent',
        '`reconnect: false`', 'can-cannelloni 0.1.0, with a simulated servo',
        module='can-cannelloni'),
    Row('waveshare', 'Waveshare 2-CH-CAN-TO-ETH (plug-in can-waveshare)', 'waveshare',
        '10.0.0.5:20001', 'nothing is heard of errors on the bus', 'none is needed',
        'can-waveshare 0.1.0, with a simulated servo', module='can-waveshare'),
    Row('damiao', 'Damiao USB-CAN (plug-in python-can-damiao)', 'damiao', '/dev/ttyACM0',
        'data of fewer than 8 bytes leave at the wrong end; of frames that come together it '
        'receives one', 'another adapter', 'python-can-damiao 0.1.0, over bytes',
        module='python-can-damiao', drops=tuple(
            Dropped('frames of fewer than 8 bytes as they are', Route(0, 0, extended))
            for extended in (False, True))),
)

#: interfaces of python-can without a row -> why they cannot be used on Linux
NOT_ON_LINUX = {
    'etas': 'its library is for Windows',
    'iscan': 'its library is for Windows',
    'nican': 'its library is for Windows',
}

BY_NAME = {row.name: row for row in ROWS}
_DEFAULT_RATES = {'seeedstudio': 2_000_000}
#: keys with the speed of a serial line
_RATE_KEYS = ('tty_baudrate', 'ttyBaudrate', 'baudrate')


def row_of(bus: BusConfiguration) -> Row | None:
    """Return the row of the adapter of a bus: by the file, else by USB or interface."""
    if bus.adapter:
        return BY_NAME.get(bus.adapter)
    device = device_of(bus)
    found = row_of_port(device) if device is not None else None
    if found is not None and found.interface == bus.interface:
        return found
    if bus.interface == 'slcan' and '://' in str(bus.channel):
        return BY_NAME['slcan_tcp']
    return next((row for row in ROWS if row.interface == bus.interface), None)


def row_of_port(path: str) -> Row | None:
    """Return the row of the adapter at a serial port of this host, where USB shows which it is."""
    usb = usb_device(path)
    if usb is None:
        return None
    name = f'{usb.number} {usb.product}'
    return next((row for row in ROWS if name.startswith(row.usb or ('?',))), None)


def what_helps(interface: str) -> str:
    """Return what makes an interface usable whose driver is missing; '': nothing is known."""
    return next((row.helps for row in ROWS if row.interface == interface), '')


def traits_of(bus: BusConfiguration) -> AdapterTraits | None:
    """Return what is known of the adapter of a bus; None: nothing."""
    row = row_of(bus)
    if row is None:
        return None
    device = device_of(bus)
    timer = None if device is None else latency_timer(device)
    if timer is not None:
        remedy = timer.remedy if timer.seconds > 0.001 else ''
    elif row.latency:       # it is not plugged in here
        remedy = row.cure.replace('`', '').replace(
            'ttyUSB0', 'ttyUSB0' if device is None else port_name(device))
    else:
        remedy = ''
    return AdapterTraits(
        row.title if row.name != row.interface else bus.place,
        row.latency if timer is None else timer.seconds,
        remedy, _line_rate(bus, row, device), row.line_bits, row.listen_only, row.drops)


def _line_rate(bus: BusConfiguration, row: Row, device: str | None) -> int:
    """Return the speed of the serial line, where it is one."""
    if device is None or not (row.uart or port_name(device).startswith('ttyUSB')
                              and not row.latency):
        return 0
    given = str(bus.channel).partition('@')[2]
    rate = given if given.isdecimal() else next(
        (str(bus.options[key]) for key in _RATE_KEYS if key in bus.options), '')
    return int(rate) if rate.isdecimal() else _DEFAULT_RATES.get(bus.interface, 115_200)
