# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bridge's end of the local way (:mod:`.local_way`): a thread that reads requests.

It never waits for a caller, and passes requests on to be answered. What a caller can
cost is limited: its time to ask, what waits to be read by it, how many there are, and the share of
the processor's time that all of them together get.
"""

from collections import deque
from collections.abc import Callable, Sequence
import os
import pwd
import select
import socket
import threading

from drive_can_bridge import host_texts
from drive_can_bridge.clock import Clock, Worker
from drive_can_bridge.process.local_way import (
    ASKED_MAX, END, Inbound, NO, PACKET, packets_of, PATIENCE, peer_of, Rubbish, trusted_users,
    VERSION)

#: callers that the kernel keeps until they are taken
BACKLOG = 256
#: callers at once; of one user who is neither root nor ours; that ask for anything but a stop
CALLERS_MAX, OF_A_STRANGER, BUSY_MAX = 300, 30, 60
#: packets that wait to be read by a caller, and s that it may take to read any
UNREAD_MAX, UNREAD_PATIENCE = 4000, 5.0
#: s that a connection may stay without a question, and how often it is looked for those
IDLE, _LOOK_PERIOD = 60.0, 0.25
#: connections accepted in a row; strangers that are read between two looks at everybody
_TAKE_MAX, _STRANGERS_HEARD = 16, 4
#: actions that every user may request
STOPPING = ('stop', 'pass')


class LocalRequest:
    """
    The request of a caller.

    :ivar action: its action.
    :ivar words: the rest.
    :ivar trusted: the caller is root, or our user.
    :ivar whom: the caller for people: user and process.
    """

    def __init__(self, caller: '_Caller', action: str, words: list[str], *,
                 trusted: bool = True, whom: str = '') -> None:
        self._caller = caller
        self.action = action
        self.words = words
        self.trusted = trusted
        self.whom = whom

    def answer(self, *message: str) -> None:
        """Send a message. From any thread; without waiting."""
        self._caller.say(message)

    def end(self) -> None:
        """End the answer."""
        self._caller.say([END], last=True)

    def refuse(self, text: str) -> None:
        """Answer that this is not served here."""
        self._caller.say([NO, text], last=True)


class _Caller:
    """
    One connection.

    :ivar since: when it last asked, or was answered.
    :ivar busy: the action that is being answered; '': none.
    """

    def __init__(self, connection: socket.socket, now: Callable[[], float],
                 wake: Callable[[], None]) -> None:
        self.socket = connection
        self.process, self.user = peer_of(connection)
        self.inbound = Inbound(ASKED_MAX)
        self.busy = ''
        self.gone = self.has_asked = False
        self._now = now
        self.since = now()
        self._wake = wake
        self._lock = threading.Lock()
        self._unread: deque[bytes] = deque()

    @property
    def unread(self) -> bool:
        """Whether something waits to be read."""
        return bool(self._unread)

    @property
    def left(self) -> bool:
        """Whether the caller has hung up."""
        poll = select.poll()
        poll.register(self.socket, 0)
        return bool(poll.poll(0))

    def say(self, message: Sequence[str], *, last: bool = False) -> None:
        """Send a message, as far as it is read."""
        with self._lock:
            if not self._unread:
                self.since = self._now()
            self._unread.extend(packets_of(message))
            if last:
                self.busy = ''
            self._send()
        if last or self._unread:
            self._wake()

    def close(self) -> None:
        """Hang up; nothing more is sent."""
        with self._lock:    # nothing is sent to the next owner of its number
            self.gone = True
            self.socket.close()

    def flush(self) -> None:
        """Send what waits."""
        with self._lock:
            self.since = self._now()
            self._send()

    def _send(self) -> None:
        try:
            while self._unread and not self.gone:
                self.socket.send(self._unread[0])
                self._unread.popleft()
        except BlockingIOError:
            self.gone = len(self._unread) > UNREAD_MAX
        except OSError:     # it did not wait
            self.gone = True
        if self.gone:
            self._unread.clear()


class LocalServer:
    """
    Serves requests until it is stopped.

    :param listener: bound to the name of the bridge.
    :param serve: handles a request, in this thread; must not wait.
    :param open_to_all: a stop is accepted from every user.
    :param report: logs a line about an exception of ``serve``.
    :param prepare_thread: called first in the thread.
    :param keep_share: returns what pauses when it is time to; called after each piece of work.
    """

    def __init__(self, listener: socket.socket, serve: Callable[[LocalRequest], None], *,
                 open_to_all: bool, report: Callable[[str], None],
                 prepare_thread: Callable[[], object],
                 keep_share: Callable[[], Callable[[], None]], clock: Clock) -> None:
        self._listener = listener
        self._serve = serve
        self._open_to_all = open_to_all
        self._trusted = trusted_users()
        self._names = dict[int, str]()
        self._report = report
        self._prepare_thread = prepare_thread
        self._keep_share = keep_share
        self._clock = clock
        self._callers: dict[int, _Caller] = {}
        self._ending = False
        self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._closing = threading.Lock()    # of the bell
        listener.setblocking(False)
        listener.listen(BACKLOG)
        # where the names are on the network, that may take long
        clock.worker(self._look_up_names, 'names of users').start()
        self._thread: Worker = clock.worker(self._run, 'local way')
        self._thread.start()

    def stop(self) -> None:
        """Stop; callers that still wait see that there is no answer."""
        self._ending = True
        self._ring()
        self._thread.join(5.0)
        with self._closing:
            os.close(self._bell)
            self._bell = -1
        for caller in list(self._callers.values()):
            self._hang_up(caller)

    def _ring(self) -> None:
        with self._closing:
            if self._bell >= 0:
                os.eventfd_write(self._bell, 1)

    def _run(self) -> None:
        self._prepare_thread()
        keep = self._keep_share()
        while not self._ending:
            try:
                self._turn()
            except Exception as error:  # noqa: BLE001  outermost loop of a thread
                self._report(host_texts.local_way_failed.format(
                    kind=type(error).__name__, text=error))
                self._clock.wait(self._clock.now() + _LOOK_PERIOD)
            keep()

    def _turn(self) -> None:
        """Wait for events, and handle them."""
        poll = select.poll()
        poll.register(self._bell, select.POLLIN)
        poll.register(self._listener, select.POLLIN)
        for number, caller in self._callers.items():
            poll.register(number, (0 if caller.busy else select.POLLIN)
                          | (select.POLLOUT if caller.unread else 0))
        found = dict(poll.poll(1e3 * _LOOK_PERIOD if self._callers else None))
        if found.pop(self._bell, 0):
            os.eventfd_read(self._bell)
        now, heard = self._clock.now(), 0
        # ours first; what strangers ask costs ours no more than a moment
        for number, caller in sorted(self._callers.items(), key=lambda each: self._is_strange(
                each[1])):
            events = found.get(number, 0)
            if events & select.POLLOUT:
                caller.flush()
            if events & select.POLLIN and not caller.busy:
                if self._is_strange(caller):
                    heard += 1
                    if heard > _STRANGERS_HEARD:
                        continue
                    # the others of them have their turn before it has another one
                    self._callers[number] = self._callers.pop(number)
                self._hear(caller)
            elif events & (select.POLLHUP | select.POLLERR):
                caller.gone = True
            if caller.gone or now - caller.since > _patience(caller):
                self._hang_up(caller)
        if self._listener.fileno() in found:
            self._accept()

    def _is_strange(self, caller: _Caller) -> bool:
        return caller.user not in self._trusted

    def _accept(self) -> None:
        for _ in range(_TAKE_MAX):
            try:
                connection, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError:     # no descriptor is left
                self._make_room(None)
                return
            connection.setblocking(False)
            caller = _Caller(connection, self._clock.now, self._ring)
            if self._may_stay(caller):
                self._callers[connection.fileno()] = caller
                if not self._is_strange(caller):
                    self._hear(caller)  # a caller mostly has asked by now
                    if caller.gone:
                        self._hang_up(caller)
            else:
                connection.close()

    def _may_stay(self, caller: _Caller) -> bool:
        """Return whether there is room for one more; idle callers make room."""
        if self._is_strange(caller) and (
                not self._open_to_all or self._is_full_for(caller.user)):
            return False
        return len(self._callers) < CALLERS_MAX or self._make_room(None)

    def _is_full_for(self, user: int) -> bool:
        """Return whether the callers of another user have all the room they may have."""
        if sum(each.user == user for each in self._callers.values()) < OF_A_STRANGER:
            return False
        return not self._make_room(user)

    def _make_room(self, user: int | None) -> bool:
        """Hang up on a user's caller that was idle for longest; return False: none is idle."""
        quiet = [each for each in self._callers.values()
                 if not each.busy and user in (None, each.user)]
        if not quiet:
            return False
        self._hang_up(min(quiet, key=lambda each: (each.has_asked, each.since)))
        return True

    def _hear(self, caller: _Caller) -> None:
        """Read a caller's message."""
        try:
            for _ in range(_TAKE_MAX):
                packet = caller.socket.recv(PACKET + 1)
                message = caller.inbound.take(packet) if packet else []
                if message is None:
                    continue
                if not message:
                    raise ConnectionResetError
                caller.since = self._clock.now()
                self._begin(caller, message)
                return
        except BlockingIOError:
            pass
        except (OSError, Rubbish):
            caller.gone = True

    def _begin(self, caller: _Caller, message: list[str]) -> None:
        version, action, words = message[0], ''.join(message[1:2]), message[2:]
        caller.busy, caller.has_asked = action or '?', True
        asked = LocalRequest(caller, action, words, trusted=not self._is_strange(caller),
                             whom=self._whom(caller))
        if version != VERSION:
            asked.refuse(host_texts.version_differs.format(version=VERSION))
        elif action not in STOPPING and not asked.trusted:
            asked.refuse(host_texts.another_user)
        elif action not in STOPPING and caller.left:    # only a stop is still done when late
            caller.gone = True
        elif action not in STOPPING and sum(
                bool(each.busy) and each.busy not in STOPPING
                for each in self._callers.values()) > BUSY_MAX:
            asked.refuse(host_texts.too_many_ask)
        else:
            self._serve(asked)

    def _look_up_names(self) -> None:
        for user in self._trusted:
            self._names[user] = user_name(user)

    def _whom(self, caller: _Caller) -> str:
        user = self._names.get(caller.user, f'user {caller.user}')
        return f'{user}, process {caller.process}' if caller.process else user

    def _hang_up(self, caller: _Caller) -> None:
        self._callers.pop(caller.socket.fileno(), None)
        caller.close()


def user_name(user: int) -> str:
    """Return a user for people: by the name that this host has for the number, if any."""
    try:
        return f'user {pwd.getpwuid(user).pw_name}'
    except (KeyError, OverflowError):
        return f'user {user}'


def _patience(caller: _Caller) -> float:
    """Return the s that a connection may stay idle."""
    if caller.unread:
        return UNREAD_PATIENCE
    if caller.busy:
        return float('inf')
    return IDLE if caller.has_asked else PATIENCE
