"""Receives notifications in place of systemd and records them with their times."""

import bisect
import socket
import threading
import time

WATCHDOG_S = 6.0


class ServiceManager:
    """Like systemd with WatchdogSec=6, for a daemon started with `environment`."""

    def __init__(self, path):
        self.path = path
        self.ready = threading.Event()
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
            if "READY=1" in text:
                self.ready.set()

    def times_of(self, word):
        with self.lock:
            return [at for at, text in self.messages if word in text]

    def close(self):
        self.socket.shutdown(socket.SHUT_RDWR)
        self.socket.close()


class Metronome:
    """Wakes every few milliseconds and records its delays: the machine's latency, which is deducted
    from the daemon's."""

    PERIOD_S = 0.005
    NOTED_FROM_S = 0.002

    def __init__(self):
        self.at_s = []
        self.late_s = []
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        due = time.monotonic() + self.PERIOD_S
        while not self.ending.is_set():
            time.sleep(max(0.0, due - time.monotonic()))
            now = time.monotonic()
            if now - due > self.NOTED_FROM_S:
                self.at_s.append(now)
                self.late_s.append(now - due)
            due = max(due + self.PERIOD_S, now)

    def lateness_s(self, since_s, until_s):
        first = bisect.bisect_left(self.at_s, since_s)
        late = 0.0
        for at, lateness in zip(self.at_s[first:], self.late_s[first:]):
            if at - lateness > until_s:
                break
            late = max(late, lateness)
        return late

    def close(self):
        self.ending.set()
        self.thread.join(5)


def largest_gap_s(times, begin, end):
    times = [begin] + [at for at in times if begin < at < end] + [end]
    return max(later - earlier for earlier, later in zip(times, times[1:]))
