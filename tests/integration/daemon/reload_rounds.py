"""Consecutive reloads by socket and SIGHUP, each with another model, while clients query and operate."""

import statistics
import threading
import time

from lab import Refused, assert_replays_exactly, eventually
from plain_devices import MODEL, Machine
from service_manager import WATCHDOG_S, ServiceManager, largest_gap_s

OFFSET_UM = 6.0
CLIENTS = 4


class ReloadRounds:
    def __init__(self, lab, rate_hz):
        self.lab = lab
        self.rate_hz = rate_hz
        self.manager = lab.also_end(ServiceManager(lab.sockets / "notify"))
        self.machine = Machine(lab)
        self.daemon = self.machine.daemon
        self.daemon.environment = self.manager.environment
        self.daemon.write_config(
            self.machine.config.replace("rate_hz = 100", f"rate_hz = {rate_hz}"))
        self.running = True
        self.answers_s = []
        self.reloads_s = []
        self.wrong = []
        self.hung_up_at = 0

    def ask(self, number):
        """Each client queries; the first also switches off and on and checks that it holds."""
        while self.running:
            begun = time.monotonic()
            status = self.daemon.status()
            self.answers_s.append(time.monotonic() - begun)
            if number == 0:
                self.switch(status)
            time.sleep(0.02)

    def switch(self, status):
        method = "disable" if status["enabled"] else "enable"
        try:
            self.daemon.call(method)
        except Refused as refusal:
            self.wrong.append(f"{method}: {refusal}")
            return
        if self.daemon.status()["enabled"] != (method == "enable"):
            self.wrong.append(f"{method} was done, and is not")

    def reload(self, number):
        """Another gain each time, which the status must show."""
        self.machine.model.write_text(MODEL.replace("3.0,", f"{3.0 + 0.001 * (number % 7)},"))
        begun = time.monotonic()
        if len(self.reloads_s) % 5 == 4 and self.hung_up_at != len(self.reloads_s):
            self.hung_up_at = len(self.reloads_s)
            for _ in range(3):
                self.daemon.hang_up()
        try:
            checksum = self.daemon.call("reload")["checksum"]
        except Refused as refusal:
            if "in progress" not in str(refusal):
                self.wrong.append(f"reload {number}: {refusal}")
            time.sleep(0.2 / self.rate_hz)
            return
        self.reloads_s.append(time.monotonic() - begun)
        if self.daemon.status()["model"]["checksum"] != checksum:
            self.wrong.append(f"reload {number}: another model is shown")

    def run(self, rounds):
        self.machine.start()
        self.machine.warm_by(OFFSET_UM)
        clients = [threading.Thread(target=self.ask, args=(i,)) for i in range(CLIENTS)]
        begin = time.monotonic()
        try:
            for client in clients:
                client.start()
            number = 0
            while len(self.reloads_s) < rounds:
                self.reload(number)
                number += 1
        finally:
            self.running = False
            for client in clients:
                client.join()
        self.gap_s = largest_gap_s(self.manager.times_of("WATCHDOG=1"), begin, time.monotonic())
        eventually(lambda: len(self.manager.times_of("READY=1")) ==
                   1 + len(self.manager.times_of("RELOADING=1")), "each reload ends for systemd")
        enabled = self.daemon.status()["enabled"]
        self.daemon.kill()
        self.daemon.start()
        if self.daemon.status()["enabled"] != enabled:
            self.wrong.append("the operator's switch was lost")
        self.daemon.end()
        assert_replays_exactly(self.daemon.history, self.lab.folder / "out.csv")

    def print_figures(self):
        print(f"rate {self.rate_hz} Hz")
        print(f"reloads {len(self.reloads_s)} reloads")
        print(f"reload_median {1000 * statistics.median(self.reloads_s):.1f} ms")
        print(f"reload_longest {1000 * max(self.reloads_s):.1f} ms")
        print(f"answers {len(self.answers_s)} answers")
        print(f"answer_longest {1000 * max(self.answers_s):.1f} ms")
        print(f"watchdog_gap_longest {self.gap_s:.2f} s")
        print(f"watchdog_period {WATCHDOG_S:.2f} s")
        print(f"wrong {len(self.wrong)} answers or states")
        for wrong in self.wrong:
            print("wrong:", wrong)
