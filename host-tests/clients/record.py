#!/usr/bin/env python3
"""What MAVProxy sends to a board, with the moment of each frame.

Purpose. A board test plays it to the image (`host-tests/virtual-pixhawk/tests/board/traffic.rs`).

Design. MAVProxy at a board on TCP, through the relay of `meet.py`. Once a minute a person asks for
everything: the parameters, the log and a ping; between that MAVProxy is left to itself. A line is a
frame: ms since it connected, and its bytes in hexadecimal.

Limits. Real time: an hour's recording takes an hour.
"""

import argparse
import tempfile
import time
from pathlib import Path

from meet import MavProxy, Relay, fill_log

# What the person types in each minute, and at which second of it.
MINUTE = [(5, "ping"), (10, "param fetch"), (20, "log list"), (25, "log download 1 flight.csv"), (50, "ping")]


class Recorder(Relay):
    """A relay that keeps each frame of the client."""

    def __init__(self, board):
        super().__init__(board)
        self.frames = []
        self.began = None

    def note_asked(self, message):
        super().note_asked(message)
        now = time.monotonic()
        self.began = self.began or now
        self.frames.append((now - self.began, bytes(message.get_msgbuf())))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("port", type=int, help="of the board on this host")
    parser.add_argument("minutes", type=int)
    parser.add_argument("file", type=Path, help="is written")
    options = parser.parse_args()
    board = ("127.0.0.1", options.port)
    fill_log(board)
    relay = Recorder(board)
    relay.start()
    with tempfile.TemporaryDirectory() as name:
        proxy = MavProxy(relay.port, Path(name))
        began = time.monotonic()
        for minute in range(options.minutes):
            for second, command in MINUTE:
                time.sleep(max(0, began + 60 * minute + second - time.monotonic()))
                proxy.say(command)
        time.sleep(max(0, began + 60 * options.minutes - time.monotonic()))
        proxy.end()
    with relay.lock:
        lines = [f"{at * 1e3:.0f} {frame.hex()}\n" for at, frame in relay.frames]
    options.file.write_text("".join(lines))
    print(f"{len(lines)} frames: {dict(relay.asked)}")


if __name__ == "__main__":
    main()
