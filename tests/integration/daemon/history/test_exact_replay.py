"""`thermocomp replay` gives the daemon's offsets bit for bit, whatever happened to the daemon."""

import time

import pytest

import spindle
from lab import assert_replays_exactly, count_rows, eventually

pytestmark = pytest.mark.skipif(not spindle.is_here(), reason=spindle.MISSING)

ROW_PERIOD_S = 0.025
# Plant time goes by at this rate: a row each 15 s of the run.
PLANT_S_PER_S = 15 / ROW_PERIOD_S


def over_tcp():
    return spindle.modbus_bus("modbus_tcp", "ABCD",
                              ('host = "127.0.0.1"\nport = 0',
                               'host = "127.0.0.1"\nport = @sensors@'),
                              ('host = "127.0.0.1"\nport = 0\nunit = 1',
                               'host = "127.0.0.1"\nport = @cnc@\nunit = 1'))


def smoothing(form, history, half_width_K):
    return (f'form = "{form}"\nhistory = "{history}"\nperiod_s = 0.05\nsamples = 6\n'
            f"half_width_K = {half_width_K}\noutage_s = 2.0\n")


def start(lab, rows, text, events=""):
    """Simulator and daemon over the run's first rows."""
    run = lab.folder / "spindle.csv"
    spindle.write_replay_file(run, rows, ROW_PERIOD_S)
    simulator = lab.simulator(spindle.machine_text(over_tcp(), events), "--replay", run,
                              "--row-period-ms", 1000 * ROW_PERIOD_S, "--start-on-heartbeat",
                              "--stay", "--tick-ms", 2)
    daemon = lab.daemon(text)
    daemon.config.write_text(spindle.with_ports(daemon.config.read_text(), simulator.ready))
    return simulator, daemon.start()


def clipped(daemon):
    return sum(sensor["clipped"] for sensor in daemon.call("sensors")["sensors"])


@pytest.mark.parametrize("form, history", [("sliding_line", "screened"), ("line_of_lines", "raw"),
                                           ("sliding_line", "raw"),
                                           ("line_of_lines", "screened")])
def test_smoothed_offsets_are_replayed_bit_for_bit(lab, form, history):
    text = spindle.daemon_text(over_tcp(), smoothing=smoothing(form, history, 0.02))
    _, daemon = start(lab, 600, text)
    daemon.wait_for_mode("compensating")
    time.sleep(8.0)
    eventually(lambda: clipped(daemon) > 20, "the smoothing had something to do")
    daemon.end()
    columns = assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    assert len(set(columns["ch3_offset_um"])) > 50


EVENTS = [  # real seconds after the rows begin to go by
    ("open_circuit", "t3", 1.0, 2.5, ""),
    ("spike", "t5", 1.5, 0.2, "change_K = 8.0"),
    ("freeze", "t7", 2.0, 2.0, ""),
    ("drift", "t9", 2.5, 3.0, "rate_K_per_h = 20.0"),
    ("exception", "module", 5.0, 0.5, "code = 6"),
    ("garbage", "module", 6.0, 0.3, ""),
    ("drop", "module", 7.0, 2.0, ""),
    ("reboot", "sensors", 10.0, 1.0, ""),
    ("reject", "cnc", 12.0, 1.0, ""),
    ("rehome", "cnc", 14.0, None, ""),
    ("misapply", "cnc", 15.0, 1.0, "change_um = 5.0"),
    ("reboot", "cnc", 17.0, 1.0, ""),
]


def events_text():
    text = ""
    for kind, target, at_s, lasts_s, more in EVENTS:
        text += f'[[event]]\nkind = "{kind}"\ntarget = "{target}"\n{more}\n'
        text += f"at_s = {(spindle.FIRST_ROW_S + at_s) * PLANT_S_PER_S}\n"
        if lasts_s is not None:
            text += f"duration_s = {lasts_s * PLANT_S_PER_S}\n"
    return text


def test_faults_commands_reloads_and_power_cuts_are_replayed_bit_for_bit(lab):
    model = lab.folder / "model.toml"
    model.write_text(spindle.MODEL.read_text())
    limits = "offset_um_max = 40.0\nrate_um_per_s_max = 15.0\n"
    more = ('on_loss = "ramp_to_zero"\nhold_s = 0.3\nmismatch_after_s = 0.3\n'
            "prove_hold_s = 0.2\n")
    text = spindle.daemon_text(over_tcp(), smoothing=smoothing("sliding_line", "screened", 0.05),
                               model="model.toml", limits=limits, more=more)
    text = text.replace("[screening]\n", "[screening]\nstale_after_s = 0.5\n")
    _, daemon = start(lab, 1000, text, events_text())
    daemon.wait_for_mode("compensating")
    end = time.monotonic() + 24.0
    modes, reasons = set(), set()
    turn = 0
    while time.monotonic() < end or turn < 50:
        status = daemon.status()
        modes.add(status["mode"])
        reasons.update(status["reasons"])
        command = (("disable",), ("enable",), ("measured", "ch2", "1.25"), ("cycle-end",),
                   ("prove", "ch1", "3"), ("reference", "--force"))[turn % 6]
        code = daemon.cli(*command)[0]
        # While sensors or controller are away some of these are refused, with a reason.
        assert code == 0 or (code == 1 and command[0] in ("prove", "reference"))
        if turn == 20:
            model.write_text(model.read_text().replace("0.817366", "1.817366", 1))
            daemon.hang_up()
            eventually(lambda: "reloaded: " in daemon.log_text(), "the model was taken over")
        if turn in (10, 40):
            daemon.cli("enable")
            daemon.committed()
            committed = count_rows(daemon.history)
            daemon.kill()
            after = count_rows(daemon.history)
            assert all(kept >= had for had, kept in zip(committed, after))
            assert_replays_exactly(daemon.history, lab.folder / "cut.csv")
            daemon.start()
        turn += 1
        time.sleep(0.25)
    daemon.end()
    columns = assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    segments = count_rows(daemon.history)[0]
    print(f"{turn} commands, {segments} segments, modes {sorted(modes)}, "
          f"reasons {sorted(reasons)}, {len(columns['time_s'])} cycles noted")
    assert segments >= 4  # three starts and a reload
    assert {"compensating", "disabled"} <= modes
    assert {"block_lost", "controller_offline"} & reasons
