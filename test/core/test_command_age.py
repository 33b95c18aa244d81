# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Commands by the clocks of two hosts that drift, are slewed and set, for hours and weeks."""

from collections import Counter
from dataclasses import dataclass, field

import pytest

from drive_can_bridge.core.command_age import Age, ALONE, CommandAges

S = 1_000_000_000
MS = 1_000_000
EPOCH = 1_790_000_000 * S
FRESH, LATE, DIFFER, SET, STEADY = (
    Age.FRESH, Age.LATE, Age.CLOCKS_DIFFER, Age.CLOCK_SET, Age.STEADILY_LATE)


@dataclass
class Host:
    """A publisher whose clock is ``behind`` by so many s, and slower than ours by ``ppm``."""

    gid: bytes | None = ALONE
    behind: float = 0.0
    ppm: float = 0.0

    def shows(self, now: int) -> int:
        return EPOCH + now - round(self.behind * S) - round(now * self.ppm * 1e-6)


@dataclass
class Story:
    """
    A topic that is looked at every 20 ms.

    :ivar ahead: what the time of the day shows at the steady time 0.
    :ivar at_take: the middleware stamps what is received when it is taken (Cyclone).
    """

    at_take: bool = False
    ages: CommandAges = field(default_factory=CommandAges)
    now: int = 1000 * S
    ahead: int = EPOCH

    def wait(self, seconds: float) -> None:
        self.now += round(seconds * S)

    def look(self) -> None:
        self.ages.look(self.now, self.ahead)

    def comes(self, host: Host, way: float = 0.002, waits: float = 0.005,
              look: bool = True) -> tuple[Age, float]:
        """Have a command come that is taken now, and waited here; both in s."""
        if look:
            self.look()
        arrived = self.now - round(waits * S)
        received = self.ahead + (self.now + 1000 if self.at_take else arrived)
        judged = self.ages.judge(host.shows(arrived - round(way * S)), received, host.gid)
        return judged.age, judged.seconds

    def every(self, period: float, count: int, *hosts: Host) -> Counter[Age]:
        """Have commands come in turn for a while."""
        seen: Counter[Age] = Counter()
        for _ in range(count):
            for host in hosts:
                self.wait(period)
                seen[self.comes(host)[0]] += 1
        return seen


@pytest.mark.parametrize('at_take', [False, True], ids=['stamped on arrival', 'at the take'])
@pytest.mark.parametrize('ppm', [50, 20, 150, -50])
def test_a_quartz_that_is_slower_is_obeyed_for_a_week(ppm: float, at_take: bool) -> None:
    story, host = Story(at_take), Host(ppm=ppm)
    assert story.every(5.0, 7 * 24 * 720, host) == {FRESH: 7 * 24 * 720}
    story.every(0.02, 100, host)
    # and what waited is told from it as on the first day
    story.wait(1.0)
    story.look()
    story.wait(0.02)
    assert story.comes(host, way=0.24)[0] is FRESH
    story.wait(0.02)
    assert story.comes(host, way=0.29)[0] is LATE


@pytest.mark.parametrize('ppm', [50, -50])
def test_two_hours_of_silence(ppm: float) -> None:
    story, host = Story(), Host(ppm=ppm)
    story.every(0.02, 500, host)
    for _ in range(7200 * 20):
        story.wait(0.05)
        story.look()
    assert story.every(0.02, 1000, host) == {FRESH: 1000}


def test_the_smallest_age_rises_by_a_fifth_of_a_millisecond_a_second() -> None:
    story = Story()
    story.every(0.02, 10, Host())
    story.wait(500.0)
    # 500 s: 0.1 s more than the 0.25 s
    assert story.comes(Host(), way=0.002 + 0.351) == (LATE, pytest.approx(0.251))
    assert story.comes(Host(), way=0.002 + 0.349)[0] is FRESH


def test_a_clock_that_is_set_back_shows_itself() -> None:
    story, host = Story(), Host()
    story.every(0.02, 10, host)
    host.behind = 0.3
    story.wait(0.02)
    assert story.comes(host) == (SET, pytest.approx(0.28))
    assert story.every(0.02, 1000, host) == {FRESH: 1000}
    story.wait(0.3)
    # by the new clock, as by the one before
    assert story.comes(host, way=0.26)[0] is LATE


def test_what_waited_on_the_network_is_never_a_clock() -> None:
    """3 s in which nothing arrives, then all of it in order, and then what is fresh."""
    story, host = Story(), Host()
    story.every(0.02, 10, host)
    story.wait(3.0)
    story.look()
    ages = [story.comes(host, way=3.0 - 0.02 * count, look=False) for count in range(150)]
    assert [age for age, _ in ages[:137]] == [LATE] * 137
    assert ages[0][1] == pytest.approx(2.998, abs=1e-2)
    assert {age for age, _ in ages[138:]} == {FRESH}


def test_a_clock_slewed_by_80_ms_a_second_is_obeyed_10_s_after_its_end() -> None:
    story, host = Story(), Host()
    story.every(0.02, 50, host)
    seen: Counter[Age] = Counter()
    for _ in range(1000):       # 20 s: by 1.6 s
        host.behind += 0.08 * 0.02
        seen += story.every(0.02, 1, host)
    assert seen[LATE] > 800 and not seen[STEADY] and not seen[SET]
    ages = story.every(0.02, 500, host)
    assert ages[STEADY] == 1
    assert story.every(0.02, 1000, host) == {FRESH: 1000}


def test_10_s_of_the_same_figure_are_a_clock() -> None:
    story, slow = Story(), Host(behind=0.4)
    story.every(1.0, 5, Host(gid=b'quick'))
    story.wait(1.0)
    began = story.now
    while (judged := story.comes(slow, way=0.004 + 0.09 * (story.now // MS % 2)))[0] is LATE:
        assert story.now - began < 10 * S
        story.wait(0.101)
    assert judged == (STEADY, pytest.approx(0.4, abs=0.1))
    assert 10 * S <= story.now - began < 10.2 * S
    assert story.every(0.1, 100, slow) == {FRESH: 100}


def test_figures_that_differ_are_a_network() -> None:
    story = Story()
    story.every(0.02, 10, Host())
    for count in range(1000):
        story.wait(0.1)
        assert story.comes(Host(), way=0.3 + 0.11 * (count % 2))[0] is LATE


def test_one_that_is_fresh_begins_the_10_s_again() -> None:
    story = Story()
    story.every(0.02, 10, Host())
    for count in range(1, 400):
        story.wait(0.1)
        assert story.comes(Host(), way=0.002 if count % 90 == 0 else 0.4)[0] is not STEADY


@pytest.mark.parametrize('gids', [(b'a', b'b'), (None, None)], ids=['gids', 'no gids'])
def test_of_two_publishers_the_one_behind_stays_refused_and_why_is_told(
        gids: tuple[bytes | None, bytes | None]) -> None:
    story = Story()
    ahead, behind = Host(gids[0]), Host(gids[1], behind=1.25)
    story.every(0.02, 10, ahead)
    story.wait(0.02)
    assert story.comes(behind)[0] is LATE       # once may be the network
    seen = story.every(0.02, 1000, ahead, behind)
    assert seen == {FRESH: 1000, DIFFER: 1000}
    story.wait(0.02)
    story.comes(ahead)
    assert story.comes(behind) == (DIFFER, pytest.approx(1.25, abs=0.01))
    # and when the quick one is gone, it is the measure
    assert story.every(0.02, 495, behind)[LATE] == 495
    assert story.every(0.02, 10, behind)[STEADY] == 1
    assert story.every(0.02, 100, behind) == {FRESH: 100}


def test_two_publishers_with_gids_each_have_a_stamp_before() -> None:
    story, one, other = Story(), Host(b'a'), Host(b'b', behind=0.2)
    assert story.every(0.02, 500, one, other) == {FRESH: 1000}
    one.behind = 0.5    # later than the last of the other by less than that, but for its own
    story.wait(0.01)
    assert story.comes(one)[0] is SET


def test_who_publishes_is_not_known_while_two_are_matched() -> None:
    """Where neither a gid nor the number of publishers tells, a stamp may be another's."""
    story, host = Story(), Host()
    story.every(0.02, 10, host)
    two = Host(gid=None, behind=2.0)
    assert story.comes(two)[0] is LATE
    # alone again, but not at the one before
    assert story.comes(Host(behind=2.0))[0] is not SET


@pytest.mark.parametrize('behind', [0.0, 3.0])
def test_a_publisher_that_is_killed_and_started_again(behind: float) -> None:
    """Two are matched until the middleware gives the first one up (10 or 20 s)."""
    story = Story()
    story.every(0.02, 100, Host())
    story.wait(2.0)
    seen = story.every(0.02, 1000, Host(gid=None, behind=behind))
    if behind:
        assert (seen[STEADY], seen[LATE] > 400, seen[SET], seen[DIFFER]) == (1, True, 0, 0)
    else:
        assert seen == {FRESH: 1000}
    assert story.every(0.02, 100, Host(behind=behind)) == {FRESH: 100}


@pytest.mark.parametrize('at_take', [False, True], ids=['stamped on arrival', 'at the take'])
@pytest.mark.parametrize('step', [-3600 * S, 3600 * S, 300 * MS, -300 * MS])
def test_our_own_clock_is_set_while_three_wait(step: int, at_take: bool) -> None:
    story, host = Story(at_take), Host()
    story.every(0.02, 100, host)
    story.wait(0.02)
    story.ahead += step
    story.look()
    arrived = [story.now - waits * MS for waits in (15, 10, 5)]
    for at, by in zip(arrived, (-step, -step, 0)):      # two by the clock as it was
        received = story.ahead + (story.now + 1000 if at_take else at + by)
        assert story.ages.judge(host.shows(at - 2 * MS), received, ALONE).age is FRESH
    assert story.every(0.02, 1000, host) == {FRESH: 1000}
    # none of them lowered it, and it moved along
    story.wait(0.3)
    story.look()
    story.wait(0.02)
    assert story.comes(host, way=0.3, waits=0.0)[0] is LATE
    story.wait(0.02)
    assert story.comes(host, way=0.22, waits=0.0)[0] is FRESH


def test_what_came_too_late_while_our_clock_was_set_is_late() -> None:
    story, host = Story(), Host()
    story.every(0.02, 100, host)
    story.wait(0.48)
    story.look()
    story.wait(0.02)
    story.ahead += 3600 * S
    assert story.comes(host, way=0.5)[0] is LATE


def test_a_take_stamp_says_no_more_than_that_it_came_since_the_last_look() -> None:
    """Looks half a second apart, as of a slow drive: nothing that only waited here is late."""
    story, host = Story(at_take=True), Host()
    for count in range(200):
        story.wait(0.5)
        assert story.comes(host, waits=0.0025 * count)[0] is FRESH
    story.wait(0.5)
    assert story.comes(host, way=0.8, waits=0.0)[0] is LATE


def test_nobody_publishes_any_more() -> None:
    story = Story()
    story.every(0.02, 10, Host())
    story.ages.forget()
    assert story.every(0.02, 10, Host(behind=5.0)) == {FRESH: 10}


def test_stamps_of_publishers_are_bounded() -> None:
    story = Story()
    for number in range(1000):
        story.wait(0.01)
        story.comes(Host(number.to_bytes(16, 'big')))
    assert len(story.ages._stamps) <= 64
