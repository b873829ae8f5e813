#!/usr/bin/env python3
"""MAVProxy and MAVSDK beside each other against one board.

Purpose. What people use on the ground has to find the board, get what it asks for, and not ask for
anything again and again: a line is narrow.

Design. Each client talks to the board through a relay of its own, which counts the kinds of messages
that go either way. MAVProxy is driven by its own command line, MAVSDK by its server and the Python
bindings. When both have what they wanted, the relays listen for a while longer: what is still
asked is what would be asked for ever.

Limits. The address is a TCP server's, as `cargo xtask sim` has one. Exit 0: all is well; 1: not.
"""

import argparse
import asyncio
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

# What a client may send as long as it runs: it says that it is there, or keeps time.
ALIVE = {"HEARTBEAT", "PING", "TIMESYNC", "SYSTEM_TIME", "REQUEST_DATA_STREAM", "GPS_GLOBAL_ORIGIN"}
# How long requests are counted after everything was answered, in s.
LISTEN_S = 20
# So often may a client ask for one thing meanwhile.
MOST = 2


class Relay(threading.Thread):
    """A line to the board, and what goes over it."""

    def __init__(self, board):
        super().__init__(daemon=True)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.board = board
        self.asked = Counter()
        self.answered = Counter()
        self.texts = []
        self.lock = threading.Lock()

    def run(self):
        while True:
            client, _ = self.listener.accept()
            board = socket.create_connection(self.board)
            for source, sink, note in [
                (client, board, self.note_asked),
                (board, client, self.note_answered),
            ]:
                threading.Thread(target=self.pump, args=(source, sink, note), daemon=True).start()

    def pump(self, source, sink, note):
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        try:
            while data := source.recv(4096):
                sink.sendall(data)
                for message in parser.parse_buffer(data) or []:
                    with self.lock:
                        note(message)
        except OSError:
            pass
        finally:
            for end in (source, sink):
                end.close()

    def note_asked(self, message):
        kind = message.get_type()
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            kind += f" {message.command}"
            if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
                kind += f" of {message.param1:.0f}"
        self.asked[kind] += 1

    def note_answered(self, message):
        self.answered[message.get_type()] += 1

    def repeated(self):
        """What is asked while LISTEN_S pass."""
        with self.lock:
            before = self.asked.copy()
        time.sleep(LISTEN_S)
        with self.lock:
            asked = self.asked - before
        return {kind: count for kind, count in asked.items() if kind not in ALIVE and count > MOST}


class Check:
    """What was looked at, and what went wrong."""

    def __init__(self):
        self.wrong = []

    def that(self, is_so, what, details=""):
        print(("ok    " if is_so else "WRONG ") + what + (f": {details}" if details and not is_so else ""))
        if not is_so:
            self.wrong.append(what)


class MavProxy:
    """MAVProxy's own program, at its command line."""

    def __init__(self, port, folder):
        self.folder = folder
        program = Path(sys.executable).with_name("mavproxy.py")
        self.output = []
        self.process = subprocess.Popen(
            [
                sys.executable, str(program), f"--master=tcp:127.0.0.1:{port}",
                "--state-basedir", str(folder), "--logfile", "flight.tlog", "--streamrate=-1",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=folder,
            text=True,
            errors="replace",
            env={**os.environ, "MAVLINK20": "1", "TERM": "dumb"},
        )
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            self.output.append(line.rstrip())

    def say(self, command):
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()

    def saw(self, pattern, timeout_s=15):
        """Whether a line with this comes, or has come."""
        until = time.monotonic() + timeout_s
        while time.monotonic() < until:
            if any(re.search(pattern, line) for line in list(self.output)):
                return True
            time.sleep(0.1)
        return False

    def end(self):
        self.process.terminate()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()


def meet_mavproxy(check, relay, folder):
    proxy = MavProxy(relay.port, folder)
    check.that(proxy.saw("Detected vehicle|online system"), "MAVProxy finds the board", proxy.output)
    check.that(proxy.saw("Received .* parameters"), "MAVProxy has the parameters", proxy.output)
    proxy.say("param show PC_*")
    check.that(proxy.saw(r"PC_VARIANT"), "MAVProxy shows a parameter", proxy.output)
    proxy.say("ping")
    check.that(proxy.saw("ping response: "), "MAVProxy's ping is answered", proxy.output)
    proxy.say("log list")
    check.that(proxy.saw(r"Log 1"), "MAVProxy lists the log", proxy.output)
    proxy.say("log download 1 mavproxy.csv")
    file = folder / "mavproxy.csv"
    check.that(proxy.saw("Finished downloading", 60), "MAVProxy has the log", proxy.output[-20:])
    return proxy, file


async def meet_mavsdk(check, port, folder):
    from mavsdk import System
    from mavsdk.log_files import LogFilesError

    system = System()
    await system.connect(system_address=f"tcp://127.0.0.1:{port}")

    async def connected():
        async for state in system.core.connection_state():
            if state.is_connected:
                return True

    check.that(await asyncio.wait_for(connected(), 20), "MAVSDK finds the board")
    version = await asyncio.wait_for(retried(system.info.get_version), 30)
    release = (version.flight_sw_major, version.flight_sw_minor, version.flight_sw_patch)
    check.that(release == (0, 1, 0), "MAVSDK has the version", release)
    tick = await asyncio.wait_for(system.param.get_param_float("PC_TICK_US"), 10)
    check.that(tick == 50.0, "MAVSDK reads a parameter", tick)
    params = await asyncio.wait_for(system.param.get_all_params(), 20)
    names = sorted(param.name for param in params.float_params)
    check.that("PC_LOG_LEN" in names and len(names) >= 6, "MAVSDK has all parameters", names)
    began = time.monotonic()
    try:
        await asyncio.wait_for(system.param.get_param_float("PC_NONE"), 10)
        check.that(False, "MAVSDK misses a parameter that is not there")
    except Exception:
        check.that(True, "MAVSDK misses a parameter that is not there")
    print(f"      after {time.monotonic() - began:.2f} s")
    try:
        entries = await asyncio.wait_for(system.log_files.get_entries(), 20)
        check.that(len(entries) == 1, "MAVSDK lists the log", entries)
        path = folder / "mavsdk.csv"
        async for _ in system.log_files.download_log_file(entries[0], str(path)):
            pass
        return system, path
    except LogFilesError as error:
        check.that(False, "MAVSDK has the log", error)
        return system, None


async def retried(ask):
    """The first answer: MAVSDK asks for a version itself, and says meanwhile that it has none."""
    while True:
        try:
            return await ask()
        except Exception:
            await asyncio.sleep(0.5)


def fill_log(board):
    """Some PINGs for the log, by pymavlink."""
    link = mavutil.mavlink_connection(f"tcp:{board[0]}:{board[1]}", source_system=254, dialect="common", retries=60)
    link.wait_heartbeat(timeout=10)
    link.mav.command_long_send(1, 1, 31010, 0, 0, 0, 0, 0, 0, 0, 0)
    for seq in range(200):
        link.mav.ping_send(int(time.time() * 1e6), seq, 0, 0)
        time.sleep(0.01)
    time.sleep(0.5)
    link.mav.command_long_send(1, 1, 31010, 0, 1, 0, 0, 0, 0, 0, 0)
    time.sleep(0.5)
    link.close()


async def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("port", type=int, help="of the board on this host")
    board = ("127.0.0.1", parser.parse_args().port)
    check = Check()
    fill_log(board)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        relays = [Relay(board), Relay(board)]
        for relay in relays:
            relay.start()
        loop = asyncio.get_running_loop()
        of_proxy = loop.run_in_executor(None, meet_mavproxy, check, relays[0], folder)
        system, by_sdk = await meet_mavsdk(check, relays[1].port, folder)
        proxy, by_proxy = await of_proxy
        for who, file in [("MAVProxy", by_proxy), ("MAVSDK", by_sdk)]:
            lines = file.read_bytes().split(b"\r\n") if file and file.exists() else []
            is_whole = len(lines) == 202 and lines[0].startswith(b"sequence,")
            check.that(is_whole, f"{who}'s log is whole", len(lines))
        versions = [relay.answered["AUTOPILOT_VERSION"] for relay in relays]
        check.that(all(versions), "both have the version", versions)
        for who, relay in [("MAVProxy", relays[0]), ("MAVSDK", relays[1])]:
            repeated = await loop.run_in_executor(None, relay.repeated)
            check.that(not repeated, f"{who} repeats nothing for ever", repeated)
            print(f"      {who} asked: {dict(relay.asked)}")
        proxy.end()
        system._stop_mavsdk_server()
    sys.stdout.flush()
    # MAVSDK's threads do not end by themselves.
    os._exit(1 if check.wrong else 0)


if __name__ == "__main__":
    asyncio.run(main())
