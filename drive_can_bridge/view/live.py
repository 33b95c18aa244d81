# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The loop of the live view: look, draw, listen to the keyboard."""

from collections.abc import Callable

from drive_can_bridge.clock import Clock
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.source import Source
from drive_can_bridge.monitor.summary import in_order
from drive_can_bridge.view.keys import Choice, Key
from drive_can_bridge.view.page import closely, page, Setting
from drive_can_bridge.view.screen import Screen

#: s between two pages; longer where drawing one takes more than its share of a processor
FRAME_PERIOD = 0.25
_FRAME_SHARE = 0.04
_FRAME_PERIOD_MAX = 1.0
#: s between two looks whether it has ended, however seldom it is drawn
_LOOK_PERIOD = 0.1


def show(source: Source, model: Model, setting: Setting, clock: Clock, *,
         ended: Callable[[], bool], quit_code: int, notice: Callable[[], str] = str) -> int:
    """
    Draw until the end, or until the user has enough.

    :param notice: returns what is to be said instead of the keys; '' for nothing.
    :return: 0, or ``quit_code`` after the key that quits.
    """
    choice = Choice()
    with Screen() as screen:
        due = clock.now()
        while not (ended() or screen.gone):
            begun, now = clock.used(), clock.now()
            size = screen.size
            drive = closely(choice)
            source.focus(*([] if drive is None else [drive]))
            source.poll(now)
            snapshot = model.look(now, 1e-9 * clock.stamp())
            drives = [drive.name for drive in in_order(snapshot.drives)]
            choice = choice.among(drives)
            screen.draw(page(snapshot, choice, setting, notice=notice(), width=size[0],
                             height=size[1]))
            cost = (clock.used() - begun) / _FRAME_SHARE
            due = max(due, now) + min(max(FRAME_PERIOD, cost), _FRAME_PERIOD_MAX)
            while True:
                left = max(0.0, due - clock.now())
                for key in screen.wait(min(left, _LOOK_PERIOD)):
                    if key is Key.QUIT:
                        return quit_code
                    choice = choice.press(key, drives)
                    due = now  # whoever presses a key wants to see what it does
                if ended() or screen.gone or clock.now() >= due:
                    break
    return 0
