# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive sends that is offline is named, and heartbeats of other lengths."""

from typing import Any

import pytest
from saying import says
from servo_builders import Axis, POSITION, VELOCITY
from stacks import odd_heartbeats

from drive_can_bridge.core.events import FrameRejected, StationLost
from drive_can_bridge.protocols.canopen.network import decode_heartbeat, NmtState


class Deaf(Axis):
    """A drive that answers no SDO any more, and says what the test has it say."""

    def offline(self) -> 'Deaf':
        self.online()
        self.drive.takes = lambda sent: []  # type: ignore[method-assign]
        self.mute = True
        self.live(4.0)
        assert not self.session.online
        return self

    def sends(self, *texts: str) -> Any:
        """Have it send something each 0.1 s for a while; return the advice."""
        for _ in range(10):
            for text in texts:
                self.says(text)
            self.live(0.1)
        return self.session.offline_advice


class TestHeard:

    def test_silence_is_silence(self) -> None:
        axis = Deaf().offline()
        assert axis.session.offline_advice == says('set_up_unanswered')

    @pytest.mark.parametrize(('texts', 'advice'), [
        (['705#7F', '085#0010010000000000'],
         'answers, but is pre-operational: emergency 1000h, register 01h'),
        (['705#7F'], 'answers, but is pre-operational'),
        (['705#05'], 'answers, but there is no complete set of PDOs'),
        (['085#3081110000000000'],
         'answers, but there is no complete set of PDOs: emergency 8130h, register 11h'),
        (['185#5002'], 'TPDO 1 has 2 bytes instead of 6'),
        (['585#4041'],
         'answers, but not as CANopen has it: SDO with 2 data bytes instead of 4'),
        (['705#33'], 'answers, but not as CANopen has it: heartbeat with unknown state 33h')])
    def test_what_comes_in_is_named(self, texts: list[str], advice: str) -> None:
        axis = Deaf().offline()
        assert axis.sends(*texts) == advice
        axis.live(5.0)      # and forgotten when it does not any more
        assert axis.session.offline_advice.code == 'set_up_unanswered'

    def test_one_that_passes_over_what_it_lacks(self) -> None:
        axis = Axis()
        takes = axis.drive.takes
        axis.drive.takes = (        # type: ignore[method-assign]
            lambda sent: [] if sent.data[1:4] == b'\x5B\x60\0' else takes(sent))
        axis.start()
        axis.live(3.0)
        assert axis.session.offline_advice == says('object_unanswered', what='605Bh.00h')

    def test_what_came_before_it_was_lost_does_not_count(self) -> None:
        axis = Deaf().online()
        axis.mute = True
        axis.drive.takes = lambda sent: []  # type: ignore[method-assign]
        axis.live(0.5)
        assert not axis.session.online
        assert 'answers' not in axis.session.offline_advice

    def test_of_one_with_two_pdos_the_first_is_too_short(self) -> None:
        axis = Axis(request_pdos=(1,), response_pdos=(1, 2), response=(
            POSITION, VELOCITY))
        responses = axis.drive.responses

        def short(*kinds: int) -> Any:
            return [each._replace(data=each.data[:2]) if each.identifier == 0x185 else each
                    for each in responses(*kinds)]
        axis.drive.responses = short    # type: ignore[method-assign]
        axis.start()
        axis.live(1.0)
        assert not axis.session.online
        assert axis.session.offline_advice == says('pdo_length', number=1, found=2, wanted=6)


class TestHeartbeats:

    @pytest.mark.parametrize('length', [0, 8])
    def test_it_is_driven(self, length: int) -> None:
        axis = Axis()
        odd_heartbeats(axis, length)
        axis.start()
        axis.live(5.0)
        assert axis.session.online
        assert (axis.session.warning == says('heartbeat_without_content')) is (length == 0)
        told = [each.text for each in axis.talk.events(FrameRejected)]
        assert told == ([] if length else [says('heartbeat_without_content')])
        assert axis.session._node.state is (NmtState.OPERATIONAL if length else None)

    def test_one_with_eight_bytes_is_watched_by_its_first(self) -> None:
        axis = Axis()
        odd_heartbeats(axis, 8)
        axis.online()
        axis.drive.objects[0x1017, 0] = bytes(2)
        axis.live(0.5)
        assert [lost.reason for lost in axis.talk.events(StationLost)] == [
            says('no_heartbeat', timeout=0.35)]

    def test_one_that_booted_and_says_nothing_since_is_not_watched(self) -> None:
        axis = Axis()
        odd_heartbeats(axis, 0)
        axis.start()
        axis.says('705#00')
        axis.live(5.0)
        assert axis.session.online

    def test_words(self) -> None:
        axis = Axis()
        odd_heartbeats(axis, 0)
        axis.start()
        assert axis.session.warning == (
            'heartbeat without content: this drive cannot be watched by it')

    def test_the_first_of_eight_bytes_is_the_state(self) -> None:
        assert decode_heartbeat(bytes.fromhex('0500000000000000')) is NmtState.OPERATIONAL
