# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Tables and progress bars for people, and files.

In a terminal a table fits its width and has a little colour (not with ``NO_COLOR``). What goes to
a pipe or a file is neither cut nor wrapped. Bars are on standard error, in a terminal only.

What draws there takes as long to import as asking a bridge of this host: so that is done
only where something is drawn.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from drive_can_bridge.cli.command import agreed
from drive_can_bridge.core.text import column_lines, printable

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.table import Table


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]], *,
                numbers: Sequence[str] = ()) -> None:
    """
    Print a table on standard output. Columns without any content are left out.

    :param numbers: headings of columns that are aligned to the right.
    """
    if sys.stdout.isatty():
        from rich.console import Console
        Console().print(fitting_table(headings, rows, numbers))
    else:
        print('\n'.join(column_lines(*_used(headings, rows), numbers=numbers)))


def fitting_table(headings: Sequence[str], rows: Iterable[Sequence[str]],
                  numbers: Sequence[str] = ()) -> 'Table':
    """Return a table that fits a terminal, for views that show it again and again."""
    from rich.table import Table
    from rich.text import Text
    headings, written = _used(headings, rows)
    table = Table(box=None, pad_edge=False, header_style='bold')
    for place, heading in enumerate(headings):
        # a name that is broken in two cannot be copied
        table.add_column(heading, justify='right' if heading in numbers else 'left',
                         overflow='fold', no_wrap=place == 0 or heading in numbers)
    for row in written:
        table.add_row(*(Text(cell) for cell in row))
    return table


def _used(headings: Sequence[str], rows: Iterable[Sequence[str]],
          ) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells of the columns with any content, fit for a terminal."""
    written = [[printable(cell, None) for cell in row] for row in rows]
    used = [place for place in range(len(headings)) if any(row[place] for row in written)]
    return [headings[place] for place in used], [[row[place] for place in used]
                                                 for row in written]


#: s after which a bar appears
PATIENCE = 1.0


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Show in a terminal what is waited for, as long as that takes."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    with Console(stderr=True).status(f'{what} …'):
        yield


@contextmanager
def counting(what: str, total: int, now: Callable[[], float]) -> Iterator[Callable[..., None]]:
    """
    Show the progress of something in a terminal, if it takes long; yield what counts a step.

    :param what: the steps are for, ``reading conveyor``.
    :param total: how many there are.
    :param now: the steady time.
    """
    began, done = now(), 0
    progress: 'Progress | None' = None

    def step(_: object = None) -> None:
        nonlocal done, progress
        done += 1
        if progress is None and now() - began >= PATIENCE and sys.stderr.isatty():
            progress = _bar(what, total)
            progress.start()
        if progress is not None:
            progress.update(progress.task_ids[0], completed=done)
    try:
        yield step
    finally:
        if progress is not None:
            with suppress(OSError):     # the terminal may be gone meanwhile
                progress.stop()


def _bar(what: str, total: int) -> 'Progress':
    from rich.console import Console
    from rich.progress import (
        BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn)
    made = Progress(TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn(),
                    TimeRemainingColumn(), console=Console(stderr=True), transient=True)
    made.add_task(what, total=total)
    return made


def differs(path: Path, data: bytes | None = None) -> bool:
    """
    Return whether there is a file that would be lost.

    :param data: what is to be written; None: not known yet.
    """
    return path.is_file() and (data is None or path.read_bytes() != data)


def may_overwrite(files: Iterable[Path], *, yes: bool, otherwise: str) -> bool:
    """
    Ask about files that would be lost; return whether they may be overwritten.

    :param otherwise: what was not done.
    :raises WrongUsage: there is no terminal to ask.
    """
    there = [str(file) for file in files if differs(file)]
    return not there or agreed(
        f'{", ".join(there)} exist{"s" if len(there) == 1 else ""}. Overwrite?', yes=yes,
        otherwise=otherwise, yes_means='overwrites')


def write_atomically(path: Path, data: bytes) -> None:
    """
    Write a file completely, or leave what was there before.

    :raises OSError: the disk is full, the directory cannot be written, ….
    """
    special = path.exists() and not path.is_file()  # /dev/stdout, a pipe
    if not special:     # what /dev/fd calls a pipe is no path
        path = path.resolve()
    try:
        if special:
            path.write_bytes(data)
        else:
            _replace(path, data)
    except OSError as error:
        error.filename = str(path)      # not that of a file which is gone, or none at all
        raise


def _replace(path: Path, data: bytes) -> None:
    import tempfile     # takes its time
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f'.{path.name}.')
    try:
        with os.fdopen(handle, 'wb') as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
