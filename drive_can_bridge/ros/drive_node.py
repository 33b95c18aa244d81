# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The node of one drive: events of its session become topics, requests of users go to the session.

Samples are published in the thread that received the frame; parameter services and control
services are served in threads of theirs.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter as NodeParameter
from std_msgs.msg import Bool

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.errors import TransportError
from drive_can_bridge.core.events import (
    AnswerLate, DriveFailed, Event, ForeignMasterSeen, FrameRejected, MappingDiffered,
    MappingWritten, Noted, ProcessDataReceived, RequestCompleted, SetpointsExpired, StationFound,
    StationLost)
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.requests import (
    Failure, FailureKind, Outcome, ReadRequest, ReadValue, Request)
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.text import printable
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.exchange.member import DriveListener
from drive_can_bridge.protocols.family import Family
from drive_can_bridge.ros.commands import CommandIntake
from drive_can_bridge.ros.coroutines import Awaited
from drive_can_bridge.ros.drive_services import control_services, CoroutineServices
from drive_can_bridge.ros.log import FEW, Log
from drive_can_bridge.ros.middleware import publisher, quality_overrides
from drive_can_bridge.ros.parameter_services import ParameterServices
from drive_can_bridge.ros.polled_topics import PolledTopics
from drive_can_bridge.ros.rcl.extension import GONE
from drive_can_bridge.ros.rcl.quality import latched_quality
from drive_can_bridge.ros.samples import RequestTopic, SamplePublisher
from drive_can_bridge.ros.stamps import Stamps
from drive_can_bridge.ros.threads import ExecutorThread, ServiceThread

#: called with the outcomes of a request, or its :class:`.ControlCompleted`
Completed = Callable[[Any], None]
#: reads in a row that failed, after which the drive is left alone
FAILURES_MAX = 2
#: s between two looks who has armed a setpoint; nodes that are named
_TELL_ARMED, _COMMANDERS_SHOWN = 0.2, 4


class DriveNode(DriveListener):
    """
    One drive in the ROS graph.

    :param bridge: the bridge's node; the drive lives in its namespace.
    :param spinner: serves the node, and runs its jobs.
    :param log: of the bridge.
    :param control_thread: serves ``~/enable`` and its like.
    :param parameter_thread: serves the parameter services.
    :param stamps: of the bridge.
    :param identified: called with the drive's identity in words whenever it changes.
    :ivar joint_commands: the commands for all joints of its bus, which the drive that is
        served next takes for all drives; None: there are none.
    :ivar lost_at: when it went offline last, of :meth:`.Clock.stamp`.
    :ivar lost_for: why it did.
    :ivar witness: called with events, too; None: nothing is.
    """

    def __init__(self, bridge: Node, drive: DriveConfiguration, session: Session, family: Family,
                 exchange: BusExchange, spinner: ExecutorThread, log: Log,
                 control_thread: ServiceThread, parameter_thread: ServiceThread,
                 stamps: Stamps, identified: Callable[[str], None], clock: Clock) -> None:
        self.drive = drive
        self.session = session
        self.exchange = exchange
        self.joint_commands: PolledTopics | None = None
        self.witness: Callable[[Event], None] | None = None
        self._spinner = spinner
        self._log = log.source(drive.name)
        self._log.reset()
        self._asked: dict[Request | ControlRequest, Completed] = {}
        self._services: list[CoroutineServices] = []
        self.requests_refused = 0
        self._identity = IdentityReader(
            drive.profile, submit=self._submit_quietly, online=lambda: session.online,
            tell=identified, warn=lambda text: self.warn(text, text))
        self.times_lost = 0
        self.lost_at = 0
        self._stamp, self._now = clock.stamp, clock.now
        self._tell_armed_at = dict[str, float]()
        self.lost_for: Sentence = NOTHING
        self.rejected_text: Sentence = NOTHING
        self._may_run = False   # and nothing has arrived from it since
        self._told_online = self._told_from_outside = False
        self.foreign_text: Sentence = NOTHING
        # a local remapping wins over a process-wide ``__node:=``, which would rename every drive;
        # time and qualities are the bridge's, whose parameters are visible to everybody
        self.node = Node(
            drive.name, namespace=bridge.get_namespace(), context=bridge.context,
            cli_args=['--ros-args', '-r', f'__node:={drive.name}'],
            start_parameter_services=False, enable_rosout=False,
            parameter_overrides=[NodeParameter('start_type_description_service', value=False),
                                 NodeParameter('use_sim_time', value=False),
                                 *quality_overrides(bridge)])
        try:
            self.commands = CommandIntake(self.node, drive, session, clock, self.warn,
                                          self._log.info, self._armed)
            try:
                self._populate(stamps, family, control_thread, parameter_thread)
            except BaseException:
                self.commands.destroy()
                raise
        except BaseException:
            self.node.destroy_node()
            raise

    def serve(self) -> None:
        """Start to serve: from now on the exchange knows the drive."""
        self._spinner.of_drives.executor.add_node(self.node)
        for services in self._services:
            services.serve()

    def _populate(self, stamps: Stamps, family: Family, control_thread: ServiceThread,
                  parameter_thread: ServiceThread) -> None:
        """Create the topics and services."""
        drive, session = self.drive, self.session
        self.samples = SamplePublisher(self.node, drive, session.sample_parameters, stamps.at,
                                       self._log.info)
        self._request = RequestTopic(self.node, session.sent, stamps)
        self._online = publisher(self.node, Bool, '~/online', latched_quality())
        self._tell_online(False)
        directory = ParameterDirectory(drive.profile.parameters,
                                       lambda name: family.raw_parameter(drive, name))

        def submit(request: Any) -> Awaited[Any]:
            return Awaited(partial(self._submit, request))

        def ask(request: ControlRequest) -> Awaited[ControlCompleted]:
            return Awaited(partial(self._ask, request, sentences.asked_through_ros(
                action=_in_words(request.action))))
        self._parameters = ParameterServices(
            self.node, parameter_thread, directory, stamps, submit=submit,
            write_refusal=session.services.write_refusal, role=session.roles.role,
            active=lambda: self.exchange.active, restore=drive.profile.restore,
            failed=self._parameter_failed).services
        self._control_thread, self._parameter_thread = control_thread, parameter_thread
        self._services.append(self._parameters)
        self._services.append(control_services(
            self.node, control_thread, ask, controlled=session.control is not None,
            homing=getattr(drive.options, 'homing', False)))

    @property
    def name(self) -> str:
        """The name of the drive."""
        return self.drive.name

    def answer_all(self) -> bool:
        """
        Answer callers that still wait, with a failure. The exchange must be closed.

        :return: all calls are answered, and the node may go.
        """
        for request in list(self._asked):
            self._refuse(request, sentences.bridge_inactive())
        return not self.calls

    @property
    def calls(self) -> int:
        """How many callers of its services wait for their answer."""
        return sum(services.calls for services in self._services)

    def destroy(self) -> None:
        """Remove the drive from the graph. The exchange must be closed."""
        self._spinner.leaves()
        self._spinner.of_drives.executor.remove_node(self.node)
        self.commands.destroy()
        for services in self._services:
            services.destroy()
        self.node.destroy_node()
        self._spinner.leaves()

    # -- log --------------------------------------------------------------------------------------

    def warn(self, topic: str, text: str, *, once: bool = False) -> None:
        """
        Log a warning; repetitions of a topic are counted and summed up once in a while.

        :param once: repetitions are not logged at all, until the drive comes online again.
        """
        self._log.warn(topic, text, once=once)

    # -- from the exchange (DriveListener): the bus lock is held ----------------------------------

    def take_commands(self, now: float) -> None:
        """Pass the newest commands to the session."""
        self.commands.take(now)
        if self.joint_commands is not None:
            self.joint_commands.take(now)

    def take_joint(self, quantity: str, value: float, now: float) -> None:
        """Handle the drive's part of the commands for all joints, in the turn of any drive."""
        try:
            self.commands.take_quantity(quantity, value, now)
        except Exception as error:  # noqa: BLE001  which costs no other drive
            self.exchange.contain(self.session, error)

    def discard_commands(self, why: str) -> None:
        """Discard waiting commands."""
        self.commands.discard(why)
        if self.joint_commands is not None:
            self.commands.discarded(self.joint_commands.discard(), why)

    def process_data(self, event: ProcessDataReceived) -> None:
        """Publish a sample."""
        try:
            self.samples.publish(event.raws, event.received_at)
        except GONE as error:
            self._cannot_publish(error)

    def request_sent(self, now: float) -> None:
        """Publish what was sent."""
        try:
            self._request.publish(now)
        except GONE as error:
            self._cannot_publish(error)

    def handle_event(self, event: Event) -> None:
        """Publish or log what happened."""
        if self.witness is not None:
            self.witness(event)
        try:
            self._handle_event(event)
        except GONE as error:
            self._cannot_publish(error)

    def _handle_event(self, event: Event) -> None:
        if isinstance(event, (RequestCompleted, ControlCompleted)):
            if (isinstance(event, ControlCompleted) and event.success
                    and event.request.action is ControlAction.HOME):
                self.samples.begin_again()
            completed = self._asked.pop(event.request, None)
            # else asked for at another member of a group, or answered for a defect
            if completed is not None:
                completed(event.outcomes if isinstance(event, RequestCompleted) else event)
        elif isinstance(event, StationFound):
            self._may_run = False
            self._tell_online(True)
            self._log.reset()
            self._log.info('online')
            self._spinner.later(self._identity.read)
        elif isinstance(event, StationLost):
            self._tell_online(False)
            self.samples.forget()
            self.lost_at, self.lost_for = self._stamp(), event.reason
            if self.session.active:
                self.times_lost += 1
                self._log.warning(f'offline: {event.reason}', urgent=True)
            elif event.ordered and not self._may_run:
                self._tell_stopped()    # else it was lost before the end of its stop
        elif isinstance(event, DriveFailed):
            self._log.error(sentences.failed_and_looked_for(reason=event.reason))
            self._tell_online(False)
            self.samples.forget()
            self.times_lost += 1
        elif isinstance(event, SetpointsExpired):
            text = sentences.command_timed_out(
                self.session.configuration.command_timeout, event.names)
            if event.orderly:   # nothing changed for the drive: the publisher has ended
                self._log.info(text)
            else:
                self.warn('command timeout', text)
        elif isinstance(event, MappingDiffered):
            self._log.error(sentences.no_cyclic_frame(how=event.text))
        elif isinstance(event, MappingWritten):
            self._log.warning(sentences.maps_rewritten(how=event.text))
        elif isinstance(event, FrameRejected):
            self.rejected_text = event.text
            self.warn('rejected', sentences.frame_rejected(what=event.text))
        elif isinstance(event, AnswerLate):
            text = together((sentences.answer_late(event.seconds), event.would_hold))
            if event.taken:
                self._log.info(text)
            else:
                self._log.warning(text)
        elif isinstance(event, ForeignMasterSeen):
            self.foreign_text = event.text
            self.warn('foreign master', event.text)
        elif isinstance(event, Noted):
            self._may_run = self._may_run or event.danger
            if event.new:
                self._log.warn('emergency', event.text, few=FEW)
            elif event.error:
                self._log.error(event.text)
            elif event.warning:
                self._log.warning(event.text, urgent=event.danger)
            else:
                self._log.info(event.text)

    def _tell_online(self, online: bool) -> None:
        self._told_online = online
        self._online.publish(Bool(data=online))

    @property
    def may_run(self) -> bool:
        """
        Whether the drive may still run after the stop of the drives.

        That was reported, and it was not online again since; or its stop is not over.
        """
        session = self.session
        return bool(self._may_run or session.stop_pending or session.defect or not session.stopped)

    def looked_at(self, entered: bool) -> None:
        """
        Update ``~/online`` by whether the bus hangs: then no drive is online.

        The threads of the bus cannot report that. They may be back by the time it is published
        here, and then the order is unknown: so the next look decides.

        :param entered: the caller has the lock of the bus; False: it has waited in vain.
        """
        try:
            if not entered:
                self._told_from_outside = True
                if self._told_online:
                    self._tell_online(False)
            elif self._told_from_outside:
                self._told_from_outside = False
                self._tell_online(self.session.online and not self.session.defect)
        except GONE as error:
            self._cannot_publish(error)

    def _tell_stopped(self) -> None:
        """Log the state in which the drive is left: its stop is acknowledged."""
        control = self.session.control
        if control is not None and control.table.enabled is not None and not control.off:
            # it may lag, or the drive runs down
            self._may_run = True
            self._log.warning(sentences.stopped_state_differs(state=control.state))
        else:
            self._log.info('stopped')

    def _cannot_publish(self, error: Exception) -> None:
        if self.node.context.ok():
            self.warn('publish', sentences.cannot_publish(reason=str(error)))

    # -- users ------------------------------------------------------------------------------------

    @property
    def full_name(self) -> str:
        """Its name in the ROS graph."""
        return str(self.node.get_fully_qualified_name())

    @property
    def told_online(self) -> bool:
        """The last value of ``~/online``."""
        return self._told_online

    def offers(self, action: ControlAction) -> bool:
        """Return whether it has a service for this."""
        return action is ControlAction.QUICK_STOP or self.session.control is not None

    def command(self, action: ControlAction,
                completed: Callable[[ControlCompleted], None], *, whom: str = '') -> None:
        """
        Run a control action for a caller by the local way. From any thread.

        :param whom: the caller, for the log.
        """
        self._control_thread.begin(partial(
            self._ask, ControlRequest(action),
            sentences.asked_on_host(action=_in_words(action), whom=whom), completed))

    def _ask(self, request: ControlRequest, asked: Sentence, completed: Completed) -> None:
        """Submit a control action of a user, and log who asked for it."""
        self._submit(request, completed)    # a stop does not wait for the line
        self._log.info(asked, topic=f'asked {request.action.value}')

    def _armed(self, name: str) -> None:
        """Log in the executor who has armed a setpoint: asking the graph takes a moment."""
        now = self._now()
        if now >= self._tell_armed_at.get(name, now):
            self._tell_armed_at[name] = now + _TELL_ARMED
            self._spinner.later(self._tell_armed, name)

    def _tell_armed(self, name: str) -> None:
        joints = self.joint_commands
        try:
            who = self.commands.commanding_nodes([] if joints is None else joints.names)
        except GONE:
            return
        self._log.info(sentences.armed_by(name=name, who=who[:_COMMANDERS_SHOWN]),
                       topic=f'armed {name}')

    def tell_condition(self, answer: Callable[[dict[str, str]], None]) -> None:
        """Answer with its state, as diagnostics show it; {}: its bus hangs. From any thread."""
        def look() -> None:
            session, facts = self.session, dict[str, str]()
            with self.exchange.entered() as entered:
                if entered:
                    facts['state'] = session.state.value
                    if session.control is not None:
                        facts['control_state'] = control_state(session)
            answer(facts)
        self._parameter_thread.begin(look)

    def call(self, service: str, request: Any, answer: Callable[[Any], None]) -> None:
        """Call a parameter service for a caller by the local way. From any thread."""
        self._parameters.call(service, request, answer)

    def _submit(self, request: Request | ControlRequest, completed: Completed) -> None:
        """Submit a request to the session; ``completed`` may be called from any thread."""
        self._asked[request] = completed    # its outcome may come before the next line
        try:
            self.exchange.submit(self.session, request)
        except TransportError as error:     # no other drive's stop waits for it
            self._refuse(request, error.sentence)
        except Exception as error:  # noqa: BLE001  reported as the drive's
            self._refuse(request, sentences.internal_error(type(error).__name__, str(error)))

    def _refuse(self, request: Request | ControlRequest, reason: Sentence) -> None:
        """Complete a request with a failure, unless it is completed."""
        completed = self._asked.pop(request, None)
        if completed is not None:
            completed(ControlCompleted(request, False, reason)
                      if isinstance(request, ControlRequest)
                      else (Failure(FailureKind.UNAVAILABLE, reason),) * len(request))

    def _submit_quietly(self, request: ReadRequest, completed: Completed) -> None:
        """Submit a request of the node itself, completed in the executor."""
        self._submit(request, partial(self._spinner.later, completed))

    def _parameter_failed(self, what: str, reason: str, uncounted: int) -> None:
        text = printable(f'{what}: {reason}')
        self.requests_refused += uncounted
        self.session.statistics.last_request_error = text
        self.warn(f'parameter {text}', text)


def _in_words(action: ControlAction) -> str:
    return action.value.replace('_', ' ')


def control_state(session: Session) -> str:
    """Return what is known of a drive with control."""
    known = session.control
    return known.state if known is not None and session.active else 'unknown'


class IdentityReader:
    """
    Reads the drive's identity and puts it into words. In the executor's thread.

    They are read once whenever the drive comes online, one after the other, by requests like
    those of any user: each waits its turn, so that neither cycles nor users are held up by more
    than one read. What could not be read is left out of the text, and tried again when the drive
    comes online the next time; a drive that answers none of them is not asked for all.

    :param submit: submits a request to the drive's session, and calls back with its outcomes.
    :param online: returns whether the drive is; it is asked nothing otherwise.
    :param tell: called with the text, ``firmware=10205 serial_number=4711``; '' while unknown.
    :param warn: called with what could not be read, in words.
    """

    def __init__(self, profile: Profile, *,
                 submit: Callable[[ReadRequest, Callable[[tuple[Outcome, ...]], None]], None],
                 online: Callable[[], bool], tell: Callable[[str], None],
                 warn: Callable[[str], None]) -> None:
        self._parameters = tuple(profile.parameters[name] for name in profile.identity)
        self._submit = submit
        self._online = online
        self._tell = tell
        self._warn = warn
        self._attempt = 0
        self._known: list[str] = []
        self._failures = 0

    def read(self) -> None:
        """Read the identity again; the former one may be another drive's."""
        self._attempt += 1
        self._known.clear()
        self._failures = 0
        if self._parameters:
            self._tell('')
            self._ask(self._attempt, 0)

    def _ask(self, attempt: int, place: int) -> None:
        self._submit(ReadRequest((self._parameters[place],)),
                     partial(self._take, attempt, place))

    def _take(self, attempt: int, place: int, outcomes: tuple[Outcome, ...]) -> None:
        if attempt != self._attempt or not self._online():
            return  # when it comes online the next time, all of this starts again
        parameter, outcome = self._parameters[place], outcomes[0]
        if isinstance(outcome, ReadValue):
            self._failures = 0
            value = parameter.text(parameter.value_from_raw(outcome.raw))
            self._known.append(f'{parameter.name}={value}')
        elif isinstance(outcome, Failure):
            self._failures += 1
            self._warn(sentences.identity_unread(
                name=parameter.name, address=parameter.address, reason=outcome.reason))
        if place + 1 < len(self._parameters) and self._failures < FAILURES_MAX:
            self._ask(attempt, place + 1)
        else:
            self._tell(' '.join(self._known))
