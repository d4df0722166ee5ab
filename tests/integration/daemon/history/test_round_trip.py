"""The output of each command is input of the next: daemon -> export -> inspect -> fit -> predict ->
diagnose -> the daemon again, without an edit."""

import json
import math
import random
import re
import shutil

import pytest

from lab import BIN, eventually, read_columns, run_tool
from plain_devices import Machine

pytestmark = pytest.mark.skipif(not (BIN / "thermocomp-modelling").exists(),
                                reason="built without thermocomp-modelling")

TRUE_UM_PER_K = (5.0, -2.0)  # the daemon's own model has 3.0 and -1.5
STATES = 36
SMOOTHED = ('[smoothing]\nform = "off"',
            '[smoothing]\nform = "sliding_line"\nperiod_s = 0.0\nsamples = 4\nhalf_width_K = 5.0')


def displacement_um(column_degC, spindle_degC):
    return TRUE_UM_PER_K[0] * (column_degC - 20.0) + TRUE_UM_PER_K[1] * (spindle_degC - 20.0)


def live_a_day(machine, seed):
    """Probes the machine in many states. @return the daemon's modelled displacement at each [um]"""
    daemon, chance = machine.daemon, random.Random(seed)
    output = []
    for _ in range(STATES):
        column, spindle = (20.0 + round(chance.uniform(0.0, most), 2) for most in (6.0, 4.0))
        machine.module.show(column, spindle)

        def is_settled():
            inputs = {each["name"]: each for each in daemon.call("sensors")["sensors"]}
            axis = daemon.axis()
            return (abs(inputs["column"]["smoothed_degC"] - column) < 1e-9
                    and abs(inputs["spindle"]["smoothed_degC"] - spindle) < 1e-9
                    and abs(axis["offset"] + axis["displacement"]) < 1e-9
                    and axis["applied"] is not None
                    and abs(axis["applied"] - axis["offset"]) <= 0.001)

        eventually(is_settled, "the offset follows")
        noise_um = chance.gauss(0.0, 0.05)
        left_um = displacement_um(column, spindle) + machine.controller.applied_um() + noise_um
        output.append(daemon.call("measured", axis="z", value_um=left_um)["predicted_um"])
    return output


def must(status, *arguments):
    found, out, output = run_tool(*arguments)
    assert found == status, (arguments, out, output)
    return out, output


@pytest.mark.parametrize("smoothed", [False, True])
def test_round_trip(lab, smoothed):
    machine = Machine(lab)
    text = machine.daemon.config.read_text().replace("rate_um_per_s_max = 8.0",
                                                     "rate_um_per_s_max = 400.0")
    machine.daemon.config.write_text(text.replace(*SMOOTHED) if smoothed else text)
    daemon = machine.start()
    output = live_a_day(machine, seed=5)
    daemon.committed()

    run, predicted = lab.folder / "run.csv", lab.folder / "predicted.csv"
    must(0, "export", daemon.history, "--from", "8 hours ago", "-o", run)
    columns = read_columns(run)
    assert [name for name in columns if name.endswith("_degC")] == ["column_degC", "spindle_degC"]
    probed = [i for i, value in enumerate(columns["z_um"]) if not math.isnan(value)]
    assert len(probed) == STATES
    for i in probed:  # the offset in effect is subtracted
        wanted = displacement_um(columns["column_degC"][i], columns["spindle_degC"][i])
        assert abs(columns["z_um"][i] - wanted) < 0.5
    comments = [line for line in run.read_text().splitlines() if line.startswith("#")]
    assert any(re.match(r"# 0\.000 s: wall time \d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", line)
               for line in comments), comments[:5]
    assert sum("command measured z" in line for line in comments) == STATES

    # Predicted by the daemon's own model: equal to its displacement at each probing.
    must(0, "predict", "--model", machine.model, run, "-o", predicted)
    model_um = read_columns(predicted)["z_predicted_um"]
    assert len(model_um) == STATES
    largest_um = max(abs((model - model_um[0]) - (reported - output[0]))
                     for model, reported in zip(model_um, output))
    print(f"smoothed {smoothed}: {STATES} probings, predict beside the daemon: {largest_um:.2g} um")
    assert largest_um < 1e-9

    # The unchanged file through the tools.
    status, out, _ = run_tool("inspect", run, "--json", "-")
    assert status in (0, 1)
    assert json.loads(out)["runs"][0]["rows"] == len(columns["time_s"])
    middle_s = columns["time_s"][probed[STATES * 2 // 3]]
    fitted = lab.folder / "fitted.toml"
    must(0, "fit", f"{run}@:{middle_s}", "--outputs", "z_um", "-o", fitted)
    _, reported = must(0, "predict", "--model", fitted, f"{run}@{middle_s}:", "-o", predicted)
    left_um = float(re.search(r"^z_um ([\d.]+)", reported, re.MULTILINE)[1])
    assert left_um < 0.5, reported
    findings = lab.folder / "diagnosis"
    must(0, "diagnose", "--model", machine.model, "--train", f"{run}@:{middle_s}", "--test",
         f"{run}@{middle_s}:", "--out", findings, "--json", lab.folder / "diagnosis.json")
    assert json.loads((lab.folder / "diagnosis.json").read_text())["baseline"]["z_um"][
        "test_rms_um"] > 1.0, "the daemon's own model is not the machine's"

    # The fitted model in the daemon gives the predicted displacement.
    shutil.copy(fitted, machine.model)
    assert daemon.cli("reload")[0] == 0
    output = live_a_day(machine, seed=6)
    daemon.committed()
    again = lab.folder / "again.csv"
    # From the row after the first export's last one, without assuming a pause.
    must(0, "export", daemon.history, "--from", str(columns["time_s"][-1] + 0.005), "-o", again)
    must(0, "predict", "--model", machine.model, again, "-o", predicted)
    model_um = read_columns(predicted)["z_predicted_um"]
    assert len(model_um) == STATES
    largest_um = max(abs((model - model_um[0]) - (reported - output[0]))
                     for model, reported in zip(model_um, output))
    print(f"smoothed {smoothed}: fitted model in the daemon beside predict: {largest_um:.2g} um")
    assert largest_um < 0.01
    left = [abs(value) for value in read_columns(predicted)["z_residual_um"]]
    assert max(left) < 0.5
