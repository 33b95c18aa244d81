# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The direct way to drives: on the buses of a parameter file, while no bridge has them."""

from collections.abc import Sequence
from pathlib import Path
import sys

from drive_can_bridge.client.conversation import BusConversation
from drive_can_bridge.client.direct_drive import DirectDrive
from drive_can_bridge.client.drive import Drives
from drive_can_bridge.clock import Clock
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.exchange.one_master import Ownership

#: s to listen for another master before the first request
LISTEN = 1.2
#: what to do where a bridge has a drive
ADVICE = 'leave --params-file away to go through it'


class DirectSource:
    """
    The drives of a parameter file.

    :param nmt_start: start CANopen nodes before they are asked.
    :raises ConfigurationError: the file is wrong.
    """

    def __init__(self, params_file: str | Path, clock: Clock, *, nmt_start: bool = False) -> None:
        self.configuration: BridgeConfiguration = configuration_from_file(Path(params_file))
        self._clock = clock
        self._nmt_start = nmt_start

    @property
    def names(self) -> Sequence[str]:
        """All drives, in the order of the file."""
        return tuple(self.configuration.drives)

    def parameter_names(self, drive: str) -> Sequence[str]:
        """Return the names of the listed parameters of a drive."""
        return tuple(self.configuration.drives[drive].profile.parameters)

    def open(self, names: Sequence[str]) -> Drives:
        """Take the locks, open the buses of these drives, listen for another master."""
        configuration = self.configuration
        wanted = [drive for name, drive in configuration.drives.items() if name in names]
        everyone = [*wanted, *(drive for drive in configuration.drives.values()
                               if drive not in wanted)]
        groups = {bus: [drive for drive in everyone if drive.bus == bus]
                  for bus in dict.fromkeys(drive.bus for drive in wanted)}
        ownership = Ownership([(configuration.buses[bus], drives)
                               for bus, drives in groups.items()], _program(), ADVICE)
        conversations: dict[str, BusConversation] = {}

        def close() -> None:
            for conversation in conversations.values():
                conversation.close()
            ownership.release()
        try:
            for bus, drives in groups.items():
                conversations[bus] = BusConversation(
                    configuration.buses[bus], [drive for drive in wanted if drive.bus == bus],
                    drives, ownership, self._clock)
            seconds = LISTEN    # they all hear at the same time
            for conversation in conversations.values():
                conversation.listen(seconds)
                seconds = 0.0
            opened = {drive.name: DirectDrive(drive, configuration.buses[drive.bus],
                                              conversations[drive.bus], self._nmt_start)
                      for drive in wanted}
            warnings = [text for drive in opened.values() for text in drive.begin()]
        except BaseException:
            close()
            raise
        return Drives(opened, close, warnings=warnings)

    def close(self) -> None:
        """Nothing is open."""


def _program() -> str:
    """Return what this process is called, for those that want the same drives."""
    words = [Path(word).name for word in sys.argv]
    subcommand = next((word for word in words[1:] if word.isidentifier()), '')
    return f'{words[0]} {subcommand}' if words[0] == 'drive_can' else words[0] or 'script'
