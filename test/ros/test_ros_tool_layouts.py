# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The layouts of PlotJuggler and rqt for the demo: readable, and about topics that it has."""

import ast
from collections.abc import Iterator
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from bridges import StartBridge
from clients import Client
import pytest

CONFIG = Path(__file__).parents[2] / 'config'
NUMERIC = {'std_msgs/msg/Float64', 'std_msgs/msg/Int64', 'std_msgs/msg/Bool'}


@pytest.fixture(name='topics')
def _topics(bridge: StartBridge, client: Client) -> dict[str, str]:
    """Return the types of all topics of the demo, by name."""
    text = (CONFIG / 'demo.yaml').read_text(encoding='utf-8')
    one = bridge(text.replace('channel: demo', 'channel: ros_test_layouts')).online()
    client.find(one.node, *one.node.drives)
    return {name: types[0] for drive in one.node.drives
            for name, types in client.node.get_publisher_names_and_types_by_node(drive, '/')}


def test_plotjuggler(topics: dict[str, str]) -> None:
    root = ElementTree.parse(CONFIG / 'demo_plotjuggler.xml').getroot()
    drawn = {str(curve.get('name')) for curve in root.iter('curve')}
    assert len(drawn) > 9
    for name in drawn:
        topic, _, member = name.rpartition('/')
        assert member == 'data' and topics[topic] in NUMERIC, name
    [selected] = root.iter('selected_topics')
    assert str(selected.get('value')).split(';') == list(dict.fromkeys(
        str(curve.get('name')).removesuffix('/data') for curve in root.iter('curve')))
    [streamer] = root.iter('previouslyLoaded_Streamer')
    assert streamer.get('name') in {plugin.get('ID') for plugin in root.iter('plugin')}
    for splitter in root.iter('DockSplitter'):
        count = int(str(splitter.get('count')))
        assert count == len(splitter) == len(str(splitter.get('sizes')).split(';'))


def test_rqt(topics: dict[str, str], client: Client) -> None:
    with (CONFIG / 'demo_rqt.perspective').open(encoding='utf-8') as file:
        perspective = json.load(file)
    values = dict(entries(perspective))
    running = values['/pluginmanager/running-plugins']
    assert all(numbers == [1] for numbers in running.values())
    plugins = {'plugin__' + name.replace('/', '__') + '__1' for name in running}
    assert set(perspective['groups']['pluginmanager']['groups']) <= plugins
    plotted = values['/pluginmanager/plugin__rqt_plot__Plot__1/plugin/topics']
    assert plotted
    for name in plotted:
        topic, _, member = name.rpartition('/')
        assert member == 'data' and topics[topic] in NUMERIC, name
    selected = values['/pluginmanager/plugin__rqt_reconfigure__Param__1/plugin/selected_nodes']
    assert set(selected) <= set(client.nodes())


def entries(group: dict[str, Any], path: str = '') -> Iterator[tuple[str, Any]]:
    """Read what rqt wrote: keys and groups, each value as the text that makes it."""
    assert set(group) <= {'keys', 'groups'}
    for key, value in group.get('keys', {}).items():
        assert value['type'] == 'repr'
        yield f'{path}/{key}', ast.literal_eval(value['repr'])
    for name, below in group.get('groups', {}).items():
        yield from entries(below, f'{path}/{name}')
