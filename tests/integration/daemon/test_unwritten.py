"""A controller that can be read and refuses writes, or does not answer them."""

import time

import pytest

from lab import eventually
from plain_devices import Machine, PlainController


class StubbornController(PlainController):
    """Answers writes as configured, without executing them."""

    def start(self):
        self.writes_become = None  # "exception 1", "silence"
        self.spoil = self.spoil_silence
        super().start()

    def answer(self, pdu, unit=1):
        if pdu[0] == 16 and self.writes_become == "exception 1":
            return bytes([pdu[0] | 0x80, 1])
        if pdu[0] == 16 and self.writes_become == "silence":
            return b""
        return super().answer(pdu, unit)

    def spoil_silence(self, _frame_of, request, answer):
        return [] if request[0] == 16 and self.writes_become == "silence" else [answer]


@pytest.fixture
def machine(lab):
    return Machine(lab, StubbornController)


@pytest.mark.parametrize("how", ["exception 1", "silence"])
def test_without_writes_the_mode_is_not_compensating(machine, how):
    machine.controller.writes_become = how
    daemon = machine.daemon.start()
    status = eventually(lambda: daemon.status()["controller"]["write"][
        "refused" if how == "exception 1" else "unanswered"] >= 3 and daemon.status(), how)
    assert status["mode"] == "starting" and "not_written" in status["reasons"], status
    controller = status["controller"]
    assert controller["online"] and controller["writes"] == 0
    write = controller["write"]
    assert (write["function"], write["address"]) == (16, 0) and write["last_confirmed_s"] is None
    assert write["exception"] == (1 if how == "exception 1" else None)
    output = "function 16, register 0"
    assert output in controller["last_error"]
    exit_status, out, _ = daemon.cli("status")
    assert exit_status == 1 and output in out, out
    begun = time.monotonic()
    failed = daemon.status()["controller"]["write_errors"]
    time.sleep(2.0)
    failed = daemon.status()["controller"]["write_errors"] - failed
    print("failed writes a second:", failed / (time.monotonic() - begun))
    assert failed <= (time.monotonic() - begun) / 0.02 + 2  # one per period
    assert daemon.log_text().count("writes to controller cnc: ") <= 1
    events = daemon.call("events")["events"]
    assert any(output in event["what"] for event in events), events
