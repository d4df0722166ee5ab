"""Independent observers of the attacked daemon, with their own clocks."""

import contextlib
import threading
import time

from lab import Refused, call


class Client:
    """Asks for the status four times a second and records the response times."""

    PAUSE_S = 0.25

    def __init__(self, path):
        self.path = path
        self.waited = []  # (asked at, answered at or None)
        self.asking_since_s = None
        self.paused = True
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.ending.wait(self.PAUSE_S):
            if self.paused:
                continue
            self.asking_since_s = asked = time.monotonic()
            with contextlib.suppress(OSError, ValueError, Refused):
                call(self.path, "status", timeout_s=60.0)
                self.waited.append((asked, time.monotonic()))
            self.asking_since_s = None

    def all_waits(self):
        """Response times including a pending one."""
        since = self.asking_since_s
        return self.waited + ([(since, time.monotonic())] if since else [])

    def close(self):
        self.ending.set()
        self.thread.join(0.1)
