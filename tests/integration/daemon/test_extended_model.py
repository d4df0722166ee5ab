"""A model extended by `thermocomp diagnose` in the running daemon: its offsets equal the prediction
of the tool from the same readings."""

import re
import tomllib

import numpy as np
import pytest

import spindle
from lab import BIN, read_columns, run_tool

pytestmark = [
    pytest.mark.skipif(not spindle.is_here(), reason=spindle.MISSING),
    pytest.mark.skipif(not (BIN / "thermocomp-modelling").exists(),
                       reason="built without thermocomp-modelling"),
]

ROWS = 400
ROW_PERIOD_S = 0.025
PERIOD_S = 0.01  # of the daemon's cycle
# Rows of 15 s are replayed in 25 ms, so the lags of terms are scaled.
TIME_FACTOR = 15.0 / ROW_PERIOD_S
HEAT_TAU_S = 1200.0
HEAT_UM_PER_RPM = 0.004


def low_pass(values, tau_s, step_s):
    share = -np.expm1(-step_s / tau_s)
    out = np.empty_like(values)
    state = values[0]
    for i, value in enumerate(values):
        state += share * (value - state)
        out[i] = state
    return out


def write_machine_with_heat(path):
    """The measured temperatures, with displacements of the model plus heat that no sensor measures."""
    columns = read_columns(spindle.RUN)
    temps = spindle.temps_degC(columns)
    matrix = np.array(tomllib.loads(spindle.MODEL.read_text())["matrix_um_per_K"])
    heat = HEAT_UM_PER_RPM * low_pass(np.array(columns["spindle_rpm"]), HEAT_TAU_S, 15.0)
    moved = (temps - temps[0]) @ matrix.T + heat[:, None]
    moved += np.random.default_rng(4).normal(0.0, 0.2, moved.shape)
    names = ["time_s", "spindle_rpm"] + [f"t{i + 1}_degC" for i in range(spindle.SENSORS)]
    names += [f"ch{i + 1}_um" for i in range(spindle.AXES)]
    rows = np.column_stack([columns["time_s"], columns["spindle_rpm"], temps, moved])[::4]
    np.savetxt(path, rows, fmt="%.7g", delimiter=",", header=",".join(names), comments="")


def extended_model(folder):
    """The model extended by diagnose, with lags scaled to the replay."""
    run = folder / "heat.csv"
    write_machine_with_heat(run)
    status, printed, errors = run_tool("diagnose", "--model", spindle.MODEL, "--train", f"{run}@:60000",
                                       "--test", f"{run}@60000:", "--out", folder / "answer")
    assert status == 0, errors
    assert "missing_heat_source of spindle_rpm" in printed, printed
    text = (folder / "answer" / "model.toml").read_text()
    assert (folder / "answer" / "report.html").stat().st_size > 10000
    tau_s = float(re.search(r"tau_s = ([0-9.e+-]+)", text)[1])
    assert abs(tau_s / HEAT_TAU_S - 1.0) < 0.05, text
    path = folder / "extended.toml"
    path.write_text(re.sub(r"tau_s = [0-9.e+-]+", f"tau_s = {tau_s / TIME_FACTOR!r}", text))
    return path


def as_bank(path):
    """The same model with its terms as one bank of lags, a temperature in it that at first adds
    nothing and later reduces its own displacement, and a hinge of the speed."""
    text = path.read_text()
    model = tomllib.loads(text)
    term, = model["term"]
    lines = [text[:text.index("[[term]]")], "[[term]]", 'kind = "lag_bank"',
             f'subjects = ["spindle_rpm", "{model["inputs"][0]}"]',
             f"powers = [{term['power']}, 1]", f"tau_s = [0.0, {term['tau_s']!r}]"]
    for output, gain in term["gain_um_per_unit"].items():
        lines.append(f"gain_um_per_unit.{output} = [[0.0, {gain!r}], [0.1, -0.1]]")
    lines += ["[[term]]", 'kind = "signal_hinge"', 'subject = "spindle_rpm"', "above = 2000.0"]
    lines += [f"gain_um_per_unit.{output} = 1e-5" for output in term["gain_um_per_unit"]]
    bank = path.with_name("bank.toml")
    bank.write_text("\n".join(lines) + "\n")
    return bank


def late_um(times_s, rpm_max):
    """Bound on the effect of cycles left out by a busy machine: the daemon's lag follows a new
    speed in the cycle after it, the prediction's at the row before."""
    steps_s = np.diff(times_s)
    left_out_s = np.sum(np.maximum(0.0, steps_s - 1.01 * PERIOD_S))
    return 1e-9 + HEAT_UM_PER_RPM * rpm_max * left_out_s * TIME_FACTOR / HEAT_TAU_S


def last_row_came(temps, times_s):
    """The cycle that read the run's last row. The values then rest for a second; later changes
    belong to the end: readings are lost one by one, and the offsets are held."""
    changes = np.flatnonzero(np.any(np.diff(temps, axis=0) != 0.0, axis=1)) + 1
    still = np.flatnonzero(np.diff(times_s[changes]) > 20 * ROW_PERIOD_S)
    after_rows = [int(i) for i in still if i > ROWS / 2]
    return changes[after_rows[0] if after_rows else -1]


@pytest.mark.parametrize("bank", (False, True))
def test_the_offsets_of_an_extended_model_are_its_prediction(lab, bank):
    model = extended_model(lab.folder)
    if bank:
        model = as_bank(model)
    bus = spindle.modbus_bus("modbus_tcp", "ABCD",
                             ('host = "127.0.0.1"\nport = 0',
                              'host = "127.0.0.1"\nport = @sensors@'),
                             ('host = "127.0.0.1"\nport = 0\nunit = 1',
                              'host = "127.0.0.1"\nport = @cnc@\nunit = 1'))
    run = lab.folder / "spindle.csv"
    spindle.write_replay_file(run, ROWS, ROW_PERIOD_S)
    simulator = lab.simulator(spindle.machine_text(bus), "--replay", run, "--row-period-ms",
                              1000 * ROW_PERIOD_S, "--start-on-heartbeat", "--settle-s", 1,
                              "--tick-ms", 2)
    # Every cycle is recorded, so that the exported rows contain all inputs of the terms.
    daemon = lab.daemon(spindle.daemon_text(bus, rate_hz=round(1 / PERIOD_S), model=model))
    daemon.config.write_text(spindle.with_ports(daemon.config.read_text(), simulator.ready))
    daemon.start()
    simulator.wait(60 + 3 * (spindle.FIRST_ROW_S + ROWS * ROW_PERIOD_S))
    daemon.end()

    exported, out = lab.folder / "exported.csv", lab.folder / "predicted.csv"
    status, _, printed = run_tool("export", daemon.history, "-o", exported)
    assert status == 0, printed
    status, _, printed = run_tool("predict", "--model", model, exported, "-o", out)
    assert status == 0, printed
    rows, predicted = read_columns(exported), read_columns(out)
    offsets = spindle.offsets_um(rows, "offset")
    wanted = -np.column_stack([predicted[f"ch{i + 1}_predicted_um"] for i in range(spindle.AXES)])
    together = np.isin(rows["time_s"], predicted["time_s"])
    times_s = np.array(rows["time_s"])
    before_end = np.arange(len(offsets)) <= last_row_came(spindle.temps_degC(rows), times_s)
    known = (np.all(np.isfinite(offsets), axis=1) & before_end)[together]
    offsets = offsets[together]
    difference = np.abs(offsets - wanted)[known]
    moved = np.ptp(wanted[known], axis=0)
    bound = late_um(times_s, np.nanmax(rows["spindle_rpm"]))
    print(f"{np.sum(known)} cycles, predictions move by {moved} um, largest difference "
          f"{np.max(difference):.3g} um, bound {bound:.3g} um")
    assert np.sum(known) > ROWS
    assert np.all(moved > 5.0)
    assert np.max(difference) <= bound
