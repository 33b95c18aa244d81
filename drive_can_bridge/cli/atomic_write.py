# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Write a file whole or not at all, and none over another one without having been told."""

import os
from pathlib import Path
import tempfile


def differs(path: Path, data: bytes | None = None) -> bool:
    """
    Tell whether there is a file that would be lost.

    :param data: what is to be written; None: not known yet.
    """
    return path.is_file() and (data is None or path.read_bytes() != data)


def write_atomically(path: Path, data: bytes) -> None:
    """
    Write a file. Whatever goes wrong: there is either the whole of it, or what was there before.

    :raises OSError: the disk is full, the directory cannot be written, ….
    """
    path = path.resolve()
    try:
        if path.exists() and not path.is_file():  # /dev/stdout, a pipe
            path.write_bytes(data)
        else:
            _replace(path, data)
    except OSError as error:
        error.filename = str(path)      # not that of a file which is gone, or none at all
        raise


def _replace(path: Path, data: bytes) -> None:
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
