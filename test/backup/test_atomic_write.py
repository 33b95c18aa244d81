# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Files are written whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import resource

import pytest

from drive_can_bridge.cli.output import differs, write_atomically


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let no file grow beyond a size, as a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_nothing_is_left_of_a_file_that_does_not_fit(tmp_path: Path) -> None:
    path = tmp_path / 'a.yaml'
    path.write_bytes(b'before')
    with room_for(100), pytest.raises(OSError) as error:
        write_atomically(path, bytes(1000))
    assert error.value.filename == str(path)
    assert os.listdir(tmp_path) == ['a.yaml']
    assert path.read_bytes() == b'before'


def test_replaced_as_a_whole_where_a_link_points(tmp_path: Path) -> None:
    path, link = tmp_path / 'a.yaml', tmp_path / 'latest.yaml'
    path.write_bytes(b'before')
    link.symlink_to(path)
    write_atomically(link, b'after')
    assert link.is_symlink()
    assert path.read_bytes() == b'after'
    assert path.stat().st_mode & 0o777 == 0o666 & ~_umask()
    assert not differs(path, b'after')
    assert differs(path, b'other')
    assert differs(path)
    assert not differs(tmp_path / 'b.yaml')


def test_a_pipe_is_written_to_by_the_name_of_its_descriptor() -> None:
    """``-o /dev/stdout``, and ``-o >(gzip …)`` of a shell."""
    out, into = os.pipe()
    try:
        write_atomically(Path(f'/dev/fd/{into}'), b'settings')
        assert os.read(out, 100) == b'settings'
    finally:
        os.close(into)
        os.close(out)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
