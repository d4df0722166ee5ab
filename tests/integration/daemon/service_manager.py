"""Receives notifications in place of systemd and records them with their times."""

import socket
import threading
import time

WATCHDOG_S = 6.0


class ServiceManager:
    """Like systemd with WatchdogSec=6, for a daemon started with `environment`."""

    def __init__(self, path):
        self.environment = {"NOTIFY_SOCKET": str(path),
                            "WATCHDOG_USEC": str(round(1e6 * WATCHDOG_S))}
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(path))
        self.lock = threading.Lock()
        self.messages = []
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        while True:
            try:
                text = self.socket.recv(4096).decode()
            except OSError:
                return
            if not text:
                return
            with self.lock:
                self.messages.append((time.monotonic(), text))

    def times_of(self, word):
        with self.lock:
            return [at for at, text in self.messages if text.startswith(word)]

    def close(self):
        self.socket.shutdown(socket.SHUT_RDWR)
        self.socket.close()


class Metronome:
    """Latency of this computer, from a thread that wakes every 20 ms."""

    PERIOD_S = 0.02

    def __init__(self):
        self.beats = [time.monotonic()]
        self.running = True
        threading.Thread(target=self.beat, daemon=True).start()

    def beat(self):
        while self.running:
            time.sleep(self.PERIOD_S)
            self.beats.append(time.monotonic())

    def latest_s(self, begin, end):
        beats = [at for at in list(self.beats) if begin - 1.0 < at < end]
        return max((later - earlier - self.PERIOD_S for earlier, later in zip(beats, beats[1:])),
                   default=0.0)

    def close(self):
        self.running = False


def largest_gap_s(times, begin, end):
    times = [begin] + [at for at in times if begin < at < end] + [end]
    return max(later - earlier for earlier, later in zip(times, times[1:]))
