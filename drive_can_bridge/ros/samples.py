# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Publish samples: the fast path from a decoded frame to the ROS graph.

Runs in the thread that received the frame, up to thousands of times a second. So messages are
prebuilt and only their fields are set, and what nobody subscribes to is not built at all: the
subscription counts are looked up every ``COUNT_PERIOD``, not for every message.
"""

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterEvent
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from drive_can_bridge.configuration.model import DriveConfiguration, JointConfiguration
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.ros.quality import latched_quality, overriding, state_quality
from drive_can_bridge.ros.values import parameter_value, TOPIC_TYPES, VALUE_FIELDS

#: s between two looks at who subscribes
COUNT_PERIOD = 0.1


class ValueTopic:
    """``~/<parameter>``: one value once per exchange."""

    def __init__(self, node: Node, parameter: Parameter, slot: int) -> None:
        topic = f'~/{parameter.name}'
        message_type = TOPIC_TYPES[parameter.kind]
        self.publisher: Publisher = node.create_publisher(
            message_type, topic, state_quality(),
            qos_overriding_options=overriding(node, topic))
        self.message = message_type()
        self.slot = slot

    def publish(self, values: list[Value], _: Any) -> None:
        self.message.data = values[self.slot]
        self.publisher.publish(self.message)


class ResponseTopic:
    """``~/response``: all mapped response parameters of one exchange, stamped."""

    def __init__(self, node: Node, parameters: tuple[Parameter, ...]) -> None:
        self.publisher: Publisher = node.create_publisher(
            ParameterEvent, '~/response', state_quality(),
            qos_overriding_options=overriding(node, '~/response'))
        self._entries = [
            ParameterMessage(name=parameter.name, value=parameter_value(
                parameter, parameter.value_from_raw(0))) for parameter in parameters]
        self._fields = [(entry.value, VALUE_FIELDS[parameter.kind])
                        for entry, parameter in zip(self._entries, parameters)]
        self._message = ParameterEvent(node=node.get_fully_qualified_name(),
                                       changed_parameters=self._entries)

    def publish(self, values: list[Value], stamp: Any) -> None:
        message = self._message
        message.stamp = stamp
        for (entry, field), value in zip(self._fields, values):
            setattr(entry, field, value)
        if len(values) == len(self._entries):
            self.publisher.publish(message)
            return
        message.changed_parameters = self._entries[:len(values)]  # only what arrived
        self.publisher.publish(message)
        message.changed_parameters = self._entries


class JointTopic:
    """``~/joint_state``: SI units, stamped with the receive time."""

    def __init__(self, node: Node, joint: JointConfiguration,
                 parameters: tuple[Parameter, ...]) -> None:
        self.publisher: Publisher = node.create_publisher(
            JointState, '~/joint_state', state_quality(),
            qos_overriding_options=overriding(node, '~/joint_state'))
        slots = {parameter.name: slot for slot, parameter in enumerate(parameters)}
        self._message = JointState(name=[joint.name])
        self._quantities = [
            (quantity, slots[name], joint.factors[name])
            for quantity, name in (('position', joint.position), ('velocity', joint.velocity),
                                   ('effort', joint.effort)) if name is not None]
        self._first = min((slot for _, slot, _ in self._quantities), default=0)

    def publish(self, values: list[Value], stamp: Any) -> None:
        present = len(values)
        if present <= self._first:
            return
        self._message.header.stamp = stamp
        for quantity, slot, factor in self._quantities:  # only what arrived
            setattr(self._message, quantity, [values[slot] * factor] if slot < present else [])
        self.publisher.publish(self._message)


class BitTopics:
    """``~/<parameter>/<bit>``: the named bits of one parameter, latched, on change."""

    def __init__(self, node: Node, parameter: Parameter, slot: int) -> None:
        self.slot = slot
        self._last: int | None = None
        self._bits = []
        for name, bit in parameter.bits:
            topic = f'~/{parameter.name}/{name}'
            publisher = node.create_publisher(
                Bool, topic, latched_quality(), qos_overriding_options=overriding(node, topic))
            self._bits.append((1 << bit, publisher))

    def update(self, raw: int) -> None:
        """Publish the bits that differ from the last sample; all of them the first time."""
        last = self._last
        if raw == last:
            return
        self._last = raw
        for mask, publisher in self._bits:
            if last is None or (raw ^ last) & mask:
                publisher.publish(Bool(data=bool(raw & mask)))

    def forget(self) -> None:
        """Publish all bits with the next sample: the drive was away."""
        self._last = None


class SamplePublisher:
    """
    Everything that is published once per exchange of one drive.

    :param stamp: (receive time of the steady clock) -> builtin_interfaces/Time.
    """

    def __init__(self, node: Node, drive: DriveConfiguration,
                 stamp: Callable[[float], Any]) -> None:
        parameters = drive.cyclic_response
        self._parameters = parameters
        self._stamp = stamp
        self._converters = [
            parameter.value_from_raw if not parameter.scaled
            else _scaler(parameter.scale, parameter.offset) for parameter in parameters]
        self._values = [ValueTopic(node, parameter, slot)
                        for slot, parameter in enumerate(parameters)]
        self._samples: list[ResponseTopic | JointTopic] = [ResponseTopic(node, parameters)]
        joint = drive.joint
        if joint is not None and (joint.position or joint.velocity or joint.effort):
            self._samples.append(JointTopic(node, joint, parameters))
        self._bits = [BitTopics(node, parameter, slot)
                      for slot, parameter in enumerate(parameters) if parameter.bits]
        self._wanted_values: list[ValueTopic] = []
        self._wanted_samples: list[ResponseTopic | JointTopic] = []
        self._count_at = 0.0
        self._last_raws: tuple[int, ...] = ()

    def publish(self, raws: tuple[int, ...], received_at: float) -> None:
        """Publish one sample."""
        if received_at >= self._count_at:
            self._look_who_subscribes(received_at)
        self._last_raws = raws
        if self._wanted_values or self._wanted_samples:
            values = [convert(raw) for convert, raw in zip(self._converters, raws)]
            present = len(values)
            if self._wanted_samples:  # first: these are the stamped ones, others wait for them
                stamp = self._stamp(received_at)
                for sample in self._wanted_samples:
                    sample.publish(values, stamp)
            for topic in self._wanted_values:
                if topic.slot < present:
                    topic.publish(values, None)
        for bits in self._bits:
            if bits.slot < len(raws):
                bits.update(raws[bits.slot])

    def latest(self) -> dict[str, Value]:
        """Return the values of the last sample, by parameter name (for views)."""
        return {parameter.name: parameter.value_from_raw(raw)
                for parameter, raw in zip(self._parameters, self._last_raws)}

    def forget(self) -> None:
        """Take note that the drive is gone: nothing known of it is current."""
        self._last_raws = ()
        for bits in self._bits:
            bits.forget()

    def _look_who_subscribes(self, now: float) -> None:
        self._count_at = now + COUNT_PERIOD
        self._wanted_values = [topic for topic in self._values
                               if topic.publisher.get_subscription_count()]
        self._wanted_samples = [topic for topic in self._samples
                                if topic.publisher.get_subscription_count()]


def _scaler(scale: float, offset: float) -> Callable[[int], float]:
    if offset:
        return lambda raw: raw * scale + offset
    return lambda raw: raw * scale
