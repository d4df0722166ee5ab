"""Answers, files and exit statuses of plan, group, fit and tiebar."""
import csv
import json
import math
import pathlib
import random

import pytest

from conftest import PROGRAM, SOURCE, run

EXAMPLES = SOURCE / "config" / "examples"

pytestmark = pytest.mark.skipif(
    not (pathlib.Path(PROGRAM).parent / "thermocomp-modelling").exists(),
    reason="thermocomp-modelling is not in this build")


def test_a_mistyped_command_gets_a_suggestion():
    modelling = pathlib.Path(PROGRAM).parent / "thermocomp-modelling"
    answer = run("thermal-test", "plam", "-o", "sheet.csv")
    assert answer.returncode == 2
    assert "thermal-test: no command plam; did you mean plan?" in answer.stderr, answer.stderr
    answer = run("diagnos", "--model", "m.toml", program=modelling)
    assert answer.returncode == 2
    assert "no command diagnos; did you mean diagnose?" in answer.stderr, answer.stderr


def test_where_a_command_is_missing_those_that_there_are_are_named():
    answer = run("thermal-test")
    assert answer.returncode == 2
    assert "thermal-test: which command? One of: report, plan.\n" in answer.stderr, answer.stderr


def test_help_has_the_exit_statuses_of_this_command():
    for command in (["thermal-test", "plan"], ["thermal-test", "report"], ["plan"], ["fit"]):
        result = run(*command, "--help").stdout
        assert "Exit status: 0 success, 2 usage error or bad input.\n" in result, (command, result)
    assert "Exit status: 0 nothing found, 1 a fault or a departure, 2" in run("inspect", "--help").stdout


def write_tests(folder, count=4):
    """Runs of three places: t1 and t2 alike, t3 slow; z = 5 t1 - 2 t3."""
    files = []
    chance = random.Random(3)
    for test in range(count):
        quick = slow = 0.0
        rows = []
        for minute in range(240):
            heat = (6.0 + 2 * test) * (minute % 80 < 60) + math.sin(0.02 * minute + test)
            quick += (heat - quick) / 10
            slow += (quick - slow) / 60
            noise = [chance.gauss(0, sd_K) for sd_K in (0.01, 0.05, 0.01)]
            rows.append([60 * minute, 20 + quick + noise[0], 21 + 0.7 * quick + noise[1],
                         19 + slow + noise[2],
                         5 * quick - 2 * slow + chance.gauss(0, 0.2)])
        files.append(folder / f"test_{test}.csv")
        with files[-1].open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time_s", "t1_degC", "t2_degC", "t3_degC", "z_um"])
            writer.writerows(rows)
    return files


def test_plan_writes_a_sheet_and_a_run_file_for_each_test(tmp_path):
    answer = run("plan", EXAMPLES / "factors.toml", "--json", "--out", tmp_path / "tests")
    assert answer.returncode == 0, answer.stderr
    plan = json.loads(answer.stdout)
    assert plan["strength"] == 2 and plan["pairs"]["covered"] == plan["pairs"]["possible"]
    assert len(plan["tests"]) == 9
    files = sorted(path.name for path in (tmp_path / "tests").iterdir())
    assert files == ["plan.csv", "sheet.md"] + [f"test_{i:02}.csv" for i in range(1, 10)]
    again = run("plan", EXAMPLES / "factors.toml", "--out", tmp_path / "tests")
    assert again.returncode == 2 and "nothing was written" in again.stderr


def test_plan_apart_proposes_to_move_one_of_two_places_that_moved_alike(tmp_path):
    answer = run("plan", "--apart", *write_tests(tmp_path), "--json")
    assert answer.returncode == 0, answer.stderr
    moves = json.loads(answer.stdout)["moves"]
    assert len(moves) == 1, moves
    assert {moves[0]["column"], *moves[0]["rest"]} == {"t1_degC", "t2_degC"}
    assert moves[0]["correlation"] > 0.98 and moves[0]["hours"] > 0
    assert run("plan").returncode == 2


def test_group_names_places_that_move_alike(tmp_path):
    answer = run("group", *write_tests(tmp_path), "--json", "--picture", tmp_path / "groups.svg")
    assert answer.returncode == 0, answer.stderr
    assert json.loads(answer.stdout)["groups"] == [["t1_degC", "t2_degC"], ["t3_degC"]]
    assert (tmp_path / "groups.svg").read_text().count("<rect") == 1 + 9 + 2


def test_the_place_of_the_room_stays_out_of_the_choice_by_itself(tmp_path):
    files = write_tests(tmp_path)
    for file in files:  # a room that would explain all: z = 5 (room - 20)
        rows = list(csv.reader(file.open()))
        with file.open("w", newline="") as out:
            csv.writer(out).writerows(
                [rows[0] + ["room_degC"]] + [row + [20 + float(row[4]) / 5] for row in rows[1:]])
    few = ("fit", *files, "--outputs", "z_um", "--terms", "1..2", "-o", tmp_path / "model.toml", "--json")
    answer = run(*few)
    assert answer.returncode == 0, answer.stderr
    assert "room_degC: excluded, its name is that of a room" in answer.stderr
    assert "room_degC" not in json.loads(answer.stdout)["inputs"]
    assert "room_degC" in json.loads(run(*few, "--free").stdout)["inputs"]


def test_fit_finds_the_equation_and_its_model_predicts(tmp_path):
    files = write_tests(tmp_path)
    model = tmp_path / "model.toml"
    answer = run("fit", *files, "--outputs", "z_um", "--terms", "2", "-o", model, "--json",
                 "--report", tmp_path / "fit.html")
    assert answer.returncode == 0, answer.stderr
    result = json.loads(answer.stdout)
    assert result["inputs"] == ["t1_degC", "t3_degC"]
    assert result["left_out_rms_um"]["z_um"] < 0.5
    coefficients = {term["place"]: term["um_per_K"] for term in result["terms"]["z_um"]}
    assert coefficients["t1_degC"] == pytest.approx(5, abs=0.1)
    assert coefficients["t3_degC"] == pytest.approx(-2, abs=0.1)
    page = (tmp_path / "fit.html").read_text()
    left_um, none_um = result["left_out_rms_um"]["z_um"], result["no_model_rms_um"]["z_um"]
    assert f"the model leaves {left_um:.2f} µm RMS of {none_um:.1f} µm." in page and "<svg" in page
    predicted = run("predict", "--model", model, files[0], "-o", tmp_path / "out.csv")
    assert predicted.returncode == 0 and float(predicted.stderr.split()[1]) < 0.6


def test_fit_without_options_compares_families_and_writes_the_models_domain(tmp_path):
    files = write_tests(tmp_path)
    model = tmp_path / "model.toml"
    answer = run("fit", *files, "--outputs", "z_um", "-o", model, "--json")
    assert answer.returncode == 0, answer.stderr
    result = json.loads(answer.stdout)
    assert [each["family"] for each in result["families"]] == [
        "none", "static_few", "lagged_few", "physical", "lag_bank"]
    assert sum(each["chosen"] for each in result["families"]) == 1
    assert result["families"][3]["left_out_rms_um"] is None  # there is no signal
    assert result["left_out_rms_um"]["z_um"] < 1.0
    out = tmp_path / "out.csv"
    predicted = run("predict", "--model", model, files[0], "-o", out)
    assert predicted.returncode == 0
    assert predicted.stderr.splitlines()[-1] == "outside 0.000"
    header = out.read_text().splitlines()[0].split(",")
    assert header == ["time_s", "z_predicted_um", "z_measured_um", "z_residual_um", "z_sd_um",
                      "outside"]
    cold = tmp_path / "cold.csv"
    with files[0].open() as file:
        rows = list(csv.reader(file))
    with cold.open("w", newline="") as file:
        csv.writer(file).writerows([rows[0]] + [
            [row[0]] + [float(value) - 15 for value in row[1:4]] + [row[4]] for row in rows[1:]])
    predicted = run("predict", "--model", model, cold, "-o", out)
    assert predicted.stderr.splitlines()[-1] == "outside 1.000"


def test_probings_that_missed_are_left_out_by_diagnose_with_a_line(tmp_path):
    files = write_tests(tmp_path, 2)
    model = tmp_path / "model.toml"
    model.write_text('format = 1\ninputs = ["t1_degC", "t3_degC"]\noutputs = ["z_um"]\n'
                     'reference = "first_sample"\nmatrix_um_per_K = [[5.0, -2.0]]\n')
    lines = files[0].read_text().splitlines()
    for row in (1, 90, 150):  # also the first one, the zero of displacement
        rest, z_um = lines[row].rsplit(",", 1)
        lines[row] = f"{rest},{float(z_um) + 4300.0}"
    missed = tmp_path / "missed.csv"
    missed.write_text("\n".join(lines) + "\n")
    answer = run("diagnose", "--model", model, "--train", files[1], "--test", missed,
                 "--json", tmp_path / "out.json")
    assert answer.returncode == 0, answer.stderr
    assert "missed.csv: z_um: 3 values are left out" in answer.stderr, answer.stderr
    result = json.loads((tmp_path / "out.json").read_text())
    assert result["baseline"]["z_um"]["test_rms_um"] < 1.0, result["baseline"]


def test_tiebar_gives_both_coefficients(tmp_path):
    answer = run("tiebar", EXAMPLES / "gate_machine.toml", "--json", "--ratio", "0.2",
                 "--curves", tmp_path / "curves.svg")
    assert answer.returncode == 0, answer.stderr
    result = json.loads(answer.stdout)
    assert set(result) >= {"Ki_um_per_K", "Kc_um_per_K", "best_tie_height_mm"}
    assert (tmp_path / "curves.svg").read_text().startswith("<svg")


def write_oil(folder):
    """Oil on and off hourly: A - B within minutes, the ties within hours."""
    rows = [["time_s", "side_a_degC", "side_b_degC", "tie_degC"]]
    a, b, tie = 0.0, 0.0, 0.0
    for minute in range(301):
        rows.append([60 * minute, 20 + a, 20 + b, 20 + tie])
        oil = 15.0 if minute // 60 % 2 == 0 else 0.0
        a, b, tie = a + (oil - a) / 8, b + (0.8 * oil - b) / 25, tie + (6.0 - tie) / 70
    path = folder / "oil.csv"
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows(rows)
    return path


def test_tiebar_chooses_ties_for_a_measured_course(tmp_path):
    answer = run("tiebar", EXAMPLES / "gate_machine_two_ties.toml", "--course", write_oil(tmp_path),
                 "--optimise", "--picture", tmp_path / "ties.svg", "--json")
    assert answer.returncode == 0, answer.stderr
    result = json.loads(answer.stdout)
    assert len(result["ties"]) == len(result["best"]["ties"]) == 2
    course, = result["courses"]
    assert course["swing_best_um"] < course["swing_drawn_um"] < course["swing_without_um"]
    assert "best ties" in (tmp_path / "ties.svg").read_text()


def test_tiebar_with_several_ties_refuses_options_for_one():
    answer = run("tiebar", EXAMPLES / "gate_machine_two_ties.toml", "--ratio", "0.2")
    assert answer.returncode == 2 and "--ratio" in answer.stderr
    answer = run("tiebar", EXAMPLES / "gate_machine.toml", "--optimise")
    assert answer.returncode == 2 and "--course" in answer.stderr


@pytest.mark.parametrize("arguments, names", [
    (("fit", "@run", "--outputs", "y_um", "-o", "@out"), "y_um"),
    (("fit", "@run", "--outputs", "z_um", "--terms", "0..9", "-o", "@out"), "--terms"),
    (("fit", "@run", "--outputs", "t1_degC", "-o", "@out"), "displacement"),
    (("group", "@none"), "none.csv"),
    (("plan", "@run"), "test_0.csv"),
    (("tiebar", "@run"), "test_0.csv"),
])
def test_usage_errors_and_bad_input_are_refused(tmp_path, arguments, names):
    places = {"@run": write_tests(tmp_path, 1)[0], "@out": tmp_path / "model.toml",
              "@none": tmp_path / "none.csv"}
    answer = run(*(places.get(word, word) for word in arguments))
    assert answer.returncode == 2 and names in answer.stderr, answer.stderr
    assert not (tmp_path / "model.toml").exists()


def test_place_recommends_and_writes_readable_files(tmp_path):
    meshio = pytest.importorskip("meshio", reason="python3-meshio is not installed")
    result = run("place", SOURCE / "config/demo/structure.toml", "--vtu", tmp_path / "fields.vtu",
                 "--page", tmp_path / "place.html")
    assert result.returncode == 0, result.stderr
    assert len(result.stdout.splitlines()) <= 15, result.stdout
    assert "sensors one by one" in result.stderr
    full = json.loads(run("place", SOURCE / "config/demo/structure.toml", "--json").stdout)
    best = min((each for each in full["methods"].values() if each["sensors"]),
               key=lambda each: each["left_out"]["rms_um"])
    assert f"They leave {best['left_out']['rms_um']:.2f} um RMS" in result.stdout
    mesh = meshio.read(tmp_path / "fields.vtu")
    rise_K, moved_um = mesh.point_data["wet_shift_14400s_K"], mesh.point_data["wet_shift_14400s_um"]
    assert moved_um.shape == (len(mesh.points), 3)
    body = json.loads((tmp_path / "place.html").read_text().split('<script id="body" type="application/json">')[1]
                      .split("</script>")[0])
    shown = next(state for state in body["states"] if state["group"] == "wet_shift" and state["time_s"] == 14400)
    assert max(shown["rise_K"]) == pytest.approx(rise_K.max(), rel=1e-3)
    assert [point["name"] for point in body["points"] if point["is_sensor"]] == [
        sensor["block"] for sensor in best["sensors"]]
