"""A serial CAN adapter on a pseudo terminal for the kernel's slcan driver: a real interface with
error states set by the test. It also simulates the sensors and the controller of rig.py."""

import fcntl
import os
import pathlib
import pty
import select
import struct
import threading
import time
import tty

from lab import eventually
from rig import RISE_K_PER_S, note_offset

# Line disciplines of the kernel (linux/tty.h).
TIOCSETD, N_SLCAN = 0x5423, 17


def interfaces():
    return set(os.listdir("/sys/class/net"))


class SerialAdapter:
    """`name` is the kernel's interface. The bus is silent while it is closed or bus-off."""

    def __init__(self):
        self.device, self.terminal = pty.openpty()
        tty.setraw(self.device)
        tty.setraw(self.terminal)
        before = interfaces()
        fcntl.ioctl(self.terminal, TIOCSETD, struct.pack("i", N_SLCAN))
        self.name = eventually(lambda: next(iter(interfaces() - before), None), "an interface")
        self.opened = False
        self.opens = 0
        self.cut = False  # cable cut: nothing in either direction, no error
        self.applied = b"\0\0\0\0"
        self.offsets = []  # as recorded by rig.Monitor
        self.begin = time.monotonic()
        self.unread = b""
        # No frame may follow the line that reports bus-off.
        self.sending = threading.Lock()
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        due = time.monotonic()
        while not self.ending.is_set():
            readable, _, _ = select.select([self.device], [], [], 0.02)
            if readable:
                self.unread += os.read(self.device, 4096)
                *lines, self.unread = self.unread.split(b"\r")
                for line in lines:
                    self.take(line)
            with self.sending:
                if self.opened and not self.cut and time.monotonic() >= due:
                    due = time.monotonic() + 0.05
                    self.send_frames()

    def take(self, line):
        if line.startswith(b"O"):
            self.opened = True
            self.opens += 1
        elif line.startswith(b"C"):
            self.opened = False
        elif line.startswith(b"t200") and self.opened and not self.cut:
            data = bytes.fromhex(line[5:].decode())
            if data[4] & 1:
                self.applied = data[:4]
            note_offset(self.offsets, data)

    def send_frames(self):
        temp_degC = 20.0 + RISE_K_PER_S * (time.monotonic() - self.begin)
        raw = struct.pack("<h", round((temp_degC - 25.0) / 0.001))
        self.send(b"t1814" + (raw + raw).hex().upper().encode())
        self.send(b"t1822" + raw.hex().upper().encode())
        self.send(b"t3004" + self.applied.hex().upper().encode())

    def send(self, line):
        os.write(self.device, line + b"\r")

    def report_state(self, letter):
        """a: active, w: warning, p: passive, b: bus-off, with matching counters."""
        counters = {"a": "000000", "w": "100000", "p": "130000", "b": "000256"}[letter]
        with self.sending:
            if letter == "b":
                self.opened = False
            self.send(f"s{letter}{counters}".encode())

    def close(self):
        self.ending.set()
        self.thread.join(20)
        os.close(self.terminal)
        os.close(self.device)


def is_possible():
    """True in guests only: the interface is in the first network namespace."""
    return "THERMOCOMP_VM" in os.environ and pathlib.Path("/sys/module/slcan").exists()
