# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is exchanged with a drive in every cycle, as parameters in order; and what was sent."""

from collections.abc import Sequence
from dataclasses import dataclass

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter


def control_word(drive: DriveConfiguration, *, controlled: bool) -> Parameter | None:
    """
    Return the control word as a parameter of the profile; None: users may write it as any other.

    :param controlled: a control machine writes it.
    """
    table = drive.profile.control
    if table is None or not controlled:
        return None
    return drive.profile.parameters.get(table.parameter)


def status_word(drive: DriveConfiguration) -> Parameter | None:
    """Return the status word as a parameter of the profile; None: there is none to be read."""
    table = drive.profile.control
    return None if table is None else drive.profile.parameters.get(table.status_parameter or '')


@dataclass(frozen=True, slots=True)
class ProcessImage:
    """
    The process data of one drive.

    :param setpoints: every ``cyclic_request`` parameter but the control word, in slot order.
    :param request: all that the drive is commanded: what is sent cyclically, and a control word
        that has no slot there.
    :param sample: what the drive reports, in the order of ``ProcessDataReceived.raws``. What is
        built in comes first: a short telegram lacks the last values, never the status.
    """

    setpoints: tuple[Parameter, ...]
    request: tuple[Parameter, ...]
    sample: tuple[Parameter, ...]

    @classmethod
    def of(cls, drive: DriveConfiguration, *, controlled: bool,
           word: Sequence[Parameter] = (), status: Sequence[Parameter] = ()) -> 'ProcessImage':
        """
        Return that of a configured drive.

        :param controlled: a control machine writes the control word.
        :param word: the control word of a telegram that has it built in.
        :param status: the status word, likewise.
        """
        control, listed = control_word(drive, controlled=controlled), drive.cyclic_request
        apart = () if control is None or control in listed else (control,)
        return cls(
            setpoints=tuple(each for each in listed if each != control),
            request=(*word, *listed, *apart), sample=(*status, *drive.cyclic_response))


class LastSent:
    """
    Setpoints and control word as they stood in the frames that carried them last.

    :ivar parameters: all that a drive can be commanded, in the order of its frames.
    :ivar raws: the raw integer of each; None: not sent since activation. Another tuple after each
        change, and the same one as long as nothing changes.
    :ivar times: how often frames with new contents have carried each, for those who wait for one.
    """

    __slots__ = ('_widths', 'parameters', 'raws', 'times')

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        #: of each: its bits, and the one of them that is the sign, as masks
        self._widths = [((1 << parameter.type.bits) - 1,
                         1 << parameter.type.bits - 1 if parameter.type.signed else 0)
                        for parameter in self.parameters]
        self.raws: tuple[int | None, ...] = ()
        self.times = [0] * len(self.parameters)
        self.clear()

    def clear(self) -> None:
        """Record that nothing was sent yet."""
        self.raws = (None,) * len(self.parameters)

    def take(self, words: Sequence[int], first: int = 0) -> None:
        """
        Record what a frame carries.

        :param words: raw integers, or the words on the wire.
        :param first: place of the first of them in ``parameters``.
        """
        widths = self._widths[first:] if first else self._widths
        fresh: tuple[int | None, ...] = tuple([
            ((word & mask) ^ sign) - sign for word, (mask, sign) in zip(words, widths)])
        known = self.raws
        if len(fresh) < len(known):
            fresh = known[:first] + fresh + known[first + len(fresh):]
        times = self.times
        for place in range(first, first + min(len(words), len(widths))):
            times[place] += 1
        if fresh != known:
            self.raws = fresh
