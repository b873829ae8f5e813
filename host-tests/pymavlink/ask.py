#!/usr/bin/env python3
"""Asks a node for its time with pymavlink, in MAVLink 1 and then in MAVLink 2.

Purpose. Other people's implementation at the other end of the line: does it
    see the node, are its PINGs, TIMESYNCs and commands answered as they must, are the
    parameters listed, and does the log of a test come over whole?
Design. pymavlink takes its version from the environment when it is imported, so
    each version is a call of this script by itself. MAVLink 1 comes first: the
    node broadcasts in 2 from the first frame of it that it receives. Requests follow
    each other, so the time in each answer must be later than the one before.
Limits. It needs a node that was started for it. Times are compared with each
    other and with how long this host waited, not with this host's UTC: the node may
    be on another day.

Usage: ask.py ADDR [SECONDS]   ADDR as in tcp:127.0.0.1:5760; SECONDS to wait for the
first HEARTBEAT, 120 by default. Exit 0: all well; 1: a check failed, which is printed; 2: usage.
"""

import os
import subprocess
import sys
import time

ROUNDS = 10
# The longest time that an answer may take, in s.
PATIENCE = 2.0
# How far the node's elapsed time may be from this host's beyond the time that the
# answers took, in s: an emulator on a busy machine stands still now and then.
SLACK = 2.0
# 2016-01-01 in us of UTC: what is less is a time since boot.
EARLIEST_UTC_US = 1_451_606_400_000_000

# MAV_RESULT.
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
USER_1 = 31_010
TEST_BEGINS, TEST_ENDS = 0, 1
TAKEOFF = 22
REQUEST_MESSAGE = 512
AUTOPILOT_VERSION = 148


class Wrong(Exception):
    """Something that the node did, or did not do."""


def expect(holds, what):
    if not holds:
        raise Wrong(what)


class Node:
    """The node at the other end, by way of pymavlink."""

    def __init__(self, address, version, wait):
        from pymavlink import mavutil

        self.version = version
        self.deadline = time.monotonic() + wait
        self.line = self.connected(mavutil, address)
        self.heartbeat = self.first_heartbeat()

    def connected(self, mavutil, address):
        while True:
            try:
                return mavutil.mavlink_connection(address, dialect="common", retries=0)
            except OSError as error:
                if time.monotonic() > self.deadline:
                    raise Wrong(f"no node at {address}: {error}") from error
                time.sleep(0.2)

    def first_heartbeat(self):
        left = max(self.deadline - time.monotonic(), PATIENCE)
        heartbeat = self.line.wait_heartbeat(timeout=left)
        expect(heartbeat, "no HEARTBEAT")
        spoken = {0xFE: 1, 0xFD: 2}[heartbeat.get_msgbuf()[0]]
        # pymavlink goes over to MAVLink 2 by itself; then 1 cannot be tried.
        expect(spoken <= self.version, "the node has received MAVLink 2 before: start a new one")
        return heartbeat

    @property
    def us(self):
        return self.line.mav.srcSystem, self.line.mav.srcComponent

    def answer(self, kind, fits, patience=PATIENCE):
        """The next message of a kind that fits, or none."""
        deadline = time.monotonic() + patience
        while (left := deadline - time.monotonic()) > 0:
            message = self.line.recv_match(type=kind, blocking=True, timeout=left)
            if message and fits(message):
                magic = {1: 0xFE, 2: 0xFD}[self.version]
                expect(message.get_msgbuf()[0] == magic, f"{kind} in the other MAVLink version")
                return message
        return None

    def ping(self, seq, target=(0, 0), patience=PATIENCE):
        self.line.mav.ping_send(int(time.time() * 1e6), seq, *target)
        return self.answer("PING", lambda answer: answer.seq == seq, patience)

    def timesync(self, ts1):
        self.line.mav.timesync_send(0, ts1)
        return self.answer("TIMESYNC", lambda answer: answer.ts1 == ts1)


def timesync_target(message):
    """The targets of a TIMESYNC in MAVLink 2, which pymavlink 2.4.50 does not know."""
    buffer = bytes(message.get_msgbuf())
    payload = buffer[10 : 10 + buffer[1]].ljust(18, b"\0")
    return payload[16], payload[17]


def check_heartbeat(node):
    heartbeat = node.heartbeat
    who = (heartbeat.get_srcSystem(), heartbeat.get_srcComponent())
    expect(who[1] == 1, f"HEARTBEAT from component {who[1]}, not from the autopilot's")
    kind = (heartbeat.type, heartbeat.autopilot)
    expect(kind == (0, 0), f"HEARTBEAT of type and autopilot {kind}, not GENERIC")


def check_pings_and_timesyncs(node):
    answers = []
    for seq in range(1, ROUNDS + 1):
        asked = time.monotonic()
        ping = node.ping(seq)
        expect(ping, f"PING {seq} not answered within {PATIENCE} s")
        target = (ping.target_system, ping.target_component)
        expect(target == node.us, f"PING {seq} answered to {target}, not to {node.us}")
        answers.append((ping.time_usec * 1_000, 1_000, asked, time.monotonic()))

        asked = time.monotonic()
        # Any 63 bits must come back; the lowest differ in each round.
        ts1 = (seq << 48) + time.monotonic_ns() % (1 << 48)
        sync = node.timesync(ts1)
        expect(sync, f"TIMESYNC {seq} not answered with its own ts1 within {PATIENCE} s")
        expect(sync.tc1 != 0, f"TIMESYNC {seq} answered with a request")
        if node.version == 2:
            target = timesync_target(sync)
            expect(target == node.us, f"TIMESYNC {seq} answered to {target}, not to {node.us}")
        answers.append((sync.tc1, 1, asked, time.monotonic()))
        time.sleep(0.05)

    for before, after in zip(answers, answers[1:]):
        (earlier, _, asked_before, _), (later, unit, _, answered_after) = before, after
        is_utc = [ns >= EARLIEST_UTC_US * 1_000 for ns in (earlier, later)]
        if is_utc == [False, True]:
            continue  # The clock was set between the two.
        # A PING is rounded down to its unit.
        expect(later + unit > earlier, f"time went back: {earlier} ns, then {later} ns")
        passed, waited = (later - earlier) / 1e9, answered_after - asked_before
        expect(passed < waited + SLACK, f"{passed:.3f} s passed while {waited:.3f} s were waited")
    return answers[-1][0]


def check_what_must_not_be_answered(node):
    # To the node: an answer to a question that it did not ask.
    echo = node.ping(1_000, (node.heartbeat.get_srcSystem(), 1), patience=0.5)
    expect(not echo, "a PING with a target was answered")


def check_command(node):
    target = node.heartbeat.get_srcSystem()
    node.line.mav.command_long_send(
        target, 1, REQUEST_MESSAGE, 0, AUTOPILOT_VERSION, 0, 0, 0, 0, 0, 0
    )
    ack = node.answer("COMMAND_ACK", lambda ack: ack.command == REQUEST_MESSAGE)
    expect(ack, "a request for the version was not acknowledged")
    expect(ack.result == ACCEPTED, f"the version was asked for, and refused with {ack.result}")
    node.line.mav.command_long_send(target, 1, TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 0)
    ack = node.answer("COMMAND_ACK", lambda ack: ack.command == TAKEOFF)
    expect(ack, "a command was not acknowledged")
    expect(ack.result == UNSUPPORTED, f"a command was acknowledged with {ack.result}")


def command_test(node, param1, result):
    node.line.mav.command_long_send(
        node.heartbeat.get_srcSystem(), 1, USER_1, 0, param1, 0, 0, 0, 0, 0, 0
    )
    ack = node.answer("COMMAND_ACK", lambda ack: ack.command == USER_1)
    expect(ack, f"USER_1 with {param1} was not acknowledged")
    expect(ack.result == result, f"USER_1 with {param1} was acknowledged with {ack.result}")


def check_parameters(node):
    """All of them by a list, and in MAVLink 2 one by its name; none can be set."""
    system = node.heartbeat.get_srcSystem()
    node.line.mav.param_request_list_send(system, 1)
    values, count = {}, 1
    while len(values) < count:
        value = node.answer("PARAM_VALUE", lambda value: value.param_id not in values)
        expect(value, f"{len(values)} of {count} parameters were listed: {sorted(values)}")
        values[value.param_id] = value.param_value
        count = value.param_count
    expect(values["PC_TICK_US"] in (50, 200, 500, 1000), f"a tick of {values['PC_TICK_US']} us")
    if node.version == 2:
        # The node takes these two in MAVLink 2 only.
        is_tick = lambda value: value.param_id == "PC_TICK_US"
        node.line.mav.param_request_read_send(system, 1, b"PC_TICK_US", -1)
        read = node.answer("PARAM_VALUE", is_tick)
        expect(read and read.param_value == values["PC_TICK_US"], "PC_TICK_US was not read")
        node.line.mav.param_set_send(system, 1, b"PC_TICK_US", 77, 9)
        kept = node.answer("PARAM_VALUE", is_tick)
        expect(kept and kept.param_value == values["PC_TICK_US"], "PC_TICK_US was set")
    return values


def log_data(node, offset, count):
    """A stretch of log 1, by asking again for what is missing."""
    system = node.heartbeat.get_srcSystem()
    stretch, end, silences = bytearray(), offset + count, 0
    while len(stretch) < count:
        here = offset + len(stretch)
        node.line.mav.log_request_data_send(system, 1, 1, here, end - here)
        while len(stretch) < count:
            here = offset + len(stretch)
            piece = node.answer("LOG_DATA", lambda piece: piece.ofs == here, patience=0.5)
            if not piece:
                silences += 1
                expect(silences < 20, f"no LOG_DATA from {here}")
                break
            expect(piece.count > 0, f"the log ends at {here}, not at {end}")
            stretch += bytes(piece.data[: piece.count])
    return bytes(stretch)


def check_log(node):
    """A test of some PINGs; its log has the times of the answers."""
    system = node.heartbeat.get_srcSystem()
    command_test(node, TEST_BEGINS, ACCEPTED)
    answers = []
    for seq in range(100, 100 + 3 * ROUNDS):
        asked = int(time.time() * 1e6)
        node.line.mav.ping_send(asked, seq, 0, 0)
        ping = node.answer("PING", lambda answer: answer.seq == seq)
        expect(ping, f"PING {seq} not answered within {PATIENCE} s")
        answers.append((seq, asked, ping.time_usec))
    command_test(node, 4, DENIED)
    command_test(node, TEST_ENDS, ACCEPTED)
    node.line.mav.log_request_list_send(system, 1, 0, 0xFFFF)
    entry = node.answer("LOG_ENTRY", lambda _: True)
    expect(entry and (entry.id, entry.num_logs) == (1, 1), "the log was not listed")
    log = log_data(node, 0, entry.size)
    lines = log.decode("ascii").splitlines()
    columns = lines[0].split(",")
    expect(columns[:3] == ["sequence", "ping_time_us", "board_time_ns"], f"columns {columns}")
    logged = [[int(field) for field in line.split(",")[:3]] for line in lines[1:]]
    logged = [(seq, asked, board_ns // 1_000) for seq, asked, board_ns in logged]
    expect(logged == answers, f"the log has other times than the answers: {logged} instead of {answers}")
    again = log_data(node, 100, 333)
    expect(again == log[100:433], "a stretch of the log is not that of the whole")
    node.line.mav.log_request_end_send(system, 1)
    node.line.mav.log_erase_send(system, 1)
    expect(node.answer("STATUSTEXT", lambda status: status.text == "log erased"), "not erased")
    return len(logged)


def check_system_time(node):
    message = node.answer("SYSTEM_TIME", lambda _: True)
    expect(message, "no SYSTEM_TIME")
    utc = message.time_unix_usec
    expect(utc == 0 or utc >= EARLIEST_UTC_US, f"SYSTEM_TIME of {utc} us is neither 0 nor UTC")
    return utc


def ask(address, version, wait):
    node = Node(address, version, wait)
    check_heartbeat(node)
    last = check_pings_and_timesyncs(node)
    check_what_must_not_be_answered(node)
    check_command(node)
    parameters = check_parameters(node)
    logged = check_log(node)
    utc = check_system_time(node)
    if last >= EARLIEST_UTC_US * 1_000:
        expect(utc != 0, "PING and TIMESYNC have UTC, SYSTEM_TIME does not")
        state = time.strftime("UTC %Y-%m-%dT%H:%M:%SZ", time.gmtime(last / 1e9))
    else:
        state = f"clock not set, {last / 1e9:.1f} s since boot"
    print(f"MAVLink {version}: {ROUNDS} PINGs and {ROUNDS} TIMESYNCs answered, "
          f"{len(parameters)} parameters, a log of {logged} PINGs; {state}")


def main():
    arguments = sys.argv[1:]
    inner = arguments[:1] == ["--version"]
    version = int(arguments[1]) if inner else None
    arguments = arguments[2:] if inner else arguments
    try:
        address = arguments[0]
        wait = float(arguments[1]) if len(arguments) > 1 else 120.0
    except (IndexError, ValueError):
        print(__doc__, file=sys.stderr)
        return 2
    if inner:
        try:
            ask(address, version, wait)
        except (Wrong, OSError) as wrong:
            print(f"MAVLink {version}: {wrong}", file=sys.stderr)
            return 1
        return 0
    for version in (1, 2):
        environment = {name: value for name, value in os.environ.items() if name != "MAVLINK20"}
        if version == 2:
            environment["MAVLINK20"] = "1"
        call = [sys.executable, __file__, "--version", str(version), address, str(wait)]
        if subprocess.run(call, env=environment, check=False).returncode != 0:
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
