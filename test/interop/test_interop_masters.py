# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Masters that nobody here wrote drive simulated drives of CiA 402: two packages, each in its way.

``canopen-asyncio`` (2.4.1) asks two drives at once, by coroutines; ``uc2canopen`` (0.2.3) has an
SDO client and a listener of its own, and waits 10 ms between two requests. Without them these
tests skip.
"""

import asyncio
from collections.abc import Iterator
from typing import Any

from canopen_bench import by_the_clock_of, connect, Loop
from interop_bridge import dictionary_of
from interop_servo import bus_of, NODE, PERIOD, servo_configuration
import pytest
from waiting import clock, pause, wait_for
from world import World

from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation

NODES = {'axis': NODE, 'other': NODE + 1}
#: speed that is commanded, increments/s
SPEED = 5000


@pytest.fixture
def servos(channel: str) -> Iterator[dict[str, PlayedDrive]]:
    """Return two simulated drives on the bus, as they leave the factory."""
    with Simulation(BridgeConfiguration(buses={'main': bus_of(channel)}, drives={
            name: servo_configuration(name=name, station=node) for name, node in NODES.items()}),
            clock()) as simulation:
        yield simulation.drives
    assert not simulation.failure
    assert not any(drive.violations for drive in simulation.drives.values())


# -- canopen-asyncio ------------------------------------------------------------------------------


@pytest.fixture
def nodes(channel: str, world: World, servos: dict[str, PlayedDrive],
          ) -> Iterator[tuple[Loop, list[Any]]]:
    """Return an event loop, and the drives as a master sees them that runs in it."""
    package = pytest.importorskip('canopen_asyncio')
    od = pytest.importorskip('canopen_asyncio.objectdictionary')
    variables = {
        0x1017: ('heartbeat', od.UNSIGNED16), 0x6040: ('control', od.UNSIGNED16),
        0x6041: ('status', od.UNSIGNED16), 0x6060: ('mode', od.INTEGER8),
        0x6064: ('position', od.INTEGER32), 0x606C: ('velocity', od.INTEGER32),
        0x60FF: ('target', od.INTEGER32)}
    # no optional sub-indices: refused, they end its read() (findings/canopen_asyncio_….sh)
    communication = {0: od.UNSIGNED8, 1: od.UNSIGNED32, 2: od.UNSIGNED8}
    mapping = {0: od.UNSIGNED8, **dict.fromkeys(range(1, 9), od.UNSIGNED32)}
    records = {0x1400: communication, 0x1600: mapping, 0x1800: communication, 0x1A00: mapping}
    with by_the_clock_of(world, 'canopen_asyncio'):
        loop = Loop(world.clock)
        network = package.Network(loop=loop)
        connect(network, world, channel)
        made = [package.RemoteNode(node, dictionary_of(variables, records, od))
                for node in NODES.values()]
        for node in made:
            network[node.id] = node
        yield loop, made
        network.sync.stop()
        network.disconnect()
        loop.close()


async def set_up(node: Any) -> None:
    """Map its PDOs, start it and enable it by them."""
    node.nmt.state = 'PRE-OPERATIONAL'
    await node.sdo['heartbeat'].aset_raw(100)
    await node.nmt.await_for_heartbeat()
    for pdo, variables in ((node.rpdo[1], ('control', 'target')),
                           (node.tpdo[1], ('status', 'velocity'))):
        await pdo.aread()
        pdo.clear()
        for name in variables:
            pdo.add_variable(name)
        pdo.trans_type = 1
        pdo.enabled = True
        await pdo.asave()
    await node.sdo['mode'].aset_raw(9)
    node.nmt.state = 'OPERATIONAL'


async def enable(node: Any) -> None:
    """Bring it to operation enabled, and have it run."""
    node.rpdo[1].start(PERIOD)
    for word, state in ((6, 0x21), (7, 0x23), (15, 0x27)):
        node.rpdo[1]['control'].raw = word
        while node.tpdo[1]['status'].raw & 0x6F != state:
            await node.tpdo[1].await_for_reception(1.0)
    node.rpdo[1]['target'].raw = SPEED
    while node.tpdo[1]['velocity'].raw != SPEED:
        await node.tpdo[1].await_for_reception(1.0)


def test_two_are_asked_at_once_by_coroutines(nodes: tuple[Loop, list[Any]],
                                             servos: dict[str, PlayedDrive]) -> None:
    loop, made = nodes

    async def story() -> None:
        network = made[0].network
        await asyncio.gather(*map(set_up, made))
        network.sync.start(PERIOD)
        await asyncio.gather(*map(enable, made))
        # each its own answers, while both go on
        before = await asyncio.gather(*(node.sdo['position'].aget_raw() for node in made))
        for _ in range(20):
            read = await asyncio.gather(*(
                node.sdo[name].aget_raw() for node in made for name in ('mode', 'velocity')))
            assert read == [9, SPEED, 9, SPEED]
        after = await asyncio.gather(*(node.sdo['position'].aget_raw() for node in made))
        assert all(second > first for first, second in zip(before, after, strict=True))
        # one is reset: the other goes on
        boots = asyncio.ensure_future(made[0].nmt.await_for_bootup(1.0))
        await asyncio.sleep(0.01)
        made[0].rpdo[1].stop()
        made[0].nmt.state = 'RESET'
        await boots
        assert await made[0].sdo['status'].aget_raw() & 0x6F != 0x27
        await asyncio.sleep(0.5)
        assert made[1].tpdo[1]['velocity'].raw == SPEED
        # a fault is heard by whoever waits for it
        waits = asyncio.ensure_future(made[1].emcy.async_wait(0x2310, 1.0))
        await asyncio.sleep(0.01)
        servos['other'].fault('trip')
        assert (await waits).code == 0x2310
    loop.run_until_complete(story())


def test_a_refusal_ends_a_coroutine(nodes: tuple[Loop, list[Any]]) -> None:
    aborted = pytest.importorskip('canopen_asyncio').SdoAbortedError
    loop, (node, _) = nodes

    async def story() -> None:
        for index, subindex, code in ((0x5000, 0, 0x06020000), (0x1018, 9, 0x06090011)):
            with pytest.raises(aborted) as refused:
                await node.sdo.aupload(index, subindex)
            assert refused.value.code == code
        with pytest.raises(aborted) as refused:
            await node.sdo.adownload(0x6041, 0, b'\0\0')
        assert refused.value.code == 0x06010002
        # segments
        assert await node.sdo.aupload(0x1008, 0) == b'simulated CiA 402 servo drive'
    loop.run_until_complete(story())


# -- uc2canopen -----------------------------------------------------------------------------------


@pytest.fixture
def client(channel: str, world: World, servos: dict[str, PlayedDrive]) -> Iterator[Any]:
    """Return the client of the other package, on the bus."""
    package = pytest.importorskip('uc2canopen')
    with by_the_clock_of(world, 'uc2canopen'):
        made = package.UC2Client(interface='socketcan', channel=channel)
        yield made
        made.close()


def test_a_client_of_its_own_finds_drives_and_runs_one(
        client: Any, servos: dict[str, PlayedDrive]) -> None:
    sdo, state = client._sdo, client.state
    for node in NODES.values():
        sdo.write_u16(node, 0x1017, 0, 100)
    assert state.scan_nodes(0.5) == list(NODES.values())
    for command, says in ((state.start_node, 5), (state.stop_node, 4), (state.reset_node, 0)):
        command(NODE)
        wait_for(lambda says=says: client._listener.get_node(NODE).nmt_state == says, f'{says}')
    assert sdo.read_u32(NODE, 0x1000, 0) & 0xFFFF == 402
    sdo.write_u8(NODE, 0x6060, 0, 9)
    state.start_node(NODE)
    sdo.write_i32(NODE, 0x60FF, 0, SPEED)
    for word, shown in ((6, 0x21), (7, 0x23), (15, 0x27)):
        sdo.write_u16(NODE, 0x6040, 0, word)
        wait_for(lambda shown=shown: sdo.read_u16(NODE, 0x6041, 0) & 0x6F == shown, f'{shown:X}')
    wait_for(lambda: sdo.read_i32(NODE, 0x606C, 0) == SPEED, 'the speed')
    assert sdo.read_u16(NODE + 1, 0x6041, 0) & 0x6F == 0x40
    sdo.write_u16(NODE, 0x6040, 0, 2)
    wait_for(lambda: sdo.read_i32(NODE, 0x606C, 0) == 0, 'standstill')


def test_what_is_no_drive_of_its_maker_refuses_and_stands(
        client: Any, servos: dict[str, PlayedDrive]) -> None:
    error = pytest.importorskip('uc2canopen').SdoError
    client.state.start_node(0)
    for ask in (lambda: client.motor.move(position=1000, node_id=NODE),
                lambda: client.motor.stop(node_id=NODE),
                lambda: client.state.get_uptime(NODE)):
        with pytest.raises(error) as refused:
            ask()
        assert refused.value.abort_code == 0x06020000
    with pytest.raises(error) as refused:
        client._sdo.write_u32(NODE, 0x6040, 0, 15)
    assert refused.value.abort_code == 0x06070012
    client.send_sync()
    pause(0.1)
    assert client._sdo.read_i32(NODE, 0x606C, 0) == 0
