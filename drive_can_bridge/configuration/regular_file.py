# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Read a file that a user names: whatever it is, that ends, and fits the memory."""

from errno import EFBIG, EINVAL
from pathlib import Path


def read_regular(path: Path, limit: int) -> bytes:
    """
    Read a file.

    :param limit: MiB that it may have.
    :raises OSError: it cannot be read, is no file, or is too large.
    """
    # a pipe may keep us waiting, a device has no end
    if not path.is_file() and not path.is_dir() and path.exists():
        raise OSError(EINVAL, 'not a regular file, allowed is one', str(path))
    with path.open('rb') as file:
        data = file.read((limit << 20) + 1)
    if len(data) > limit << 20:
        raise OSError(EFBIG, f'too large, allowed are {limit} MiB', str(path))
    return data
