"""A controller that can be read but refuses writes, or is slow to read."""

import time

import pytest

from lab import eventually
from plain_devices import Machine, PlainController


class StubbornController(PlainController):
    """Answers writes as configured, without executing them."""

    def start(self):
        self.writes_become = None  # "exception 1", "silence"
        self.read_takes_s = 0.0
        super().start()

    def answer(self, pdu):
        if pdu[0] == 16 and self.writes_become == "exception 1":
            return bytes([pdu[0] | 0x80, 1])
        if pdu[0] != 16:
            time.sleep(self.read_takes_s)
        return super().answer(pdu)

    def serve(self, link):
        if self.writes_become != "silence":
            super().serve(link)
            return
        with link, link.makefile("rb") as stream:
            try:
                while len(head := stream.read(7)) == 7:
                    pdu = stream.read(int.from_bytes(head[4:6], "big") - 1)
                    answer = self.answer(pdu) if pdu[0] != 16 else b""
                    if answer:
                        link.sendall(head[:4] + (len(answer) + 1).to_bytes(2, "big") + head[6:7] +
                                     answer)
            except OSError:
                pass


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


def test_a_refusal_while_running_holds_until_writes_are_accepted_again(machine):
    daemon = machine.start()
    machine.warm_by(12.0)
    daemon.wait_for_offset(12.0)
    machine.controller.writes_become = "exception 1"
    machine.warm_by(30.0)
    status = eventually(lambda: "not_written" in daemon.status()["reasons"] and daemon.status(),
                        "it is reported")
    assert status["mode"] == "holding"
    offset = daemon.axis()["offset"]
    time.sleep(2.0)
    assert daemon.axis()["offset"] == offset
    machine.controller.writes_become = None
    daemon.wait_for_mode("compensating")
    daemon.wait_for_offset(30.0)
    assert daemon.status()["controller"]["last_error"] == ""
    assert "confirmed again" in daemon.log_text()


def test_a_controller_that_is_slowly_read_is_written(machine):
    text = machine.daemon.config.read_text().replace("unit = 1\nperiod_s = 0.02\nvalid",
                                                     "unit = 1\nperiod_s = 0.1\n"
                                                     "timeout_ms = 2000\nvalid")
    text = "".join(line + "\n" for line in text.splitlines() if not line.startswith("applied ="))
    for i in range(3):
        text = text.replace("[[axis]]", f'[[controller.signal]]\nname = "s{i}_rpm"\n'
                            f'table = "input"\naddress = {500 + 300 * i}\nencoding = "uint16"\n'
                            "[[axis]]", 1)
    text = text.replace("[compensation]\n", "[compensation]\ncontroller_stale_after_s = 8.0\n")
    machine.daemon.config.write_text(text)
    machine.controller.read_takes_s = 0.45
    daemon = machine.daemon.start()
    daemon.wait_for_mode("compensating")
    machine.warm_by(6.0)
    eventually(lambda: machine.controller.applied_um() == 6.0, "the offset arrives")
    write = daemon.status()["controller"]["write"]
    assert write["late"] >= 1 and write["last_confirmed_s"] < 6.0, write
