# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The configuration of the demo: any bridge's, with other buses."""

from dataclasses import replace
from pathlib import Path

from drive_can_bridge.core.configuration import BridgeConfiguration

#: bit/s that SLCAN adapters know; any other is replaced by the next one above
_BITRATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 750_000, 1_000_000)
#: s; who looks at the demo wants to see something soon
_DIAGNOSTICS_PERIOD_MAX = 1.0


def on_terminals(configuration: BridgeConfiguration, directory: Path) -> BridgeConfiguration:
    """
    Replace every bus by the pseudo-terminal at ``directory/BUS``, and waiting by a start.

    Nothing of a bus that is replaced is kept but its bit rate.
    """
    buses = {name: replace(bus, interface='slcan', channel=str(directory / name), options={},
                           bitrate=next((rate for rate in _BITRATES if rate >= bus.bitrate),
                                        _BITRATES[-1]))
             for name, bus in configuration.buses.items()}
    period = min(configuration.diagnostics_period, _DIAGNOSTICS_PERIOD_MAX)
    return replace(configuration, buses=buses, autostart=True, diagnostics_period=period)
