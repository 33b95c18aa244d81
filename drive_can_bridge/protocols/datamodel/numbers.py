# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Where the parameters of a DataModel drive stand: by number, one word each.

Numbers in a profile are those of the drive's manual. What goes over the wire, in identifiers,
telegrams and map entries, is ``number + parameter_offset``; a few drives count from 0 on one side
and from 1 on the other.
"""

from collections.abc import Container, Iterable, Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.protocols.datamodel.channel import Read, Write
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.placement import ParameterPlacement
from drive_can_bridge.protocols.polling import Chunk, plan_reads


class Numbers(ParameterPlacement[Chunk]):
    """
    The numbers of one drive, on the wire.

    :ivar offset: added to every parameter number.
    """

    def __init__(self, drive: DriveConfiguration) -> None:
        self.offset: int = drive.options.parameter_offset

    def number(self, parameter: Parameter) -> int:
        """Return the number of a parameter."""
        return (parameter.number or 0) + self.offset

    def numbers(self, parameters: Iterable[Parameter]) -> tuple[int, ...]:
        """Return the numbers of parameters, in their order."""
        return tuple(map(self.number, parameters))

    def span(self, parameter: Parameter) -> Chunk:
        return Chunk(self.number(parameter))

    def addresses(self, span: Chunk) -> range:
        return span.addresses

    def plan(self, spans: Sequence[Chunk], *, known: Container[int] = ()) -> list[Chunk]:
        """
        Cover everything by as few reads as possible.

        :param known: numbers that may be read although nobody wants them.
        """
        return plan_reads(spans, SLOTS, known=known)

    def read(self, parameter: Parameter) -> Read:
        """Return the step that reads a parameter."""
        return Read(self.number(parameter))

    def write(self, parameter: Parameter, raw: int) -> Write:
        """Return the step that writes a parameter; one of unknown storage counts as EEPROM."""
        return Write(self.number(parameter), self.words(parameter, raw),
                     parameter.storage is not Storage.RAM)
