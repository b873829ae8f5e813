"""PX4's uploader, as PyPI has it, against a virtual board.

It wants a serial port, and the board is a TCP server: a pseudo-terminal stands between them.
Usage: upload.py PORT FILE, where PORT is the board's on 127.0.0.1. Ends with 0 when it has uploaded.
"""

import os
import socket
import sys
import threading
import tty

from autopilot_tools.px4._px_uploader import px_uploader


def main(port, file):
    board = socket.create_connection(("127.0.0.1", port))
    board.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    ours, theirs = os.openpty()
    tty.setraw(theirs)

    def to_board():
        while data := os.read(ours, 4096):
            board.sendall(data)

    def from_board():
        while data := board.recv(4096):
            os.write(ours, data)

    for way in (to_board, from_board):
        threading.Thread(target=way, daemon=True).start()
    return px_uploader([file], os.ttyname(theirs))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
