# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Service callbacks as coroutines, which wait for answers without an executor.

One thread starts a coroutine, the answering one continues it.
"""

from collections.abc import Callable, Coroutine, Generator
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any, Generic, TypeVar

_NO_LOCK: AbstractContextManager[Any] = nullcontext()
#: called with the response, or with the error in its place; once, from any thread
Answer = Callable[[Any], None]
AnswerT = TypeVar('AnswerT')


class Awaited(Generic[AnswerT]):
    """
    What such a coroutine awaits: a request that is made when it is awaited.

    :param ask: given the function to call with the answer, once, from any thread, or at once.
    """

    __slots__ = ('ask',)

    def __init__(self, ask: Callable[[Callable[[AnswerT], None]], None]) -> None:
        self.ask = ask

    def __await__(self) -> Generator[Any, AnswerT, AnswerT]:
        return (yield self)


def go_on(coroutine: Coroutine[Any, Any, Any], later: Callable[[Callable[[], None]], None],
          answer: Answer, found: Any = None, *,
          alone: AbstractContextManager[Any] = _NO_LOCK) -> None:
    """
    Run a coroutine to its next request, and continue it with the answer, to its end.

    No future of rclpy takes part: an executor looks at those in an order that differs with its
    version, and may sleep over one that was completed.

    :param later: runs the rest in the thread that is meant for it.
    :param answer: called with what the coroutine returns, or raises.
    :param found: the answer to its last request.
    :param alone: is held while it runs.
    """
    try:
        with alone:
            question: Awaited[Any] = coroutine.send(found)
        question.ask(lambda what: later(
            partial(go_on, coroutine, later, answer, what, alone=alone)))
    except StopIteration as end:
        answer(end.value)
    except Exception as error:
        coroutine.close()
        answer(error)
        raise
