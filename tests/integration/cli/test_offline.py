"""Exit statuses and output of the commands without a daemon."""
import csv
import os
import pathlib
import shutil
import stat

import pytest
from conftest import PROGRAM, SOURCE, run

DATA = pathlib.Path(os.environ.get("THERMOCOMP_DATA", SOURCE.parent / "shared" / "data"))
EXAMPLES = SOURCE / "config" / "examples"
MODEL = """format = 1
inputs = ["t1_degC"]
outputs = ["z_um"]
reference = "first_sample"
matrix_um_per_K = [[2.0]]
"""
RUN = "time_s,t1_degC,z_um\n0,20,5\n10,21,8\n20,,9\n30,22,9\n"


@pytest.fixture
def files(tmp_path):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "run.csv").write_text(RUN)
    return tmp_path


def predict(files, run_argument="run.csv", output="out.csv"):
    return run("predict", "--model", "model.toml", run_argument, "-o", output, cwd=files)


def test_help_succeeds_and_a_usage_error_is_status_2():
    assert run("--help").returncode == 0
    assert run("predict", "--help").returncode == 0
    for arguments, result in (
            ([], "thermocomp: which command? One of: init, "), (["nosuch"], "no command nosuch\n"),
            (["enabel"], "thermocomp: no command enabel; did you mean enable?"),
            (["history"], "thermocomp history: which command? One of: check.\n"),
            (["history", "chek", "h.db"],
             "thermocomp history: no command chek; did you mean check?\nthermocomp history --help"),
            (["history", "status"], "thermocomp history: no command status\n"),
            (["history", "\x1b[31m"], "thermocomp history: no command  [31m\n"),
            (["predict"], "required"), (["measured", "z"], "required"), (["measured", "z", "much"], "much"),
            (["check", "a", "b"], "b"), (["watch", "--for", "-1"], "-1")):
        answer = run(*arguments)
        assert answer.returncode == 2, arguments
        assert result in answer.stderr, (arguments, answer.stderr)


def test_check_warns_when_a_first_start_compensates_immediately(tmp_path):
    for model in EXAMPLES.glob("*model*.toml"):
        shutil.copy(model, tmp_path)
    text = (EXAMPLES / "small_machine.toml").read_text()
    key = "enabled_at_first_start = false"
    assert key in text
    (tmp_path / "at_once.toml").write_text(text.replace(key, "enabled_at_first_start = true "))
    answer = run("check", "at_once.toml", cwd=tmp_path)
    assert answer.returncode == 0, answer.stderr
    assert "\nfirst start: COMPENSATES AT ONCE (compensation.enabled" in answer.stdout
    dry = (tmp_path / "at_once.toml").read_text().replace("dry_run = false", "dry_run = true ")
    (tmp_path / "dry.toml").write_text(dry)
    assert "\nfirst start: switched on, in a dry run: nothing is written" in run(
        "check", "dry.toml", cwd=tmp_path).stdout


def test_the_function_block_has_the_registers_that_the_command_prints():
    answer = run("check", "--registers", EXAMPLES / "small_machine.toml")
    assert answer.returncode == 0, answer.stderr
    block = (EXAMPLES / "thermal_offset.st").read_text()
    for printed, read in (("  holding 4..5  int32 ABCD  offset of axis z  ", "holding 4, 5: int32, word order ABCD"),
                          ("  holding 10    uint16      valid bits; bit 0: x, bit 1: y, bit 2: z", "holding 10; axis z is bit 2"),
                          ("  holding 11    uint16      heartbeat", "holding 11 "),
                          ("  input 4..5        int32 ABCD  applied offset of axis z", "input 4, 5: what is added")):
        assert printed in answer.stdout and read in block, (printed, answer.stdout)
    assert "frame 0x200" in run("check", "--registers", EXAMPLES / "can.toml").stdout


def test_predict_writes_predicted_measured_and_residual(files):
    answer = predict(files)
    assert answer.returncode == 0, answer.stderr
    rows = list(csv.DictReader((files / "out.csv").open()))
    assert list(rows[0]) == ["time_s", "z_predicted_um", "z_measured_um", "z_residual_um"]
    assert [float(row["time_s"]) for row in rows] == [0, 10, 30]
    assert [float(row["z_residual_um"]) for row in rows] == [0, 1, 0]
    assert answer.stderr.split() == ["z_um", "0.577", "1.000"]


def test_predict_of_a_selection_refers_to_the_first_row_of_the_file(files):
    answer = predict(files, "run.csv@30:", "-")
    assert answer.returncode == 0
    assert answer.stdout.splitlines()[1].split(",") == ["30", "4", "4", "0"]


def test_predict_reports_missing_measurements(files):
    (files / "run.csv").write_text("time_s,t1_degC,z_measured_um\n0,20,\n10,21,3\n")
    answer = predict(files)
    assert answer.returncode == 0
    assert answer.stderr.splitlines() == [
        "z_um nan nan",
        "z_um: run.csv has no measured value to compare with"]


@pytest.mark.parametrize("name, text", [
    ("model.toml", "format = 2\n"), ("model.toml", MODEL + "surprise = 1\n"),
    ("model.toml", MODEL.replace("2.0", "nan")), ("model.toml", "not toml"),
    ("run.csv", ""), ("run.csv", "time_s,other_degC,z_um\n0,1,2\n"),
    ("run.csv", "time_s,t1_degC,z_um\n0,20,5\n0,21,6\n"),
    ("run.csv", "time_s,t1_degC,z_um\n0,warm,5\n"), ("run.csv", "time_s,t1_degC,z_um\n0,,5\n")])
def test_bad_input_is_refused_by_name_and_leaves_no_output(files, name, text):
    (files / name).write_text(text)
    answer = predict(files)
    assert answer.returncode == 2
    assert name in answer.stderr
    assert sorted(path.name for path in files.iterdir()) == ["model.toml", "run.csv"]


def test_output_that_cannot_be_written_is_status_2(files):
    for output, result in (("nosuch/out.csv", "No such file"), ("/dev/full", "No space left")):
        answer = predict(files, output=output)
        assert answer.returncode == 2
        assert output in answer.stderr and result in answer.stderr, answer.stderr


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no measured data at {DATA} (THERMOCOMP_DATA)")
def test_the_static_model_of_the_spindle_gives_its_known_errors(tmp_path):
    spindle = DATA / "spindle_46h"
    answer = run("predict", "--model", spindle / "static_model.toml",
                 spindle / "hours_00_32.csv", "-o", tmp_path / "out.csv")
    assert answer.returncode == 0, answer.stderr
    rms_um = [float(line.split()[1]) for line in answer.stderr.splitlines()]
    assert rms_um == pytest.approx([2.974, 2.685, 4.680, 4.594, 3.098], abs=0.002)


def test_simulate_is_repeated_by_its_seed(tmp_path):
    machine = EXAMPLES / "machine.toml"
    outputs = {}
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        answer = run("simulate", machine, "-o", tmp_path / name, "--seed", seed)
        if "duration" in answer.stderr:
            pytest.skip("the example runs until it is stopped")
        assert answer.returncode == 0, answer.stderr
        outputs[name] = (tmp_path / name).read_text()
    assert outputs["a"] == outputs["b"] != outputs["c"]
    assert outputs["a"].startswith("time_s,")


@pytest.mark.parametrize("condition, range_um, peak_um, off_hours",
                         [(1, 52, 44, (1, 3)), (2, 49, 42, (1, 3)), (3, 60, 42, (1,))])
def test_the_gate_machine_moves_and_its_tie_cools_as_published(condition, range_um, peak_um,
                                                               off_hours, tmp_path):
    """Teratani et al. 1995: the first peak after 15 min; the tie is nearly constant while the oil
    does not heat, and rises further while it is cold (condition 3, from 1 h to 2 h)."""
    gate = SOURCE / "config/gate_machine"
    machine = tmp_path / "machine.toml"
    machine.write_text("\n".join((gate / name).read_text() for name in (
        f"condition_{condition}.toml", "machine.toml", "network.toml", "machine_axis.toml")))
    assert run("simulate", machine, "-o", tmp_path / "run.csv").returncode == 0
    rows = [{name: float(value) for name, value in row.items()}
            for row in csv.DictReader((tmp_path / "run.csv").open())]
    moved_um = [row["x_um"] - rows[0]["x_um"] for row in rows]
    assert max(moved_um) - min(moved_um) == pytest.approx(range_um, abs=1)
    first = max(row["x_um"] - rows[0]["x_um"] for row in rows if row["time_s"] < 3600)
    assert first == pytest.approx(peak_um, abs=1.5)

    def tie_K(hour):
        near = [row for row in rows if abs(row["time_s"] - 3600 * hour) <= 60]
        places = [row[f"tie_{i}_degC"] - 20 for row in near for i in range(1, 11)]
        return sum(places) / len(places)

    assert tie_K(4.9) > 2.5
    for hour in off_hours:
        assert tie_K(hour + 1) == pytest.approx(tie_K(hour), abs=0.15), hour


def test_a_run_file_is_replayed_through_a_configuration(tmp_path):
    demo = SOURCE / "config" / "demo"
    assert run("simulate", demo / "machine.toml", "-o", tmp_path / "run.csv").returncode == 0
    answer = run("replay", "--config", demo / "thermocompd.toml",
                 f"{tmp_path / 'run.csv'}@:1200", "-o", tmp_path / "out.csv")
    assert answer.returncode == 0, answer.stderr
    header = (tmp_path / "out.csv").read_text().splitlines()[0]
    assert header.startswith("time_s,") and "z_offset_um" in header


@pytest.mark.parametrize("command", ["export", "replay"])
def test_other_files_than_histories_are_refused(tmp_path, command):
    (tmp_path / "h.db").write_text("no database")
    for name in ("h.db", "nosuch.db"):
        answer = run(command, name, "-o", "out.csv", cwd=tmp_path)
        assert answer.returncode == 2
        assert name in answer.stderr
    assert not (tmp_path / "out.csv").exists()


@pytest.fixture
def alone(tmp_path):
    """The program without thermocomp-modelling next to it."""
    (tmp_path / "bin").mkdir()
    return shutil.copy(PROGRAM, tmp_path / "bin")


def test_modelling_commands_name_the_missing_package(alone, tmp_path):
    answer = run("fit", "run.csv", "--outputs", "z_um", program=alone, env={"PATH": str(tmp_path)})
    assert answer.returncode == 2
    assert answer.stderr.count("\n") == 1 and "thermocomp-modelling" in answer.stderr


def test_modelling_commands_hand_everything_to_the_other_program(alone, tmp_path):
    other = tmp_path / "thermocomp-modelling"
    other.write_text('#!/bin/sh\necho "$@"\nexit 1\n')
    other.chmod(other.stat().st_mode | stat.S_IXUSR)
    answer = run("diagnose", "--model", "m.toml", "--help", "-o", "x", program=alone,
                 env={"PATH": f"{tmp_path}:/bin"})
    assert answer.stdout.strip() == "diagnose --model m.toml --help -o x"
    assert answer.returncode == 1
