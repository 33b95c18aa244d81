# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can panel``, and a page of it that is open: what a browser asks and answers."""

from collections.abc import Iterator
from contextlib import contextmanager
import json
import math
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time
from urllib.request import Request, urlopen

from child import cpu_of, PATIENCE
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

#: s after which a browser confirms what it has got
_CONFIRMED = 1.0


class Panel:
    """The process."""

    def __init__(self) -> None:
        # the bridge of a bench is sought in the domain that topics.py sets, as everybody's
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'drive_can_bridge.cli.start', 'panel', '--port', '0'],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env={
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_DOMAIN_ID': '97', **os.environ})
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith('viewer: '):
                break
        else:
            raise SystemExit('the panel ended before its time')
        address, _, self._token = line.split()[1].partition('/?token=')
        self._host = address.removeprefix('http://')
        self._cookie = f'drive_can_panel_{self._host.rpartition(":")[2]}={self._token}'

    def cpu(self) -> float:
        """Return the CPU time of the whole process in s."""
        return cpu_of(self.process.pid)

    def memory_mb(self) -> tuple[float, float]:
        """Return the resident memory in MB, and what of it is shared with nobody."""
        rollup = Path(f'/proc/{self.process.pid}/smaps_rollup').read_text()
        sizes = {name: int(size) for name, size in re.findall(r'(\w+): +(\d+) kB', rollup)}
        own = sizes['Private_Clean'] + sizes['Private_Dirty']
        return sizes['Rss'] / 1024, own / 1024

    @contextmanager
    def open(self, page: str) -> Iterator['Page']:
        """Have a page open."""
        begun = time.monotonic()
        request = Request(f'http://{self._host}{page}', headers={'Cookie': self._cookie})
        with urlopen(request) as response:
            found = re.search(r"'client_id': '([0-9a-f-]{36})'", response.read().decode())
        assert found is not None
        with connect(
                f'ws://{self._host}/_nicegui_ws/socket.io/?EIO=4&transport=websocket'
                f'&client_id={found[1]}&tab_id=tab&document_id=document&next_message_id=0'
                '&implicit_handshake=true',
                origin=f'http://{self._host}', max_size=None,  # type: ignore[arg-type]
                open_timeout=PATIENCE, ping_interval=None,
                additional_headers={'Cookie': self._cookie}) as channel:
            opened = Page(channel, found[1], begun)
            opened.start()
            yield opened

    def close(self) -> None:
        """Let it end."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=PATIENCE)


class Page(threading.Thread):
    """
    A page: reads what comes, and answers what a browser does.

    :param begun: when it was asked for.
    :ivar live: s from then to the first message with content.
    """

    def __init__(self, channel: object, client: str, begun: float) -> None:
        super().__init__(daemon=True)
        self._channel: object = channel
        self._client = client
        self._begun = begun
        self.live = math.nan
        self.messages = self.bytes = 0

    def run(self) -> None:
        """Read until the end."""
        channel, confirmed = self._channel, time.monotonic()
        try:
            for text in channel:  # type: ignore[attr-defined]
                if text.startswith('0'):
                    channel.send('40')  # type: ignore[attr-defined]
                elif text == '2':
                    channel.send('3')  # type: ignore[attr-defined]
                elif text.startswith('42'):
                    if not self.messages:
                        self.live = time.monotonic() - self._begun
                    self.messages += 1
                    self.bytes += len(text)
                    message = json.loads(text[2:])[1]
                    now = time.monotonic()
                    if now - confirmed > _CONFIRMED and '_id' in message:
                        confirmed = now
                        answer = ['ack', {'client_id': self._client,
                                          'next_message_id': message['_id'] + 1}]
                        channel.send(f'42{json.dumps(answer)}')  # type: ignore[attr-defined]
        except ConnectionClosed:
            pass
