"""`thermocomp replay` gives the daemon's offsets bit for bit, in each form of smoothing. The fault
simulation (tests/faults) covers all other replays."""

import time

import pytest

import spindle
from lab import assert_replays_exactly, eventually

pytestmark = pytest.mark.skipif(not spindle.is_here(), reason=spindle.MISSING)

ROW_PERIOD_S = 0.025


def over_tcp():
    return spindle.modbus_bus("modbus_tcp", "ABCD",
                              ('host = "127.0.0.1"\nport = 0',
                               'host = "127.0.0.1"\nport = @sensors@'),
                              ('host = "127.0.0.1"\nport = 0\nunit = 1',
                               'host = "127.0.0.1"\nport = @cnc@\nunit = 1'))


def smoothing(form, history, half_width_K):
    return (f'form = "{form}"\nhistory = "{history}"\nperiod_s = 0.05\nsamples = 6\n'
            f"half_width_K = {half_width_K}\noutage_s = 2.0\n")


def start(lab, rows, text):
    run = lab.folder / "spindle.csv"
    spindle.write_replay_file(run, rows, ROW_PERIOD_S)
    simulator = lab.simulator(spindle.machine_text(over_tcp()), "--replay", run,
                              "--row-period-ms", 1000 * ROW_PERIOD_S, "--start-on-heartbeat",
                              "--stay", "--tick-ms", 2)
    daemon = lab.daemon(text)
    daemon.config.write_text(spindle.with_ports(daemon.config.read_text(), simulator.ready))
    return daemon.start()


def clipped(daemon):
    return sum(sensor["clipped"] for sensor in daemon.call("sensors")["sensors"])


@pytest.mark.parametrize("form, history", [("sliding_line", "screened"), ("line_of_lines", "raw"),
                                           ("sliding_line", "raw"),
                                           ("line_of_lines", "screened")])
def test_smoothed_offsets_are_replayed_bit_for_bit(lab, form, history):
    text = spindle.daemon_text(over_tcp(), smoothing=smoothing(form, history, 0.02))
    daemon = start(lab, 600, text)
    daemon.wait_for_mode("compensating")
    time.sleep(8.0)
    eventually(lambda: clipped(daemon) > 20, "the smoothing had something to do")
    daemon.end()
    columns = assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    assert len(set(columns["ch3_offset_um"])) > 50
