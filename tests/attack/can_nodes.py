"""A controller and a thermocouple node on CAN interfaces, with raw frames."""

import contextlib
import math
import select
import socket
import struct
import threading
import time

OFFSET, APPLIED, TEMPERATURES = 0x200, 0x300, 0x181
PERIOD_S = 0.02
SO_TIMESTAMPNS = 35


def open_bus(interface):
    bus = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    bus.settimeout(PERIOD_S)
    bus.bind((interface,))
    return bus


def wall_less_monotonic_s():
    """Difference of the clocks, from the reading with the shortest interval."""
    def read():
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        return after - before, wall - 0.5 * (before + after)
    return min(read() for _ in range(50))[1]


CLOCKS_APART_S = wall_less_monotonic_s()


def receive(bus):
    """A frame and the CLOCK_MONOTONIC of its reception by the kernel."""
    data, ancillary, _, _ = bus.recvmsg(16, 64)
    for level, kind, stamp in ancillary:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS:
            seconds, nanoseconds = struct.unpack("=2q", stamp[:16])
            at_s = seconds + 1e-9 * nanoseconds - CLOCKS_APART_S
            return data, min(at_s, time.monotonic())
    return data, time.monotonic()


def frame(identifier, data):
    return struct.pack("=IB3x8s", identifier, len(data), data)


class CanThermocouples:
    encoding, scale = "int16", 0.01

    def __init__(self, interface):
        self.temps_degC = (20.0, 20.0)
        self.data = None  # payload that replaces the temperatures
        self.ending = threading.Event()
        self.bus = open_bus(interface)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def show(self, column_degC, spindle_degC=20.0):
        self.temps_degC = (column_degC, spindle_degC)

    def run(self):
        while not self.ending.wait(PERIOD_S):
            data = self.data or struct.pack("<2h", *(
                max(-32768, min(32767, round(100 * temp))) for temp in self.temps_degC))
            with contextlib.suppress(OSError):
                self.bus.send(frame(TEMPERATURES, data))

    def close(self):
        self.ending.set()
        self.thread.join(5)
        self.bus.close()


class CanController:
    """Applies offset frames with the valid bit set; reports the applied offset each PERIOD_S, after all frames received
    by then: on a busy machine, others would count as written after what this report shows."""

    def __init__(self, axis, interface, shown_as, shown_scale):
        self.axis = axis
        self.shown_as, self.shown_scale = shown_as, shown_scale
        self.silent = False
        self.ending = threading.Event()
        self.bus = open_bus(interface)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def stop(self):
        self.silent = True

    def start(self):
        self.silent = False

    def restart(self):
        self.axis.reports_position(0.0)

    def drop_links(self):
        pass

    def run(self):
        shown_at = 0.0
        while not self.ending.is_set():
            with contextlib.suppress(OSError):
                self.take(*receive(self.bus))
            if not self.silent and time.monotonic() - shown_at >= PERIOD_S:
                shown_at = time.monotonic()
                with contextlib.suppress(OSError):
                    while select.select([self.bus], [], [], 0)[0]:
                        self.take(*receive(self.bus))
                    self.show()
                    self.axis.shown_arrived()

    def show(self):
        self.bus.send(frame(APPLIED, self.applied()))

    def take(self, received, at_s):
        identifier, length = struct.unpack("=IB", received[:5])
        if self.silent or identifier != OFFSET or length < 6:
            return
        counts, valid = struct.unpack("<iB", received[8:13])
        if valid & 1:
            self.axis.written(0.001 * counts, at_s=at_s)

    def applied(self):
        shown = self.axis.shown_um()
        if self.shown_as == "float32":
            return struct.pack("<f", shown / self.shown_scale)
        counts = round(shown / self.shown_scale) if math.isfinite(shown) else 0
        return struct.pack("<i", max(-2**31, min(2**31 - 1, counts)))

    def close(self):
        self.ending.set()
        self.thread.join(5)
        self.bus.close()


NODES = (0x201, 0x202)  # of a travel; each with its set number
NODES_APPLIED = (0x301, 0x303)
POSITION = 0x302


class CanTravelController(CanController):
    """Interpolates between two nodes with equal offsets: different ones are a mixture of sets.
    `spoil` may lose, repeat and delay the nodes' frames, `spoil_shown` those of the read-back."""

    FORGOTTEN_AFTER_S = 1.0

    def __init__(self, *arguments):
        self.nodes = {}  # identifier: (counts, number, at_s) of its newest frame
        self.in_effect = 0
        self.mixtures = 0
        self.valid = False
        self.forgets = True
        self.spoil = self.spoil_shown = lambda frames: frames
        super().__init__(*arguments)

    def restart(self):
        self.nodes.clear()
        self.in_effect = 0
        super().restart()

    def take(self, received, at_s):
        identifier, length = struct.unpack("=IB", received[:5])
        if self.silent or identifier not in (OFFSET, *NODES) or length < 5:
            return
        if identifier == OFFSET:
            self.valid = received[12] & 1 != 0
            self.take_over()
            return
        for identifier, counts, number, at_s in self.spoil(
                [(identifier, *struct.unpack("<iB", received[8:13]), at_s)]):
            self.nodes[identifier] = (counts, number, at_s)
            self.take_over()

    def take_over(self):
        """Called for each frame; applies the set once it seems complete."""
        if not self.valid or len(self.nodes) < len(NODES):
            return
        near, far = (self.nodes[identifier] for identifier in NODES)
        if near[1] != far[1] or near[1] == self.in_effect:
            return
        if self.forgets and time.monotonic() - min(near[2], far[2]) > self.FORGOTTEN_AFTER_S:
            return
        self.mixtures += near[0] != far[0]
        self.in_effect = near[1]
        self.axis.written(0.001 * near[0], at_s=max(near[2], far[2]))

    def show(self):
        data = self.applied() + bytes([self.in_effect])
        for identifier in self.spoil_shown(list(NODES_APPLIED)):
            self.bus.send(frame(identifier, data))
        self.bus.send(frame(POSITION, struct.pack("<H", 100)))
