# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Values of one moment in one message: ``~/response`` and ``~/request`` of a drive."""

from collections.abc import Sequence
from functools import partial

from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterEvent
from rclpy.node import Node

from drive_can_bridge.core.last_sent import LastSent
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.ros.prepared import NUMBER_CODES, PreparedMessage
from drive_can_bridge.ros.quality import Audience, publisher, state_quality
from drive_can_bridge.ros.stamps import Stamp, Stamps
from drive_can_bridge.ros.values import converters, parameter_value, VALUE_FIELDS


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
    """``~/request``: what a drive was told last. Nothing is built without a subscriber."""

    def __init__(self, node: Node, sent: LastSent, stamps: Stamps) -> None:
        self._sent = sent
        self._stamps = stamps
        self._converters = converters(sent.parameters)
        self._topic = EventTopic(node, '~/request', sent.parameters)
        self._audience = Audience(self._topic.publisher)

    def publish(self, sent_at: float) -> None:
        """Publish it, if anything was sent since activation."""
        raws = self._sent.raws
        if not self._audience.listens(sent_at) or all(raw is None for raw in raws):
            return
        self._topic.publish([None if raw is None else convert(raw)
                             for convert, raw in zip(self._converters, raws)],
                            self._stamps.at(sent_at))
