# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive is told before its first PDO, and what is said where it does not fit."""

from typing import Any

from builders import INT16, parameter, write
import pytest
from saying import says
from servo_builders import Axis, FITS, POSITION, TABLE, TORQUE, VELOCITY
from stacks import EightEntries, SignedLengths, WatchesOnce

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, MappingDiffered, Noted
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.protocols.canopen.sdo import describe
from drive_can_bridge.protocols.cia402.node_set_up import interpolation_time
from drive_can_bridge.protocols.cia402.states import ServoState

RPDO, TPDO = (0x1400, 1), (0x1800, 1)


def meet(mode: str = 'csv', objects: dict[Any, Any] | None = None, *,
         refuses: dict[tuple[int, int], int] | None = None,
         lacks: tuple[int, int] | None = None, **options: Any) -> Axis:
    """
    Look for a drive.

    :param refuses: what it does not let be written, and its codes.
    :param lacks: an object that it does not have.
    """
    axis = Axis(mode, objects, **options)
    axis.drive.fixed = refuses or {}
    if lacks is not None:
        del axis.drive.objects[lacks]
    axis.start()
    return axis


def written(axis: Axis) -> list[str]:
    """Return what was written by SDO, the command left out."""
    return [text[6:] for text in axis.take() if text.startswith('605#2')]


def differs(axis: Axis) -> Sentence:
    assert axis.session.state is DriveState.MAPPING_DIFFERS
    assert not any(text.startswith('205#') for text in axis.take())
    told, = axis.talk.events(MappingDiffered)
    return told.text


def notes(axis: Axis) -> list[str]:
    return [note.text for note in axis.talk.events(Noted) if note.warning]


class TestConfigure:

    def test_in_the_order_of_the_notes_each_read_back(self) -> None:
        axis = meet()
        assert axis.session.online
        sent = axis.take()
        first = sent.index('605#4000140100000000')
        assert sent[sent.index('000#8005'):first]       # pre-operational before
        assert sent[first:first + 15] == [
            '605#4000140100000000', '605#4000140200000000', '605#2300140105020080',
            '605#4000160000000000',
            '605#2F00160000000000', '605#2300160110004060', '605#230016022000FF60',
            '605#2F00160002000000', '605#2F00140201000000', '605#2300140105020000',
            '605#4000140100000000', '605#4000140200000000', '605#4000160000000000',
            '605#4000160100000000', '605#4000160200000000']
        assert sent.index('000#0105') > sent.index('605#2F60600009000000')

    def test_bits_29_and_30_stay_as_they_were_read(self) -> None:
        axis = meet(objects={RPDO: bytes.fromhex('05020040')})
        assert '00140105020040' in written(axis)
        assert axis.session.online

    def test_what_fits_is_not_written(self) -> None:
        axis = meet(objects=FITS)
        assert axis.session.online
        assert written(axis) == ['17100064000000', '60600009000000', '16100158027F00']

    @pytest.mark.parametrize('padding', [b'\0', b'\xFF'])
    def test_nor_where_the_drive_does_not_tell_how_long_it_is(self, padding: bytes) -> None:
        axis = Axis(objects={
            **FITS, (0x1017, 0): b'\x64\0', (0x1019, 0): b'\0', (0x60C2, 1): b'\x0A',
            (0x60C2, 2): b'\xFD', (0x605A, 0): b'\xFE\xFF', (0x6007, 0): bytes(2)})
        sdo = axis.drive._sdo

        def untold(data: bytes) -> bytes:
            found = sdo(data)
            count = 4 - (found[0] >> 2 & 3)
            return found if found[0] >> 5 != 2 else (
                b'\x42' + found[1:4 + count] + (4 - count) * padding)
        axis.drive._sdo = untold        # type: ignore[method-assign]
        axis.start()
        assert axis.session.online, axis.session.offline_advice
        assert written(axis) == ['60600009000000', '16100158027F00']
        assert '(605Ah = -2)' in axis.session.facts()['stops_by']
        assert says('nothing_stops') in notes(axis)

    def test_a_fixed_mapping_that_fits(self) -> None:
        axis = meet(objects=FITS, refuses=dict.fromkeys(FITS, 0x06010000))
        assert axis.session.online

    def test_a_fixed_mapping_that_does_not(self) -> None:
        axis = meet(refuses={(0x1600, 1): 0x06040041})
        text = differs(axis)
        assert text == says('object_refused', what='1600h.01h', why=describe(0x06040041))
        assert text.startswith('1600h.01h (control_word, 6040h.00h) refused by the drive: ')
        axis.drive.fixed.clear()
        axis.live(1.1)
        assert axis.session.online      # looked at again

    def test_pdos_that_are_not_needed_are_made_invalid(self) -> None:
        axis = meet(objects={(0x1401, 1): bytes.fromhex('05030000'),
                             (0x1803, 1): bytes.fromhex('85040040')})
        sent = written(axis)
        assert '01140105030080' in sent
        assert '031801850400C0' in sent

    def test_a_type_1_that_an_rpdo_refuses(self) -> None:
        axis = Axis()
        axis.drive.fixed = {(0x1400, 2): 0x06090030}
        sdo = axis.drive._sdo

        def once(data: bytes) -> bytes:
            if data[:5] == bytes.fromhex('2F001402FF'):
                axis.drive.fixed.clear()
            return sdo(data)
        axis.drive._sdo = once          # type: ignore[method-assign]
        axis.start()
        sent = written(axis)
        assert sent.index('001402FF000000') == sent.index('00140201000000') + 1
        assert axis.session.online

    def test_a_type_1_that_a_tpdo_refuses(self) -> None:
        axis = meet(refuses={(0x1800, 2): 0x06090030})
        assert '1800h.02h' in differs(axis)

    def test_an_inhibit_time_that_is_refused_is_told_once(self) -> None:
        axis = meet('pv', {(0x1800, 3): bytes.fromhex('6400'), (0x1800, 5): bytes(2)},
                    refuses=fixed((0x1800, 3)), transmission='event')
        assert '00180332000000' in written(axis)
        said = notes(axis)
        assert [text for text in said if '1800h.03h' in text] == [
            says('object_refused', what='1800h.03h', why=describe(0x06010002))]
        axis.live(5.0)      # this drive sends nothing by itself: it is set up again and again
        assert written(axis).count('00180332000000') > 1
        assert not [text for text in notes(axis) if '1800h.03h' in text]

    def test_two_pdos_each_way(self) -> None:
        axis = meet(request_pdos=(1, 3), response_pdos=(2, 4), response=(
            POSITION, VELOCITY, TORQUE))
        assert axis.session.online
        sent = axis.take()
        assert '605#23011A0220006460' in sent
        assert '605#23031A0120006C60' in sent
        assert '605#23031A0210007760' in sent
        sample = axis.talk.samples()[-1]
        assert sample[1:] == (1000, 0, 0)

    def test_a_first_pdo_that_is_not_needed_is_made_invalid(self) -> None:
        axis = meet(objects={TPDO: bytes.fromhex('85010000')}, response_pdos=(2,))
        assert '00180185010080' in written(axis)
        assert axis.session.online


def fixed(*places: tuple[int, int]) -> dict[tuple[int, int], int]:
    """Return objects that refuse to be written."""
    return dict.fromkeys(places, 0x06010002)


class TestRemedy:
    """What is to be done about a drive that does not fit: only some of it has to do with maps."""

    COUNTS, NO_MODE = {(0x1019, 0): b'\x0A'}, {(0x6502, 0): bytes(4)}

    @pytest.mark.parametrize(('objects', 'refuses', 'options', 'remedy'), [
        # nothing was written
        (NO_MODE, {}, {}, 'drive_to_correct'),
        (COUNTS, {}, {}, 'drive_to_correct'),
        ({}, {}, {'nmt_start': False, 'heartbeat_producer': 0.0}, 'drive_to_correct'),
        # or not taken
        ({}, fixed((0x1800, 2)), {}, 'drive_to_correct'),
        ({}, fixed((0x1600, 1)), {}, 'maps_fixed'),
        ({}, fixed((0x1400, 1)), {}, 'maps_fixed'),
        ({}, fixed((0x1800, 1)), {}, 'maps_fixed'),
        ({}, fixed((0x6060, 0)), {}, 'drive_to_correct'),
        ({(0x1005, 0): bytes.fromhex('81000000')}, fixed((0x1005, 0)), {}, 'drive_to_correct'),
        ({(0x1800, 5): bytes(2)}, fixed((0x1800, 5)), {'transmission': 'event'},
         'drive_to_correct'),
        # where mapping: configure would write it
        ({}, {}, {'mapping': 'verify'}, 'maps_to_correct'),
        ({**FITS, (0x1006, 0): b'\1\0\0\0'}, {}, {'mapping': 'verify'}, 'maps_to_correct'),
        ({**FITS, (0x1016, 1): bytes.fromhex('8F017F00')}, {}, {'mapping': 'verify'},
         'maps_to_correct'),
        # where it would not help
        ({**FITS, **COUNTS}, {}, {'mapping': 'verify'}, 'drive_to_correct'),
        ({**FITS, **NO_MODE}, {}, {'mapping': 'verify'}, 'drive_to_correct'),
        ({**FITS, **NO_MODE}, {}, {'mapping': 'assume'}, 'drive_to_correct')])
    def test_what_to_do(self, objects: dict[Any, Any], refuses: dict[tuple[int, int], int],
                        options: dict[str, Any], remedy: str) -> None:
        axis = meet(objects=objects, refuses=refuses, **options)
        differs(axis)
        assert axis.session.remedy(axis.session.offline_advice) == says(
            remedy, why=says('mapping_differs'))

    def test_it_differs_while_it_is_looked_at_again(self) -> None:
        axis = meet(objects=self.NO_MODE)
        seen = set()
        deliver = axis.deliver

        def watch(sent: list[str]) -> None:
            seen.update((axis.session.state, axis.session.offline_advice.code) for _ in sent)
            deliver(sent)
        axis.deliver = watch  # type: ignore[method-assign]
        axis.live(2.5)
        assert sum('40026500' in text for text in axis.take()) > 1, 'it was looked at again'
        assert seen == {(DriveState.MAPPING_DIFFERS, 'mapping_differs')}
        axis.drive.objects[0x6502, 0] = bytes.fromhex('FFFFFFFF')
        axis.live(1.5)
        assert axis.session.online

    @pytest.mark.parametrize('lacks', [(0x1803, 1), (0x6041, 0), (0x6064, 0)])
    def test_an_object_that_it_lacks(self, lacks: tuple[int, int]) -> None:
        axis = meet('csp', lacks=lacks, response_pdos=(4,))
        differs(axis)
        assert axis.session.remedy('') == says('drive_to_correct')

    def test_a_map_that_it_takes_and_does_not_keep(self) -> None:
        axis = Axis()
        write = axis.drive.write
        axis.drive.write = (    # type: ignore[method-assign]
            lambda index, *rest: None if index == 0x1A00 else write(index, *rest))
        axis.start()
        assert '1A00h.00h' in differs(axis)
        assert axis.session.remedy('') == says('maps_not_kept')


class TestFaultReaction:

    REACTION, FAULT = bytes.fromhex('1F02'), bytes.fromhex('1802')

    def test_it_is_waited_for_before_anything_is_touched(self) -> None:
        axis = meet(objects={(0x6041, 0): self.REACTION})
        axis.live(0.5)
        told = axis.take()
        assert told.count('605#4041600000000000') > 10
        assert not [text for text in told if text.startswith(('000#', '605#2', '205#'))]
        assert notes(axis) == [says('found_braking', state=ServoState.FAULT_REACTION.value)]
        axis.drive.state = axis.drive.FAULT
        axis.drive.objects[0x6041, 0] = self.FAULT
        axis.live(0.5)
        assert '000#8005' in axis.take()
        assert axis.session.online
        assert axis.session.state is DriveState.FAULT

    def test_one_that_does_not_end_is_not_cycled(self) -> None:
        axis = meet(objects={(0x6041, 0): self.REACTION}, control_timeout=1.0)
        axis.live(5.0)
        assert not [text for text in axis.take() if text.startswith(('000#', '605#2', '205#'))]
        assert axis.session.offline_advice == says('found_braking')


class TestWithoutWriting:

    def test_verify_reads_only(self) -> None:
        axis = meet(objects=FITS, mapping='verify')
        assert axis.session.online
        assert written(axis) == ['17100064000000', '60600009000000']

    @pytest.mark.parametrize(('place', 'content', 'cycled'), [
        ((0x1400, 1), '05020040', True),        # bit 30 does not matter
        ((0x1400, 1), '05020080', False), ((0x1400, 1), '05020020', False),
        ((0x1400, 2), 'FF', True),              # nor the type of an RPDO
        ((0x1800, 2), 'FF', False), ((0x1600, 2), '10004260', False),
        ((0x1A00, 0), '01', False), ((0x1401, 1), '05030000', True),
        ((0x1005, 0), '80000040', False), ((0x1005, 0), '81000000', False),
        ((0x1006, 0), '10270000', True), ((0x1006, 0), '11270000', False),
        ((0x1019, 0), '0A', False), ((0x1019, 0), '00', True)])
    def test_what_verify_wants(self, place: tuple[int, int], content: str, cycled: bool) -> None:
        axis = meet(objects={**FITS, place: bytes.fromhex(content)}, mapping='verify')
        assert axis.session.online is cycled
        if not cycled:
            assert f'{place[0]:04X}h.{place[1]:02X}h' in differs(axis)

    def test_assume_does_not_look(self) -> None:
        axis = meet(objects=FITS, mapping='assume')
        assert axis.session.online
        assert not any(text[4:].startswith(('400014', '400018', '400510')) for text in axis.take())


class TestSync:

    def test_a_drive_that_produces_it_stops_doing_so(self) -> None:
        axis = meet(objects={(0x1005, 0): bytes.fromhex('80000040'),
                             (0x1006, 0): bytes.fromhex('20030000')})
        sent = written(axis)
        assert '05100080000000' in sent
        assert '06100010270000' in sent
        assert axis.session.online

    def test_one_that_counts(self) -> None:
        axis = meet(objects={(0x1019, 0): b'\x0A'})
        assert '1019h' in differs(axis)


class TestMode:

    def test_one_that_the_drive_does_not_offer(self) -> None:
        axis = meet(objects={(0x6502, 0): bytes.fromhex('25000000')})
        assert differs(axis) == says('mode_not_offered', mode='csv', number=9, offered=0x25)

    def test_no_6502h(self) -> None:
        assert meet(lacks=(0x6502, 0)).session.online

    @pytest.mark.parametrize(('period', 'sent'), [
        (0.01, ['C26002FD000000', 'C260010A000000']), (0.0005, ['C26002FC000000',
                                                                'C2600105000000'])])
    def test_interpolation_time(self, period: float, sent: list[str]) -> None:
        axis = meet(objects={(0x60C2, 1): b'\1', (0x60C2, 2): b'\xFE'}, period=period)
        assert [text for text in written(axis) if text.startswith('C260')] == sent

    def test_one_that_is_refused_is_told_and_nothing_else_happens(self) -> None:
        axis = meet(objects={(0x60C2, 1): b'\1', (0x60C2, 2): b'\xFE'},
                    refuses={(0x60C2, 1): 0x06090032})
        assert axis.session.online
        assert notes(axis) == [
            says('object_refused', what='60C2h.01h', why=describe(0x06090032))]

    def test_a_time_has_8_bits(self) -> None:
        assert interpolation_time(0.255) == (255, -3)
        assert interpolation_time(0.256) is None

    def test_a_period_that_it_cannot_say(self) -> None:
        axis = meet(objects={(0x60C2, 1): b'\1', (0x60C2, 2): b'\xFE'}, period=1 / 300)
        assert not [text for text in written(axis) if text.startswith('C260')]
        assert notes(axis) == [says('interpolation_time_left')]
        assert axis.session.online


class TestStopOptions:

    @pytest.mark.parametrize(('index', 'value'), [
        (0x605A, 99), (0x605B, 2), (0x605C, 99), (0x6007, 4)])
    def test_one_that_the_standard_does_not_have_is_a_warning(
            self, index: int, value: int) -> None:
        expected = says('stop_option_unknown', index=index, value=value)
        assert notes(meet(objects={(index, 0): bytes([value, 0])})).count(expected) == 1
        option = parameter('option', None, index=index, type=INT16)
        axis = meet(objects={(index, 0): b'\1\0'}, table=(*TABLE, option))
        assert not notes(axis)
        axis.deliver(axis.talk.submits(write((option, value)), axis.now))
        axis.live(0.2)
        assert notes(axis) == [expected]

    def test_negative_ones_are_the_makers_own(self) -> None:
        assert not notes(meet(objects={(0x605A, 0): b'\xFE\xFF', (0x6007, 0): b'\xFF\xFF'}))


class TestWatches:

    @pytest.mark.parametrize(('entries', 'wanted'), [
        (['00000000'], '16100158027F00'), (['64000100', '00000000'], '16100258027F00'),
        (['64000100', '64007F00'], '16100258027F00')])
    def test_where_the_bridge_is_entered(self, entries: list[str], wanted: str) -> None:
        axis = meet(objects={(0x1016, 0): bytes((len(entries),)), **{
            (0x1016, place): bytes.fromhex(text) for place, text in enumerate(entries, 1)}})
        sent = axis.log
        begun = next(at for at, text in sent if text == '77F#05')
        assert begun <= next(at for at, text in sent if text[6:] == wanted)
        assert says('nothing_stops') not in notes(axis)

    @pytest.mark.parametrize('objects', [
        {(0x1016, 1): bytes.fromhex('64000100')}, {(0x6007, 0): bytes(2)}, {(0x1016, 0): b'\0'}])
    def test_nothing_stops_it(self, objects: dict[Any, Any]) -> None:
        axis = meet(objects=objects)
        assert notes(axis).count(says('nothing_stops')) == 1
        assert axis.session.online
        assert axis.session.facts()['stops_by'].endswith('bridge lost: nothing')

    def test_what_users_write_is_learnt_again(self) -> None:
        option = parameter('abort_connection_option', None, index=0x6007, type=INT16)
        axis = meet(table=(*TABLE, option))
        assert says('nothing_stops') not in notes(axis)
        for value, text in ((0, 'nothing'), (3, 'quick stop (6007h = 3), by 1016h.01h')):
            axis.deliver(axis.talk.submits(write((option, value)), axis.now))
            axis.live(0.2)
            assert axis.session.facts()['stops_by'].endswith(f'bridge lost: {text}')
        assert notes(axis).count(says('nothing_stops')) == 1

    def test_no_1016h(self) -> None:
        assert says('nothing_stops') in notes(meet(lacks=(0x1016, 0)))

    def test_without_6007h_it_is_not_known(self) -> None:
        """Lely core 2.4.0 has none: it reports 8130h, and goes on at 60 rpm."""
        axis = meet(lacks=(0x6007, 0))
        axis.live(3.0)
        said = notes(axis)
        assert said.count(says('watch_unknown', why='no 6007h')) == 1
        assert says('nothing_stops') not in said
        assert 'bridge lost: not known (no 6007h)' in axis.session.facts()['stops_by']

    @pytest.mark.parametrize(('mapping', 'place'), [
        ('configure', '076000'), ('configure', '161000'), ('verify', '161000'),
        ('verify', '161001')])
    def test_a_refusal_is_no_absence(self, mapping: str, place: str) -> None:
        axis = Axis(objects=FITS, mapping=mapping)
        axis.drive.instead = {f'40{place}': f'80{place}22000008'}
        axis.start()
        told = notes(axis)
        assert says('nothing_stops') not in told and says('watch_unknown') in told

    @pytest.mark.parametrize(('objects', 'what'), [
        ({(0x100C, 0): b'\xF4\1', (0x100D, 0): b'\3'}, says('life_guarding', time=1500)),
        ({(0x1400, 5): b'\x64\0'}, says('pdo_time_out', what='1400h.05h', time=100))])
    @pytest.mark.parametrize('options', [{}, {'bridge_heartbeat': 0.0}])
    def test_what_it_watches_by_itself_is_named(
            self, objects: dict[Any, Any], what: says, options: dict[str, Any]) -> None:
        axis = meet(objects=objects, **options)
        told = axis.talk.events(Noted)
        assert [note.text for note in told if not note.warning].count(what) == 1
        assert not {'nothing_stops', 'watch_unknown'}.intersection(
            note.text.code for note in told)
        assert any(word in axis.session.facts()['stops_by'] for word in ('100Ch', '1400h.05h'))
        assert not any(text.startswith(('0C10', '0D10', '001405')) for text in written(axis))

    def test_guarding_stops_nothing_where_6007h_is_0(self) -> None:
        axis = meet(objects={(0x100C, 0): b'\xF4\1', (0x100D, 0): b'\3', (0x6007, 0): bytes(2)})
        assert says('nothing_stops') in notes(axis)

    @pytest.mark.parametrize('objects', [
        {(0x100C, 0): b'\xF4\1', (0x100D, 0): b'\0'}, {(0x1400, 5): bytes(2)}])
    def test_what_is_off_is_not_named(self, objects: dict[Any, Any]) -> None:
        assert says('nothing_stops') in notes(meet(objects=objects, bridge_heartbeat=0.0))

    def test_an_entry_that_is_acknowledged_and_not_taken(self) -> None:
        axis = Axis()
        write = axis.drive.write
        axis.drive.write = (    # type: ignore[method-assign]
            lambda index, *rest: None if index == 0x1016 else write(index, *rest))
        axis.start()
        assert says('nothing_stops') in notes(axis)

    def test_an_entry_of_ours_that_cannot_be_written_watches_all_the_same(self) -> None:
        axis = meet(objects={(0x1016, 1): bytes.fromhex('F4017F00')}, refuses=fixed((0x1016, 1)))
        assert says('nothing_stops') not in notes(axis)

    @pytest.mark.parametrize(('entry', 'written_anew'), [
        ('58027F00', []), ('2C017F00', ['16100158027F00', '16100100000000', '16100158027F00'])])
    def test_an_entry_of_a_bridge_that_died(self, entry: str, written_anew: list[str]) -> None:
        """What it is to be already stays; another time is written behind 0 where it has to be."""
        axis = meet(objects={(0x1016, 1): bytes.fromhex(entry)}, make=WatchesOnce)
        assert not notes(axis)
        assert [text for text in written(axis) if text.startswith('1610')] == written_anew
        assert axis.drive.number(0x1016, 1) == 0x7F0258
        axis.ends(1.0)
        assert axis.drive.number(0x1016, 1) == 0     # so that it does not end in a fault

    def test_off(self) -> None:
        axis = meet(bridge_heartbeat=0.0)
        assert '77F#05' not in axis.take()
        assert says('nothing_stops') in notes(axis)

    def test_not_known_under_assume(self) -> None:
        axis = meet(objects=FITS, mapping='assume')
        assert says('watch_unknown') in notes(axis)

    def test_too_short_under_verify(self) -> None:
        axis = meet(objects={**FITS, (0x1016, 1): bytes.fromhex('8F017F00')}, mapping='verify')
        assert '1016h.01h' in differs(axis)
        axis = meet(objects={**FITS, (0x1016, 1): bytes.fromhex('90017F00')}, mapping='verify')
        assert axis.session.online
        assert says('watch_stays', what='1016h.01h') in notes(axis)

    def test_an_entry_without_a_time_watches_nobody(self) -> None:
        axis = meet(objects={**FITS, (0x1016, 1): bytes.fromhex('00007F00')}, mapping='verify')
        assert axis.session.online
        assert says('nothing_stops') in notes(axis)

    def test_a_drive_without_a_producer_is_not_watched(self) -> None:
        axis = Axis()
        del axis.drive.objects[0x1017, 0]
        axis.drive.number = lambda index, subindex=0: int.from_bytes(   # type: ignore
            axis.drive.objects.get((index, subindex), b''), 'little')
        axis.start()
        axis.live(2.0)
        assert axis.session.online
        assert notes(axis).count(says('no_heartbeat_producer')) == 1


#: abort code: not in this state of the device
NOT_TAKEN = '22000008'


class TestAbsence:
    """Only the drive's own word says that it lacks something; any other refusal does not."""

    NONE, NOT_NOW = '00000206', NOT_TAKEN

    @pytest.mark.parametrize(('code', 'what'), [
        (NONE, says('no_such_pdo')), (NOT_NOW, says('object_refused', what='1800h.01h'))])
    def test_of_a_pdo(self, code: str, what: says) -> None:
        axis = Axis()
        axis.drive.instead = {'40001801': '80001801' + code}
        axis.start()
        assert differs(axis) == what

    @pytest.mark.parametrize(('code', 'timeout', 'watched'), [
        (NONE, 0.35, False), (NOT_NOW, 0.35, True), (NOT_NOW, 0.05, False)])
    def test_of_a_heartbeat(self, code: str, timeout: float, watched: bool) -> None:
        axis = Axis(objects={(0x1017, 0): b'\x32\0'}, heartbeat_timeout=timeout,
                    heartbeat_producer=0.04)
        axis.drive.instead = {'2b171000': '80171000' + NOT_TAKEN}
        if code == self.NONE:
            axis.drive.instead = {'40171000': '80171000' + code, '2b171000': '80171000' + code}
        axis.start()
        axis.live(0.3)
        assert (axis.session._node.heartbeat_timeout > 0) is watched
        assert (says('no_heartbeat_producer') in notes(axis)) is not watched

    @pytest.mark.parametrize(('code', 'enabled'), [(NONE, True), (NOT_NOW, False)])
    def test_of_the_mode_that_is_shown(self, code: str, enabled: bool) -> None:
        axis = Axis().online()
        axis.drive.instead = {'40616000': '80616000' + code}
        (_, success, message), = axis.asks(ControlAction.ENABLE, 2.5)
        assert success is enabled, message
        assert (says('mode_not_shown') in notes(axis)) is enabled


class TestNoNmt:

    def test_none_is_sent_and_what_fits_is_cycled(self) -> None:
        axis = Axis(objects=FITS, nmt_start=False)
        axis.drive.operational = True
        axis.start()
        assert axis.session.online
        assert not any(text.startswith('000#') for text in axis.take())

    def test_written_only_where_the_node_is_found_pre_operational(self) -> None:
        axis = Axis(nmt_start=False)
        axis.drive.operational = True
        axis.start()
        axis.live(0.5)
        assert differs(axis) == says('not_pre_operational')
        axis = meet(nmt_start=False)
        assert '00140105020000' in written(axis)
        assert not axis.session.online
        axis.drive.operational = True
        axis.live(0.5)
        assert axis.session.online

    @pytest.mark.parametrize('waits', [1.0, 180.0])
    def test_one_that_somebody_enables_meanwhile_is_disabled_by_sdo(self, waits: float) -> None:
        axis = meet(nmt_start=False, disable_word='disable_operation')
        axis.live(waits)
        axis.drive.becomes(axis.drive.ENABLED)
        axis.drive.told.clear()
        axis.drive.ramp = 1000
        axis.take()
        axis.drive.operational = True
        axis.live(0.5)
        assert axis.drive.told == [0x07]
        assert not any(text.startswith('205#') for text in axis.take())
        assert says('found_enabled', state='operation enabled') in notes(axis)
        axis.drive.becomes(axis.drive.ON)
        axis.live(0.3)
        assert axis.session.online
        assert axis.drive.told == [0x07, 0x00, 0x06], 'no SYNC enables it again'


class TestHeldAxes:

    def test_the_position_is_read_before_the_first_pdo(self) -> None:
        axis = meet('csp')
        first = next(text for text in axis.take() if text.startswith('205#'))
        assert first == '205#0600E8030000'

    def test_it_is_told_nothing_but_where_it_is(self) -> None:
        axis = Axis('csp').enabled()
        axis.drive.objects[0x6064, 0] = (1005).to_bytes(4, 'little')
        axis.live(0.1)
        assert {text for text in axis.take() if text.startswith('205#')} == {'205#0F00E8030000'}
        axis.commands(1003.0, 1100.0)
        axis.live(0.02)
        assert '205#0F004C040000' in axis.take()


class TestByMeaning:
    """What is read back is compared by what it means."""

    @pytest.mark.parametrize('make', [SignedLengths, EightEntries])
    @pytest.mark.parametrize('mapping', ['configure', 'verify'])
    def test_what_fits_is_cycled_and_not_written(self, make: Any, mapping: str) -> None:
        axis = Axis(make=make, objects=FITS, mapping=mapping).start()
        assert axis.session.online, axis.session.offline_advice
        assert not any(text[2:4] in ('16', '1A') for text in written(axis))

    @pytest.mark.parametrize('make', [SignedLengths, EightEntries])
    def test_what_does_not_fit_is_written(self, make: Any) -> None:
        axis = Axis(make=make, objects={
            **FITS, (0x1600, 2): bytes.fromhex('20007A60'), (0x1600, 3): bytes.fromhex('08006060'),
            (0x1600, 0): b'\3'}).start()
        assert axis.session.online, axis.session.offline_advice
        assert axis.drive.mapped(0x1600) == [(0x6040, 0, 2), (0x60FF, 0, 4)]

    def test_what_is_behind_and_not_empty_differs(self) -> None:
        axis = Axis(make=EightEntries, mapping='verify', objects={
            **FITS, (0x1600, 5): bytes.fromhex('08006060')}).start()
        assert differs(axis) == says('object_differs', what='1600h.00h')

    def test_an_entry_that_cannot_be_read_is_no_empty_one(self) -> None:
        axis = Axis(mapping='verify', objects={**FITS, (0x1600, 0): b'\3'})
        axis.drive.instead = {'40001603': '8000160322000008'}
        axis.start()
        assert differs(axis) == says('object_differs', what='1600h.00h')

    def test_advice_leads_in_no_circle(self) -> None:
        """Verify says configure, which says what else there is, and what that costs."""
        fits_not = {**FITS, (0x1600, 2): bytes.fromhex('20007A60')}
        told = []
        for mapping in ('verify', 'configure'):
            axis = Axis(objects=fits_not, mapping=mapping)
            axis.drive.fixed = dict.fromkeys(FITS, 0x06010002)
            axis.start()
            text = differs(axis)
            assert '1600h.02h is 607Ah.00h 32 bits instead of 60FFh.00h 32 bits ' \
                   '(target_velocity)' in text
            told.append(str(axis.session.remedy(text)))
        assert 'mapping: configure' in told[0]
        assert 'mapping: configure' not in told[1]
        assert 'mapping: assume' in told[1] and 'nothing is checked then' in told[1]
        assert '06010002h' in told[1]


class TestFixedEntries:
    """The entries of a mapping are fixed; how many of them are in it can be written."""

    ENTRIES = fixed(*((at, place) for at in (0x1600, 0x1A00) for place in (1, 2)))

    @pytest.mark.parametrize('else_differs', [
        {(0x1800, 2): b'\xFF'}, {(0x1800, 3): b'\x64\0'}, {TPDO: bytes.fromhex('85010080')}])
    def test_those_that_fit_are_not_written(self, else_differs: dict[Any, Any]) -> None:
        axis = Axis(objects={**FITS, **else_differs})
        axis.drive.fixed = self.ENTRIES
        axis.start()
        assert axis.session.online, axis.session.offline_advice
        assert not any(text[2:4] in ('16', '1A') for text in written(axis))

    #: mapping of three objects that this drive is found with
    FOUND = {**FITS, (0x1600, 0): b'\3', (0x1600, 2): bytes.fromhex('20007A60'),
             (0x1600, 3): bytes.fromhex('08006060')}

    @pytest.mark.parametrize(('refused', 'what'), [
        ((0x1600, 1), '1600h.01h'), ((0x1600, 2), '1600h.02h'), ((0x1400, 2), '1400h.02h')])
    def test_the_others_stay_as_they_were_found(
            self, refused: tuple[int, int], what: str) -> None:
        axis = Axis(objects=self.FOUND)
        axis.drive.fixed = {refused: 0x06040041}
        axis.start()
        assert differs(axis) == says('object_refused', what=what, why=describe(0x06040041))
        assert {place: axis.drive.objects[place] for place in self.FOUND} == self.FOUND
        axis.drive.fixed.clear()
        axis.live(1.1)
        assert axis.session.online

    def test_a_count_that_is_refused(self) -> None:
        axis = Axis(objects=self.FOUND)
        axis.drive.instead = {'2f00160002': '8000160042000406'}     # two are too many
        axis.start()
        assert differs(axis) == says(
            'object_refused', what='1600h.00h', why=describe(0x06040042))
        assert {place: axis.drive.objects[place] for place in self.FOUND} == self.FOUND
