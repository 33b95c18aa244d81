# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The run behind ``step_response.png``: a simulated conveyor is told to jump, and ``record`` listens.

usage: step_response_run.py TRACE PARAMETER_FILE

Writes both files. Exchange, drive and ``drive_can record`` share a bus that is in this process.
"""

from pathlib import Path
import sys

from drive_can_bridge.cli.main import main as drive_can
from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.session import Session
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.protocols.families import FAMILIES, make_sessions
from drive_can_bridge.simulation.simulation import Simulation

FILE = """\
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {interface: virtual, channel: step_response}
    drives:
      conveyor: {bus: main, protocol: datamodel_extended, station: 1, profile: datamodel_example,
                 period: 0.01, cyclic_request: [speed_setpoint, torque_limit],
                 cyclic_response: [actual_speed, motor_current]}
"""
#: s after the beginning, and rpm from then on
STEPS = ((0.0, 0.0), (0.8, 1500.0), (2.0, -750.0), (3.2, 0.0))
SECONDS = 4.0
CLOCK = SteadyClock()


class Commander:
    """Listens to the exchange, and commands one drive before each of its cycles."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._begun = CLOCK.now()

    def take_commands(self, now: float) -> None:
        """Say what the drive is to do now."""
        rpm = [rpm for since, rpm in STEPS if now - self._begun >= since][-1]
        self._session.services.command(0, rpm, now)
        self._session.services.command(1, 0.0 if now - self._begun < STEPS[1][0] else 50.0, now)

    def nothing(self, *_: object, **__: object) -> None:
        """Take no notice."""

    handle_event = discard_commands = process_data = request_sent = nothing
    bus_opened = bus_lost = fatal = nothing


def main() -> int:
    """Run."""
    trace, file = map(Path, sys.argv[1:])
    file.write_text(FILE, encoding='utf-8')
    configuration = configuration_from_file(file)
    bus, = configuration.buses.values()
    drive, = configuration.drives.values()
    with Simulation(configuration):
        session, = make_sessions([drive])
        commander = Commander(session)
        exchange = BusExchange(
            bus, [session],
            [[claim.route for claim in FAMILIES[drive.protocol].claims(drive)]], commander, CLOCK)
        exchange.attach(session, commander)
        exchange.open()
        exchange.activate()
        code = drive_can(['record', '-o', str(trace), '--params-file', str(file),
                          '--seconds', str(SECONDS)])
        exchange.deactivate()
        exchange.close()
    return int(code or 0)


if __name__ == '__main__':
    sys.exit(main())
