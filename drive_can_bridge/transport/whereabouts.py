# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What happened to the adapter of a bus that was lost, in words."""

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.transport.bus_identity import adapter_of
from drive_can_bridge.transport.failures import in_words
from drive_can_bridge.transport.kernel_interfaces import index_of, kernel_interface, why_lost

#: share by which a controller's bit rate may be off, since its oscillator allows no nearer one
_OFF = 0.01


class Whereabouts:
    """
    The adapter of one bus, watched from its first opening on.

    An interface of the kernel keeps its number when it is renamed: so that is remembered.
    """

    def __init__(self, bus: BusConfiguration) -> None:
        self._bus = bus
        self._number = 0

    def opened(self) -> str:
        """Record that it is there; return what people should know of it, '': nothing."""
        if self._bus.interface != 'socketcan':
            return ''
        name, given = str(self._bus.channel), self._bus.bitrate
        self._number = index_of(name)
        found = kernel_interface(name)
        if found is None or not found.bitrate or abs(found.bitrate - given) <= _OFF * given:
            return ''
        return bus_sentences.interface_at_other_bitrate(
            given=given, name=name, bitrate=found.bitrate)

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
