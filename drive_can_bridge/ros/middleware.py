# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the middleware takes for each topic, service and message.

Fast DDS makes room for a hundred messages at each end of each of them before there is one. A drive
has about thirty ends, most of which never see as many. So histories begin small and grow where
they have to; how many messages they keep is what each topic says, as ever.

And Fast DDS wakes a thread of its own for every sample that a reliable reader gets, which costs as
much as a tenth of the bridge; in its shipped profile one wake-up in 20 ms serves all of them.
"""

from collections.abc import MutableMapping
import os
from pathlib import Path

from drive_can_bridge.resources import config_file

#: what names a file of profiles for Fast DDS, by its version; the first is that of Jazzy
VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
#: files that Fast DDS takes from the working directory by itself
FILES = ('DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml')


def set_up_fast_dds(environment: MutableMapping[str, str] = os.environ) -> None:
    """
    Let Fast DDS use the profile of the bridge, unless somebody has profiles of their own.

    To be called before ``rclpy.init``. Other middleware takes no notice.
    """
    if any(environment.get(name) for name in VARIABLES) or any(
            Path(name).exists() for name in FILES):
        return
    try:
        environment[VARIABLES[0]] = str(config_file('fastdds/profiles.xml'))
    except FileNotFoundError:   # it only costs more
        pass
