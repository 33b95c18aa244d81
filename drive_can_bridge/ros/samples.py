# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Publish samples: the fast path from a decoded frame to the ROS graph.

Runs in the thread that received the frame, up to thousands of times a second. So messages are
prepared as bytes in which only the numbers change (:mod:`.prepared`), and what has no
subscriber is not built at all: the subscription counts are looked up every ``COUNT_PERIOD``,
not for every message.
"""

from collections.abc import Callable, Sequence
from functools import partial

from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterEvent
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from drive_can_bridge.core.configuration import DriveConfiguration, JointConfiguration
from drive_can_bridge.core.continuous import ContinuousPosition
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.sentences import position_began_again
from drive_can_bridge.ros.middleware import Audience, COUNT_PERIOD, publisher, state_quality
from drive_can_bridge.ros.prepared import NUMBER_CODES, PreparedMessage
from drive_can_bridge.ros.rcl.quality import latched_quality
from drive_can_bridge.ros.stamps import Stamp, Stamps
from drive_can_bridge.ros.values import parameter_value, TOPIC_TYPES, VALUE_FIELDS


class EventTopic:
    """
    A topic of typed values with one stamp.

    :param first: place of the first of ``parameters`` in what is published.
    """

    def __init__(self, node: Node, topic: str, parameters: tuple[Parameter, ...],
                 first: int = 0) -> None:
        self.publisher = publisher(node, ParameterEvent, topic, state_quality())
        self._entries = [
            ParameterMessage(name=parameter.name, value=parameter_value(
                parameter, parameter.value_from_raw(0))) for parameter in parameters]
        self._fields = [(entry.value, VALUE_FIELDS[parameter.kind])
                        for entry, parameter in zip(self._entries, parameters)]
        self._message = ParameterEvent(node=node.get_fully_qualified_name(),
                                       changed_parameters=self._entries)
        self._first = first
        self._prepared: PreparedMessage | None = None
        if all(parameter.kind in NUMBER_CODES for parameter in parameters):
            stamp = self._message.stamp
            self._prepared = PreparedMessage.find(self.publisher, self._message, [
                ('i', partial(setattr, stamp, 'sec')), ('I', partial(setattr, stamp, 'nanosec')),
                *((NUMBER_CODES[parameter.kind], partial(setattr, entry, field))
                  for parameter, (entry, field) in zip(parameters, self._fields))])

    def publish(self, values: Sequence[Value | None], stamp: Stamp) -> None:
        """Publish those values that there are: fewer than parameters, or None in between."""
        values = values[self._first:]
        entries = self._entries
        if (self._prepared is not None and len(values) == len(entries)
                and None not in values):
            self._prepared.publish((*stamp, *values))
            return
        message = self._message
        message.stamp = Time(sec=stamp[0], nanosec=stamp[1])
        present = []
        for entry, (value_message, field), value in zip(entries, self._fields, values):
            if value is not None:
                setattr(value_message, field, value)
                present.append(entry)
        message.changed_parameters = present
        self.publisher.publish(message)


class RequestTopic:
    """``~/request``: the values sent last. Nothing is built without a subscriber."""

    def __init__(self, node: Node, sent: LastSent, stamps: Stamps) -> None:
        self._sent = sent
        self._stamps = stamps
        self._converters = [each.value_from_raw for each in sent.parameters]
        self._topic = EventTopic(node, '~/request', sent.parameters)
        self._audience = Audience(self._topic.publisher)

    def publish(self, sent_at: float) -> None:
        """Publish them, if anything was sent since activation."""
        raws = self._sent.raws
        if not self._audience.listens(sent_at) or all(raw is None for raw in raws):
            return
        self._topic.publish([None if raw is None else convert(raw)
                             for convert, raw in zip(self._converters, raws)],
                            self._stamps.at(sent_at))


class ValueTopic:
    """``~/<parameter>``: one value once per exchange."""

    def __init__(self, node: Node, parameter: Parameter, slot: int) -> None:
        message_type = TOPIC_TYPES[parameter.kind]
        self.publisher = publisher(node, message_type, f'~/{parameter.name}', state_quality())
        self.slot = slot
        self._message = message_type()
        code = NUMBER_CODES.get(parameter.kind)
        self._prepared = None if code is None else PreparedMessage.find(
            self.publisher, self._message, [(code, partial(setattr, self._message, 'data'))])

    def publish(self, value: Value) -> None:
        """Publish one value."""
        if self._prepared is not None:
            self._prepared.publish((value,))
            return
        self._message.data = value
        self.publisher.publish(self._message)


class JointTopic:
    """
    ``~/joint_state``: SI units, stamped with the receive time.

    :param parameters: of a sample, by slot.
    """

    def __init__(self, node: Node, joint: JointConfiguration,
                 parameters: tuple[Parameter, ...]) -> None:
        self.publisher = publisher(node, JointState, '~/joint_state', state_quality())
        slots = {parameter.name: slot for slot, parameter in enumerate(parameters)}
        self._message = JointState(name=[joint.name])
        self._quantities = [
            (quantity, slots[name], joint.factors[name])
            for quantity, name in (('position', joint.position), ('velocity', joint.velocity),
                                   ('effort', joint.effort)) if name is not None]
        self._slots = [slot for _, slot, _ in self._quantities]
        self._factors = [factor for _, _, factor in self._quantities]
        for quantity, _, _ in self._quantities:
            setattr(self._message, quantity, [0.0])
        stamp = self._message.header.stamp
        self._prepared = PreparedMessage.find(self.publisher, self._message, [
            ('i', partial(setattr, stamp, 'sec')), ('I', partial(setattr, stamp, 'nanosec')),
            *(('d', partial(getattr(self._message, quantity).__setitem__, 0))
              for quantity, _, _ in self._quantities)])

    def publish(self, values: Sequence[Value], stamp: Stamp) -> None:
        """Publish one sample: only the values that arrived, and nothing without any."""
        present = len(values)
        if self._prepared is not None and present > max(self._slots):
            self._prepared.publish((*stamp, *(
                values[slot] * factor for slot, factor in zip(self._slots, self._factors))))
            return
        if present <= min(self._slots):
            return
        self._message.header.stamp = Time(sec=stamp[0], nanosec=stamp[1])
        for quantity, slot, factor in self._quantities:
            setattr(self._message, quantity, [values[slot] * factor] if slot < present else [])
        self.publisher.publish(self._message)


class BitTopics:
    """``~/<parameter>/<bit>``: the named bits of one parameter, latched, on change."""

    def __init__(self, node: Node, parameter: Parameter, slot: int) -> None:
        self.slot = slot
        self._last: int | None = None
        self._bits = [(1 << bit, publisher(node, Bool, f'~/{parameter.name}/{name}',
                                           latched_quality()))
                      for name, bit in parameter.bits]

    def update(self, raw: int) -> None:
        """Publish the bits that differ from the last sample; all of them the first time."""
        last = self._last
        if raw == last:
            return
        self._last = raw
        for mask, topic in self._bits:
            if last is None or (raw ^ last) & mask:
                topic.publish(Bool(data=bool(raw & mask)))

    def forget(self) -> None:
        """Publish all bits with the next sample: the drive was away."""
        self._last = None


class SamplePublisher:
    """
    Everything that is published once per exchange of one drive.

    :param parameters: of a sample, in the order of its raw integers: those that the family has
        built in, which have topics of their own but no part in ``~/response``, and then
        ``cyclic_response``.
    :param stamp: (receive time of the steady clock) -> seconds and nanoseconds; asked once for
        each sample, when it arrives: the clock may be set before another reader needs it.
    :param inform: logs what people should know.
    :ivar last: the raw integers of the last sample (the position of a ``continuous`` joint without
        wraps), its receive time and its stamp, in one,
        because other threads look at them; None: the drive is gone.
    """

    def __init__(self, node: Node, drive: DriveConfiguration, parameters: tuple[Parameter, ...],
                 stamp: Callable[[float], Stamp],
                 inform: Callable[[str], None] = lambda text: None) -> None:
        self._stamp = stamp
        self._inform = inform
        self._converters = [parameter.value_from_raw for parameter in parameters]
        self._values = [ValueTopic(node, parameter, slot)
                        for slot, parameter in enumerate(parameters)]
        mapped = drive.cyclic_response
        self._samples: list[EventTopic | JointTopic] = [
            EventTopic(node, '~/response', mapped, len(parameters) - len(mapped))]
        joint = self._joint = drive.joint
        self._continuous = (ContinuousPosition(joint, parameters)
                            if joint is not None and joint.continuous else None)
        if joint is not None and (joint.position or joint.velocity or joint.effort):
            self._samples.append(JointTopic(node, joint, parameters))
        self._bits = [BitTopics(node, parameter, slot)
                      for slot, parameter in enumerate(parameters) if parameter.bits]
        self._wanted_values: list[ValueTopic] = []
        self._wanted_samples: list[EventTopic | JointTopic] = []
        self._count_at = 0.0
        self.last: tuple[tuple[int, ...], float, Stamp] | None = None

    def publish(self, raws: tuple[int, ...], received_at: float) -> None:
        """Publish one sample."""
        if received_at >= self._count_at:
            self._look_who_subscribes(received_at)
        stamp = self._stamp(received_at)
        turned = raws if self._continuous is None else self._without_wraps(raws)
        self.last = turned, received_at, stamp
        if self._wanted_values or self._wanted_samples:
            values = [convert(raw) for convert, raw in zip(self._converters, raws)]
            present = len(values)
            for sample in self._wanted_samples:     # first: these are the stamped ones
                if turned is not raws and isinstance(sample, JointTopic):
                    sample.publish([convert(raw) for convert, raw in zip(
                        self._converters, turned)], stamp)
                else:
                    sample.publish(values, stamp)
            for topic in self._wanted_values:
                if topic.slot < present:
                    topic.publish(values[topic.slot])
        for bits in self._bits:
            if bits.slot < len(raws):
                bits.update(raws[bits.slot])

    def forget(self) -> None:
        """Record that the drive is offline: nothing known of it is current."""
        self.last = None
        self.begin_again()
        for bits in self._bits:
            bits.forget()

    def begin_again(self) -> None:
        """Restart the position of a joint from the drive: it was homed, or offline."""
        if self._continuous is not None:
            self._continuous.begin_again()

    def _without_wraps(self, raws: tuple[int, ...]) -> tuple[int, ...]:
        """Return a sample in which the position of the joint has no wraps."""
        continuous, joint = self._continuous, self._joint
        if continuous is None or joint is None or continuous.slot >= len(raws):
            return raws
        slot = continuous.slot
        raw = continuous.take(raws[slot])
        if continuous.begun_again and joint.position is not None:
            self._inform(position_began_again(
                joint=joint.name, position=self._converters[slot](raw)
                * joint.factors[joint.position]))
        return (*raws[:slot], raw, *raws[slot + 1:])

    def _look_who_subscribes(self, now: float) -> None:
        self._count_at = now + COUNT_PERIOD
        self._wanted_values = [topic for topic in self._values
                               if topic.publisher.get_subscription_count()]
        self._wanted_samples = [topic for topic in self._samples
                                if topic.publisher.get_subscription_count()]
