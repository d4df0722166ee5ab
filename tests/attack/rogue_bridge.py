"""A bridge that calls `controller_state` like LinuxCNC's, with arbitrary reports."""

import json
import math
import threading
import time

from lab import connect, request


class RogueBridge:
    PERIOD_S = 0.05

    def __init__(self, axis):
        self.axis = axis
        self.session = 1
        self.taking = True
        self.silent = False
        self.period_s = self.PERIOD_S
        self.raw = None  # function that replaces the params
        self.ending = threading.Event()
        self.path = None
        self.thread = None

    def report_to(self, path):
        self.path = path
        if self.thread is None:
            self.thread = threading.Thread(target=self.run, daemon=True)
            self.thread.start()

    def stop(self):
        self.silent = True

    def start(self):
        self.silent = False

    def restart(self):
        """LinuxCNC restarted: another session, offset 0."""
        self.session += 1
        self.axis.reports_position(0.0)

    def drop_links(self):
        pass

    def close(self):
        self.ending.set()
        if self.thread is not None:
            self.thread.join(5)

    def run(self):
        while not self.ending.wait(self.period_s):
            try:
                with connect(self.path, 10.0) as link, link.makefile("rb") as lines:
                    while not self.ending.wait(self.period_s):
                        if not self.silent:
                            self.exchange(link, lines)
            except (OSError, ValueError):
                continue

    def params(self):
        shown = self.axis.shown_um()
        shown = shown if math.isfinite(shown) else None
        return {"session": self.session, "taking": self.taking, "applied_um": {"z": shown},
                "signals": {}}

    def exchange(self, link, lines):
        link.sendall(request("controller_state", **(self.raw or self.params)()) + b"\n")
        line = lines.readline()
        if not line:
            raise OSError("the daemon has closed the connection")
        result = json.loads(line).get("result")
        if result is None:
            time.sleep(0.02)
            return
        offset = result["offsets_um"].get("z")
        if offset is not None and self.taking:
            self.axis.written(offset)
