# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Stop all buses at the same time: the slowest one decides, not the sum."""

from collections.abc import Iterable
from functools import partial

from drive_can_bridge.clock import Clock
from drive_can_bridge.exchange.exchange import BusExchange


def stop_all(exchanges: Iterable[BusExchange], clock: Clock) -> dict[str, str]:
    """
    Stop the drives of every exchange that is active, or being stopped, and wait until it is done.

    :return: why the stop frames could not all be sent, by name of the bus.
    """
    failures: dict[str, str] = {}

    def stop(exchange: BusExchange) -> None:
        try:
            if exchange.deactivate():
                return
            reason = exchange.bus_reason or 'the bus blocks'
        except Exception as error:  # noqa: BLE001  outermost call of a thread: nothing is silent
            reason = f'{type(error).__name__}: {error}'
        failures[exchange.bus.name] = reason

    threads = [clock.worker(partial(stop, exchange), f'stop {exchange.bus.name}')
               for exchange in exchanges if exchange.active or not exchange.stopped]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return failures
