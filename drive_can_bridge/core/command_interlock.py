# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whether the commands of users reach a drive.

Setpoints move a drive only while its control word lets them: a drive that is commanded while it is
disabled would jump at the moment of ``~/enable``. So commands are accepted while the drive
exchanges process data and operates, and everything is neutral otherwise. What is neutral for an
axis that has to stay where it is depends on where it is, and on nothing driving it.
"""

from collections.abc import Sequence
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import DriveState, Noted
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.setpoints import Setpoints


class DriveStatus(Protocol):
    """The state of a drive, as its session knows it."""

    active: bool
    online: bool

    @property
    def error(self) -> Sentence:
        """Why a drive that is online must not be driven; '' if it may be."""


class CommandInterlock:
    """
    The setpoints of one drive, behind its control word.

    :param control: its control and status word machine, if it has one.
    :param sample: what is measured, in the order of samples.
    :param leader: the machine of the drive whose control word it obeys, if that is another one.
    :param missed_limit: how many responses in a row may lack the status word of an enabled drive.
    :ivar obeyed: the machine whose control word the drive obeys; None: there is none.
    """

    def __init__(self, presence: DriveStatus, setpoints: Setpoints, control: ControlMachine | None,
                 sample: Sequence[Parameter], report: Reporter,
                 leader: ControlMachine | None = None, missed_limit: int = 3) -> None:
        self._presence = presence
        self._setpoints = setpoints
        self._control = control
        self.obeyed = leader or control
        self._report = report
        self._missed_limit = missed_limit
        self._held = False  # neutral, whatever is commanded
        self._lacking = 0   # responses in a row without a status word
        self._status_in_sample = control is not None and any(
            parameter.name == control.table.status_parameter for parameter in sample)

    @property
    def state(self) -> DriveState:
        """The state of the drive in one word, as far as commands are concerned."""
        if not self._presence.online:
            return DriveState.OFFLINE
        if self._control is not None and self._control.fault:
            return DriveState.FAULT
        if self.obeyed is not None and not self.obeyed.operating:
            return DriveState.DISABLED
        return DriveState.NOT_ARMED if self._setpoints.waiting else DriveState.ONLINE

    @property
    def position_unknown(self) -> bool:
        """Whether nothing may be sent: the axis would jump, because its position is unknown."""
        return self._control is None and not self._setpoints.known

    def follow(self) -> None:
        """Report the notes of the control machine, and update whether commands are accepted."""
        if self._control is not None:
            for note in self._control.take_notes():
                # during a stop, it is what everybody expects
                self._report.note(Noted(note, warning=self._presence.active))
        self._allow()

    def _allow(self) -> None:
        """Accept commands only while they may move the drive; otherwise it stays neutral."""
        presence, obeyed = self._presence, self.obeyed
        self._setpoints.allow(presence.online and presence.active and not self._held and (
            obeyed is None or obeyed.operating) and not presence.error)

    def hold(self, held: bool) -> None:
        """Go neutral and refuse commands while held; accept them again afterwards."""
        self._held = held
        self._allow()

    def withdraw(self, reason: Sentence, now: float) -> None:
        """Go neutral, and back to ``disable``."""
        self._setpoints.allow(False)
        if self._control is not None:
            # of a drive that is only being stopped the last status is still known
            self._control.withdraw(reason, now, lost=self._presence.active)
            self.follow()

    def status(self, raw: int | None, now: float) -> None:
        """
        Handle the status word of a response; None: the response lacks it.

        A drive that no longer reports whether it is enabled is not driven any further.
        """
        control = self._control
        if control is None:
            return
        control.status_received(raw, now)
        self._lacking = 0 if raw is not None else self._lacking + 1
        if (self._lacking >= self._missed_limit and control.operating
                and control.table.enabled is not None):
            control.drop(sentences.status_missing(self._lacking))

    def measured(self, raws: Sequence[int | None]) -> None:
        """Handle a sample, for setpoints that follow the axis; after its status word."""
        if not self._setpoints.held:
            return
        control = self._control
        # once the word may have started the drive, only a status as new as the position counts
        free = control is not None and control.loose and (
            control.at_rest and self._presence.active or self._status_in_sample)
        if self._setpoints.measure(raws, driven=not free):
            self._allow()

    def expire(self, now: float) -> bool:
        """Disarm setpoints that no fresh command keeps; return whether there were any."""
        expired = self._setpoints.expire(now)
        if expired:
            self._report.expired(expired)
        return bool(expired)
