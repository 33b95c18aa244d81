# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the status word does not say, read by SDO where something depends on it.

Whether the axis stands, where samples do not say it (:mod:`.standstill`, 606Ch); which mode an
enabled drive is in (6061h), until it shows that of the file; why a drive does not become enabled
(603Fh), when half of its time for that is over.
"""


from drive_can_bridge.core import sentences
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.homing import Homing
from drive_can_bridge.protocols.cia402.node_set_up import NodeSetUp, POLL_PERIOD
from drive_can_bridge.protocols.cia402.state_machine import DriveRules
from drive_can_bridge.protocols.cia402.states import MODES, ServoState
from drive_can_bridge.protocols.cia402.transactor import (
    ObjectRead, Procedure, SdoChannel, Transfer)
from drive_can_bridge.protocols.transactor import Refused


class StatePolls:
    """The polls of one drive, one at a time."""

    def __init__(self, session: Session, control: ControlMachine, rules: DriveRules,
                 channel: SdoChannel, node_set_up: NodeSetUp, homing: Homing) -> None:
        self._session, self._control, self._rules = session, control, rules
        self._channel, self._node_set_up, self._homing = channel, node_set_up, homing
        self._standstill = rules.standstill
        self._mode = MODES[session.configuration.options.mode].number
        self.forget()

    def forget(self) -> None:
        """Know nothing of what the drive shows while it is enabled."""
        self._mode_shown: int | None = None
        self._error_code: int | None = None
        self.ended()

    def ended(self, _: None = None) -> None:
        """Record that none is under way: it has ended, or the channel was cleared."""
        self._polling = False

    def update(self, now: float) -> None:
        """Begin what is missing, by the state that the drive is in."""
        state, control = self._rules.state, self._control
        if state is not ServoState.OPERATION_ENABLED:
            self._mode_shown = None
        if not control.pending:
            self._error_code = None
        if self._polling:
            return
        if self._standstill.watching and not self._standstill.holds:
            self._begin(self._poll_axis(), now)
        elif self._session.stage is not Stage.RUNNING:
            return      # at the end nothing else is asked
        elif state is ServoState.OPERATION_ENABLED and self._mode_shown != self._mode and (
                not control.stopping and not self._homing.under_way):
            self._begin(self._poll_mode(), now)
        elif control.pending and self._error_code is None and (
                now > control.due - 0.5 * self._session.configuration.control_timeout):
            self._begin(self._poll_error(), now)

    def _begin(self, look: Procedure[None], now: float) -> None:
        self._polling = True
        self._channel.run(look, self.ended, now)

    def _poll_mode(self) -> Procedure[None]:
        """Read 6061h until it shows the mode."""
        while self._rules.state is ServoState.OPERATION_ENABLED:
            reply = yield Transfer(states.MODE_SHOWN)
            if isinstance(reply, Refused) and reply.absent:
                self._node_set_up.report_once(sentences.mode_not_shown())
                self._mode_shown = self._mode       # nothing says otherwise
            elif isinstance(reply, ObjectRead) and reply.content:
                self._mode_shown = reply.number(1, signed=True)
            if self._mode_shown == self._mode:
                if not self._control.stopping:      # the status is older than what was sent
                    self._control.status_received(self._rules.status, self._channel.now)
                    self._session.control_changed(self._channel.now)
                return
            yield Transfer(pause=POLL_PERIOD)

    def _poll_axis(self) -> Procedure[None]:
        """Read what samples do not say as long as it is to be known whether the axis stands."""
        while self._standstill.watching and not self._standstill.holds:
            yield from self._standstill.poll(self._channel)
            yield Transfer(pause=POLL_PERIOD)

    def _poll_error(self) -> Procedure[None]:
        """Read 603Fh: why the drive is not enabled."""
        reply = yield Transfer(states.ERROR_CODE)
        self._error_code = reply.number(2) if isinstance(reply, ObjectRead) else -1

    @property
    def mode_lacking(self) -> Sentence:
        """What the drive lacks to be driven although it reports enabled; '' if nothing."""
        if self._mode_shown == self._mode or self._rules.state is not ServoState.OPERATION_ENABLED:
            return NOTHING
        return sentences.mode_differs(
            self._session.configuration.options.mode, self._mode, self._mode_shown)

    @property
    def error(self) -> Sentence:
        """What 603Fh says of why the drive is not enabled; '' if nothing."""
        code = self._error_code
        return sentences.error_code(code) if code is not None and code >= 0 else NOTHING
