#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# scapy 2.5.0, RawPcapNgReader: does not tell which interface of a .pcapng a packet is of.
#
# Ubuntu 24.04 has this version. A capture of can0 and can1 comes out as one stream: the number of the
# interface is read (for link type and resolution), but is not among what a packet is handed out with; scapy
# 2.8.0 hands out the interface's name. Sections behind the first also get the interfaces of the first: their
# list is never cleared, in both versions, so that the second section's link type and resolution are wrong.
#
# Output seen:
#   2.5.0: interface told False, link types of two sections 227 227
#   2.8.0: interface told True, link types of two sections 227 227
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 2.5.0 2.8.0; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "scapy==$version" || exit 77
  "$folder/$version/bin/python" - "$version" <<'PYTHON'
import io
from struct import pack
import sys

from scapy.utils import RawPcapNgReader


def block(kind, content):
    size = pack('<L', 12 + len(content))
    return pack('<L', kind) + size + content + size


def section(link):
    """One interface of this link type, called can0, and one packet."""
    data = pack('>LBB2x', 0x123, 0, 0)
    return (block(0x0A0D0D0A, pack('<LHHq', 0x1A2B3C4D, 1, 0, -1))
            + block(1, pack('<HxxLHH4s4x', link, 0, 2, 4, b'can0'))
            + block(6, pack('<5L', 0, 0, 0, len(data), len(data)) + data))


packets = [about for _, about in RawPcapNgReader(io.BytesIO(section(227) + section(113)))]
told = hasattr(packets[0], 'ifname')
links = [each.linktype for each in packets]
print(f'{sys.argv[1]}: interface told {told}, link types of two sections', *links)
sys.exit((told, links) != (sys.argv[1] == '2.8.0', [227, 227]))
PYTHON
done
