#!/usr/bin/env python3
"""A hand for `yawara haptic SCENE --udp PORT`: presses a tool down, holds it and takes it back.

A bridge to a real device (CHAI3D, OpenHaptics) has this loop with the device's position in place of
`path`, and gives the force to the device in place of keeping it. Python's own library is all that it needs.

    python3 haptic_client.py --port 5005 --down-mm 48 --seconds 4
"""

import argparse
import json
import select
import socket
import struct
import sys
import time

POSE = struct.Struct("<4sHHQ3d")  # magic, version, kind 1, sequence, position (m)
FORCE = struct.Struct("<4sHHQQ3d3d")  # magic, version, kind 2, sequence, answers, force (N), tool (m)
HEADER = struct.Struct("<4sHH")
MAGIC, VERSION = b"YWHP", 1


def path(seconds, whole_s, down_m):
    """Down along the scanner's last axis in a quarter of the time, there, and back in the last quarter."""
    share = seconds / whole_s
    return (0.0, 0.0, -down_m * max(0.0, min(1.0, 4.0 * share, 4.0 * (1.0 - share))))


def read(packet):
    """The fields of a force, or None for another packet; ends where versions differ."""
    magic, version, kind = HEADER.unpack_from(packet) if len(packet) >= HEADER.size else (b"", 0, 0)
    if magic == MAGIC and version != VERSION:
        sys.exit(f"yawara speaks version {version} of the protocol, this is a client of version {VERSION}")
    if magic != MAGIC or kind != 2 or len(packet) != FORCE.size:
        return None
    _, _, _, sequence, answers, *numbers = FORCE.unpack(packet)
    return sequence, answers, numbers[:3], numbers[3:]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--down-mm", type=float, default=10.0)
    parser.add_argument("--rate-hz", type=float, default=1000.0)
    arguments = parser.parse_args()
    device = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    device.connect((arguments.host, arguments.port))
    device.setblocking(False)
    begin, sent, newest = time.perf_counter(), {}, 0
    forces, delays, lost = [], [], 0
    sequence = 0
    while (now := time.perf_counter() - begin) < arguments.seconds:
        sequence += 1
        sent[sequence] = now
        place = path(now, arguments.seconds, 1e-3 * arguments.down_mm)
        try:
            device.send(POSE.pack(MAGIC, VERSION, 1, sequence, *place))
            due = begin + sequence / arguments.rate_hz
            while select.select([device], [], [], max(0.0, due - time.perf_counter()))[0]:
                got = read(device.recv(256))
                if got is None or got[0] <= newest:
                    continue
                lost += got[0] - newest - 1 if newest else 0
                newest = got[0]
                if (at := sent.pop(got[1], None)) is not None:
                    delays.append(time.perf_counter() - begin - at)
                forces.append((now, *got[2], *got[3]))
        except ConnectionRefusedError:
            time.sleep(0.01)  # Nobody listens yet, or any more.
    delays.sort()
    strongest = max((force[1:4] for force in forces), key=lambda f: sum(x * x for x in f), default=None)
    summary = {
        "poses": sequence,
        "forces": len(forces),
        "lost": lost,
        "delay_ms": {
            name: 1e3 * delays[min(len(delays) - 1, int(part * len(delays)))] if delays else None
            for name, part in (("p50", 0.5), ("p99", 0.99))
        },
        "strongest_n": strongest,
        "deepest_tool_m": min((force[6] for force in forces), default=None),
    }
    print(json.dumps(summary, indent=1))


if __name__ == "__main__":
    main()
