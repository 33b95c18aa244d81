# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How much memory the middleware takes for each topic and service.

Fast DDS makes room for a hundred messages at each end of each of them before there is one. A drive
has about thirty ends, most of which never see as many. So histories begin small and grow where
they have to; how many messages they keep is what each topic says, as ever.
"""

from collections.abc import MutableMapping
import os
from pathlib import Path

from drive_can_bridge.resources import config_file

#: what names a file of profiles for Fast DDS, by its version; the first is that of Jazzy
VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
#: files that Fast DDS takes from the working directory by itself
FILES = ('DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml')


def begin_with_small_histories(environment: MutableMapping[str, str] = os.environ) -> None:
    """
    Let Fast DDS begin with small histories, unless somebody has profiles of their own.

    To be called before ``rclpy.init``. Other middleware takes no notice.
    """
    if any(environment.get(name) for name in VARIABLES) or any(
            Path(name).exists() for name in FILES):
        return
    try:
        environment[VARIABLES[0]] = str(config_file('fastdds/histories.xml'))
    except FileNotFoundError:   # it is only memory
        pass
