# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can stop`` by the local way: the bridges of this host are asked by their sockets.

``drive_can stop`` imports this before it has stopped anything, so nothing is imported here that
takes time.
"""

from collections import namedtuple
from collections.abc import Iterable, Sequence
import select

from drive_can_bridge import host_texts
from drive_can_bridge.process.local_way import (
    ANYWHERE, END, Line, meant, NO, PATIENCE, Rubbish)
from drive_can_bridge.process.presence import (
    bridges, in_namespace, own_domain, Present, short, switched_on)

#: s after which the way through ROS is used, too, where a bridge is silent
SOON = 0.15
#: s that a drive may take to stop
STOP_TIMEOUT = 10.0
#: messages of one bridge that are read in a row: one that never ends delays no other
_AT_ONCE = 1000


class Answer(namedtuple('Answer', 'name ok text bridge domain', defaults=(False, None))):
    """
    The result of a drive, or of a bridge.

    :ivar name: full name; or the word that no drive has.
    :ivar ok: it succeeded.
    :ivar bridge: it is a bridge.
    :ivar domain: its ROS domain, where that is not the one of this shell.
    """

    __slots__ = ()


def stop_answer(node: str, success: bool, message: str, online: bool) -> Answer:
    """Return the result of a drive that was commanded to stop."""
    if not success:
        return Answer(node, False, message)
    said = message or 'stopped'
    return Answer(node, online,
                  said if online else host_texts.not_online_may_run.format(said=said))


class _AskedBridge:
    """
    A bridge of this host, with its answers to a stop.

    :param question: its request.
    :ivar line: to it; None: there is none.
    :ivar busy: it takes no calls just now.
    :ivar name: as it answers; '' until then.
    :ivar drives: all of its drives.
    :ivar seen: the bridges that it sees.
    :ivar around: the drives that it sees in the graph.
    :ivar answers: of its drives.
    :ivar ended: these were all.
    :ivar passed: the results of others that it has passed a stop on to; None: was not asked to.
    :ivar said: anything arrived since the last look.
    """

    def __init__(self, present: Present, question: Sequence[str]) -> None:
        self.present = present
        self._question = question
        self.line: Line | None = None
        self.busy = False
        self.name = ''
        self.drives: list[str] = []
        self.seen: list[str] = []
        self.around: list[str] = []
        self.answers: dict[str, Answer] = {}
        self.passed: list[Answer] | None = None
        self.ended = self.said = False
        self._heard_at = 0.0

    def ask(self) -> None:
        """Ask it, if it listens."""
        try:
            self.busy = False
            self.line = Line(self.present)
            self.line.ask(*self._question)
        except BlockingIOError:
            self.hang_up()
            self.busy = True
        except OSError:     # ended just now, an older one, or switched off
            self.hang_up()

    @property
    def here(self) -> bool:
        """Whether it has answered with its name, and is trusted."""
        return bool(self.name)

    @property
    def failed(self) -> bool:
        """Whether it was to pass a stop on, and has not answered all of that."""
        return self.passed is not None and self.line is None and not self.ended

    @property
    def unreached(self) -> bool:
        """Whether a stop may not have reached it: it is older, another user's, or has ended."""
        return not self.here and (self.line is None or not self.line.believed)

    @property
    def quiet(self) -> bool:
        """Whether it may still answer, and has not sent its name."""
        return not self.here and (self.busy or self.line is not None and self.line.believed)

    def look(self) -> None:
        """Handle its messages."""
        line = self.line
        # one that is not trusted was asked all the same: it may be what it claims
        if line is None or not line.believed:
            return
        try:
            for _ in range(_AT_ONCE):
                message = line.take()
                if message is None:
                    return
                self.said = True
                self._take(message)
                if self.line is None:
                    return
        except (OSError, Rubbish, ValueError, IndexError):
            self.hang_up()

    def _take(self, message: Sequence[str]) -> None:
        kind, *words = message
        if kind == 'bridge':
            self.name, self.seen = words[0], words[2:]
        elif kind == 'drives':
            self.drives = words
        elif kind == 'around':
            self.around = words
        elif kind == 'drive':
            name, success, online, text = words
            self.answers[name] = stop_answer(name, success == '1', text, online == '1')
        elif kind == 'passed':
            name, ok, text, bridge = words
            self.passed = self.passed or []
            self.passed.append(Answer(name, ok == '1', text, bridge == '1'))
        elif kind == END:
            self.ended = True
            self.hang_up()
        elif kind == NO:
            self.hang_up()

    def give_up(self, now: float) -> None:
        """Hang up on one that was to pass a stop on, and has been silent for too long."""
        if self.said or not self._heard_at:
            self.said, self._heard_at = False, now
        elif now - self._heard_at > PATIENCE:
            self.hang_up()

    def hang_up(self) -> None:
        """Close the connection."""
        line, self.line = self.line, None
        if line is not None:
            line.close()


class LocalStop:
    """
    A stop of drives of this host; sent when it is created.

    Without words and namespace it goes to all bridges of this host, else to those of one domain.

    :param namespace: of the bridges that are meant; None: all.
    :param words: names, patterns or full names of drives; none: all.
    """

    def __init__(self, namespace: str | None, words: Sequence[str]) -> None:
        self.domain = own_domain()
        self._namespace = namespace
        self._words = list(words)
        self._began: float | None = None
        self._waited_before = 0.0
        question = ['stop', ANYWHERE if namespace is None else namespace, *self._words]
        everywhere = not words and namespace is None
        self._asked = [_AskedBridge(each, question) for each in bridges()
                      if everywhere or each.domain in (None, self.domain)
                      and each.may_be_in(namespace)]
        #: connections by which stops are passed on
        self._passing: list[_AskedBridge] = []
        if switched_on():
            for each in self._asked:
                if each.present.domain is not None:
                    each.ask()

    def look(self, now: float) -> bool:
        """Handle what has arrived; return whether all known bridges have answered."""
        if self._began is None:
            self._began = now - self._waited_before
        waited = now - self._began
        for each in (*self._asked, *self._passing):
            if each.busy and waited < PATIENCE:
                each.ask()
            each.look()
        if waited >= SOON or not any(each.quiet for each in self._asked):
            self._pass_on()
        for each in self._passing:
            each.give_up(now)
            if waited > STOP_TIMEOUT + PATIENCE:
                each.hang_up()
        return self._knows_own_domain and self.over(now) and not self._left_to_ros

    def wait(self, timeout: float) -> bool:
        """Wait until something arrives, for so many s at most; return whether it did."""
        poll = select.poll()
        for each in (*self._asked, *self._passing):
            if each.line is not None and each.line.believed:
                poll.register(each.line.socket, select.POLLIN)
        return bool(poll.poll(1e3 * timeout))

    def go_on(self, waited: float) -> None:
        """Continue by another clock: with the next look so many s will have passed."""
        self._began, self._waited_before = None, waited

    def over(self, now: float) -> bool:
        """Return whether nothing more is to be expected of this host."""
        waited = self._waited(now)
        if waited < PATIENCE and (any(each.quiet for each in self._asked)
                                  or any(each.busy for each in self._passing)):
            return False
        return waited > STOP_TIMEOUT + PATIENCE or not any(
            each.line is not None and (each.here or each.passed is not None)
            for each in (*self._asked, *self._passing))

    def _waited(self, now: float) -> float:
        return 0.0 if self._began is None else now - self._began

    def wants_ros(self, now: float) -> bool:
        """Return whether there may be bridges that only ROS reaches, or that are silent."""
        own = [each for each in self._asked if each.present.domain in (None, self.domain)]
        if any(each.quiet for each in own) and self._waited(now) < SOON:
            return False
        return (not self._knows_own_domain or not all(each.here for each in own)
                or self._left_to_ros)

    @property
    def _left_to_ros(self) -> bool:
        """Whether the local way does not reach a bridge, or a stop was not passed on."""
        return (any(each.unreached for each in self._asked
                    if each.present.domain in (None, self.domain))
                or any(each.failed for each in self._passing
                       if each.present.domain == self.domain))

    @property
    def _knows_own_domain(self) -> bool:
        """Whether a bridge has listed the bridges in the domain of this shell."""
        return any(each.here and each.present.domain == self.domain for each in self._asked)

    def _pass_on(self) -> None:
        """Pass the stop on to bridges of other hosts, by bridges that know them."""
        for each in self._asked:
            domain = each.present.domain
            same = [other for other in self._asked if other.present.domain == domain]
            local = {other.present.name for other in same}
            asked = {name for other in self._passing for name in other.seen
                     if other.present.domain == domain}
            names = [name for name in dict.fromkeys(each.seen) if short(name) not in local
                     and name not in asked and (
                         self._namespace is None or in_namespace(name, self._namespace))]
            if names:
                passing = _AskedBridge(each.present, [
                    'pass', *names, '', *(node for other in same for node in other.drives), '',
                    *self._words])
                passing.seen, passing.passed = names, []
                passing.ask()
                self._passing.append(passing)

    # -- results ----------------------------------------------------------------------------------

    @property
    def present(self) -> list[Present]:
        """The bridges of this host that may be meant, asked or not."""
        return [each.present for each in self._asked]

    @property
    def known(self) -> dict[str, _AskedBridge]:
        """The bridges in the domain of this shell that have sent their name, by full name."""
        return {each.name: each for each in self._asked
                if each.here and each.present.domain == self.domain}

    @property
    def handled(self) -> set[str]:
        """Drives that have their stop from here, and those that are not meant."""
        return {node for each in self.known.values() for node in each.drives} | {
            answer.name for each in self._passing for answer in each.passed or ()
            if each.present.domain == self.domain and not answer.bridge}

    @property
    def drives(self) -> list[str]:
        """Full names of all known drives in the domain of this shell."""
        return [node for each in (*self._asked, *self._passing)
                if each.present.domain == self.domain for node in each.drives]

    @property
    def unheard(self) -> list[Present]:
        """The bridges of this host that have not sent their name, and may be meant."""
        return [present for present in self._silent() if self._may_be_meant(present)]

    @property
    def spared(self) -> set[str]:
        """Names of silent bridges that are known to have no drive that is meant."""
        return {present.name for present in self._silent()
                if present.domain == self.domain and not self._may_be_meant(present)}

    def _silent(self) -> list[Present]:
        return [each.present for each in self._asked if not each.here]

    def _may_be_meant(self, present: Present) -> bool:
        known = set(self.drives)
        return may_match(present, [node for each in self.known.values() for node in each.around
                                   if node not in known], self._words)

    def answers(self) -> list[Answer]:
        """Return the results of drives, and of bridges that others see."""
        found: list[Answer] = []
        for each in self._asked:
            domain = None if each.present.domain == self.domain else each.present.domain
            told = [each.answers.get(node, Answer(
                        node, False, host_texts.may_run.format(why='no answer')))
                    for node in each.drives if meant(self._words, node)]
            if each.here and each.seen.count(each.name) > 1:
                told.append(twins(each.name, each.seen.count(each.name)))
            found += [answer._replace(domain=domain) for answer in told]
        for each in self._passing:
            domain = None if each.present.domain == self.domain else each.present.domain
            told = each.passed or []
            if each.failed and domain is not None:  # else ROS shows what became of them
                told = [Answer(name, False, does_not_answer(), bridge=True) for name in each.seen]
            found += [answer._replace(domain=domain) for answer in told]
        return found

    def close(self) -> None:
        """Close the connections."""
        for each in (*self._asked, *self._passing):
            each.hang_up()


class Early(namedtuple('Early', 'stop namespace words json')):
    """
    A stop that was sent before anything else was done.

    :ivar stop: the stop.
    :ivar namespace: of the bridges that are meant; None: all.
    :ivar words: names, patterns or full names; none: all.
    :ivar json: the results are to be printed as JSON.
    """

    __slots__ = ()


#: those that were not claimed yet
_early: list[Early] = []


def begin(arguments: Sequence[str]) -> Early | None:
    """
    Send a stop as soon as it is clear that one is meant: before anything else is imported.

    :param arguments: those of ``drive_can stop``; with any that need a closer look it is not sent.
    :return: None: it was not.
    """
    namespace: str | None = None
    words: list[str] = []
    json = False
    left = list(arguments)
    while left:
        word = left.pop(0)
        option, given, value = word.partition('=')
        if option == '--namespace' and (given or left):
            namespace = plain_namespace(value if given else left.pop(0))
            if namespace is None:
                return None
        elif word == '--json':
            json = True
        elif word.startswith('-'):
            if word != '--yes':
                return None
        else:
            words.append(word)
    early = Early(LocalStop(namespace, words), namespace, words, json)
    _early.append(early)
    return early


def plain_namespace(text: str) -> str | None:
    """Return a namespace as nodes have it, '' for the root; None: it needs a closer look."""
    name = '/' + text.strip('/')
    if not name.isascii() or not name.replace('/', '').replace('_', '').isalnum() and name != '/':
        return None
    return name if name != '/' else ''


def begun(namespace: str | None, words: Sequence[str]) -> LocalStop:
    """Return the stop that was sent for this, or send it."""
    while _early:
        early = _early.pop()
        stop: LocalStop = early.stop
        if early[1:3] == (namespace, list(words)):
            return stop
        stop.close()
    return LocalStop(namespace, words)


def twins(name: str, number: int) -> Answer:
    """Return the result for bridges of the same name, which cannot be told apart."""
    return Answer(name, False, host_texts.bridges_hide_each_other.format(number=number),
                  bridge=True)


def does_not_answer() -> str:
    """Return the text for a bridge that does not answer."""
    return host_texts.bridge_does_not_answer


def may_match(present: Present, around: Iterable[str], words: Sequence[str]) -> bool:
    """
    Return whether words may mean a drive of a bridge that does not answer.

    They do not where the graph shows as many drives of it as it has locked, and none is meant.

    :param around: drives in the graph of no other bridge.
    """
    if not words or not present.may_mean(words):
        return not words
    its = [node for node in around if present.has_place
           and node.rpartition('/')[0] == present.name.rpartition('/')[0]]
    return not 0 < present.drives <= len(its) or any(meant(words, node) for node in its)
