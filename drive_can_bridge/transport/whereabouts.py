# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What happened to the adapter of a bus that was lost, in words."""

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.transport.bus_identity import adapter_of
from drive_can_bridge.transport.failures import in_words
from drive_can_bridge.transport.kernel_interfaces import index_of, why_lost


class Whereabouts:
    """
    The adapter of one bus, watched from its first opening on.

    An interface of the kernel keeps its number when it is renamed: so that is remembered.
    """

    def __init__(self, bus: BusConfiguration) -> None:
        self._bus = bus
        self._number = 0

    def opened(self) -> None:
        """Record that it is there."""
        if self._bus.interface == 'socketcan':
            self._number = index_of(str(self._bus.channel))

    def reason(self, error: BaseException, *, absent: bool) -> str:
        """
        Return why it does not work any more.

        :param error: of its adapter.
        :param absent: it was there, and is gone.
        """
        if self._bus.interface == 'socketcan':
            return why_lost(str(self._bus.channel), self._number) or in_words(error)
        if absent:
            return bus_sentences.adapter_gone(adapter=adapter_of(self._bus))
        return in_words(error)
