"""Run files in foreign forms: `fit` and `diagnose` report how each was read, and give the same
answers as on the same rows in our form. Ambiguous files cause a question."""
import csv
import datetime
import json
import pathlib
import random

import pytest

from conftest import PROGRAM, run

pytestmark = pytest.mark.skipif(
    not (pathlib.Path(PROGRAM).parent / "thermocomp-modelling").exists(),
    reason="thermocomp-modelling is not in this build")

START = datetime.datetime(2026, 3, 14, 22, 30)
RUNS = 3


def simulated(test):
    """[time_s, t1, t2, rpm, z]: two bodies heated by a spindle that starts and stops."""
    chance = random.Random(test)
    quick = slow = 0.0
    rows = []
    for minute in range(120):
        speed = (1500 + 500 * test) * (minute % 50 < 35)
        quick += (speed / 250 - quick) / 8
        slow += (quick - slow) / 40
        rows.append([60 * minute, round(20 + quick + chance.gauss(0, 0.02), 3),
                     round(19 + slow + chance.gauss(0, 0.02), 3), speed,
                     round(5 * quick - 3 * slow + chance.gauss(0, 0.1), 3)])
    return rows


PLAIN = ["time_s", "t1_degC", "t2_degC", "spindle_rpm", "z_um"]
UNITS = ["Zeit in s", "T1 [°C]", "T2 (°C)", "Drehzahl [1/min]", "z (µm)"]
NAMES_OF_UNITS = {"T1": "t1_degC", "T2": "t2_degC", "Drehzahl": "spindle_rpm", "z": "z_um"}


def comma(value):
    return f"{value:.3f}".replace(".", ",")


def joined(header, rows, separator=",", end="\n", before="", behind=""):
    lines = [separator.join(str(field) for field in row) + behind for row in [header, *rows]]
    return before + end.join(lines) + end


def moment(seconds):
    return START + datetime.timedelta(seconds=seconds)


def with_time(rows, text):
    return [[text(row[0]), *row[1:]] for row in rows]


def german_dates(rows):
    header = ["Zeit", *UNITS[1:]]
    own = with_time(rows, lambda s: moment(s).strftime("%d.%m.%Y %H:%M:%S"))
    return joined(header, [[row[0], *map(comma, row[1:])] for row in own], ";").encode("latin-1")


def minutes_and_kelvin(rows):
    header = ["t (min)", "T1 [°F]", "T2 [°C]", "Drehzahl [U/min]", "z [nm]"]
    return joined(header, [[row[0] / 60, row[1] * 1.8 + 32, row[2], row[3], row[4] * 1000]
                           for row in rows])


def without_units(rows):
    return joined(["Zeit", "T1", "T2", "Drehzahl", "z"], rows, ";")


def mapped(*lines, names=True):
    """A file for --columns, with the model's names."""
    columns = [f'"{name}" = "{ours}"' for name, ours in NAMES_OF_UNITS.items()]
    return "\n".join([*lines, "[columns]", *(columns if names else [])]) + "\n"


NAMED = "\n".join(["[columns]"] + [f'"{name}" = "{ours}"' for name, ours in
                                   zip(UNITS[1:], PLAIN[1:])]) + "\n"


def named(header):
    """A map from the names of a header to ours; the first is the time."""
    return "[columns]\n" + "".join(f'"{name}" = "{ours}"\n'
                                   for name, ours in zip(header, PLAIN[1:]))


# Writer of the rows, map (None: not needed), and words of the report on how they were read. Foreign
# names are mapped so that answers can be compared.
FORMS = {
    "german_dates": (german_dates, NAMED, ["day.month.year", "Latin-1"]),
    "minutes_and_kelvin": (minutes_and_kelvin,
                           named(["T1 [°F]", "T2 [°C]", "Drehzahl [U/min]", "z [nm]"]),
                           ["min", "°F"]),
    "without_units": (without_units, mapped('time = "Zeit"', 'time_unit = "s"'),
                      ["'Drehzahl' is spindle_rpm"]),
}


@pytest.fixture(scope="module", name="plain")
def plain_fixture(tmp_path_factory):
    """Our form of the rows, with the answers of `fit` and `diagnose`."""
    folder = tmp_path_factory.mktemp("plain")
    files = []
    for test in range(RUNS):
        files.append(folder / f"run_{test}.csv")
        with files[-1].open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([PLAIN, *simulated(test)])
    answers = answers_of(files, folder, [])
    for output in answers["stderr"]:
        assert "read as follows" not in output
    return answers


def answers_of(files, folder, options):
    model, found = folder / "model.toml", folder / "found.json"
    fit = run("fit", *files, "--outputs", "z_um", "-o", model, "--json", *options)
    assert fit.returncode == 0, fit.stderr
    base = folder / "base.toml"
    base.write_text('format = 1\ninputs = ["t1_degC", "t2_degC"]\noutputs = ["z_um"]\n'
                    'reference = "first_sample"\nmatrix_um_per_K = [[5.0, 0.0]]\n',
                    encoding="utf-8")
    diagnose = run("diagnose", "--model", base, "--train", *files[:-1], "--test", files[-1],
                   "--json", found, *options)
    assert diagnose.returncode == 0, diagnose.stderr
    return {"fit": json.loads(fit.stdout), "diagnose": json.loads(found.read_text()),
            "stderr": [fit.stderr, diagnose.stderr]}


@pytest.mark.parametrize("form", FORMS)
def test_a_file_of_another_form_is_reported_and_gives_the_same_result(form, plain, tmp_path):
    write, columns, words = FORMS[form]
    files = []
    for test in range(RUNS):
        text = write(simulated(test))
        files.append(tmp_path / f"run_{test}.csv")
        files[-1].write_bytes(text if isinstance(text, bytes) else text.encode())
    (tmp_path / "map.toml").write_text(columns, encoding="utf-8")
    answers = answers_of(files, tmp_path, ["--columns", tmp_path / "map.toml"])
    for output in answers["stderr"]:
        for file in files:
            assert output.count(f"{file.name}: read as follows") == 1, output
        for word in words:
            assert word in output, output
    mine, own = answers["fit"], plain["fit"]
    assert mine["family"] == own["family"] and mine["inputs"] == own["inputs"]
    assert mine["left_out_rms_um"]["z_um"] == pytest.approx(own["left_out_rms_um"]["z_um"], 1e-3)
    mine, own = answers["diagnose"], plain["diagnose"]
    assert mine["verdict"] == own["verdict"] == "effect"
    assert ([(each["cause"], each["subject"]) for each in mine["findings"]] ==
            [(each["cause"], each["subject"]) for each in own["findings"]])
    assert (mine["baseline"]["z_um"]["test_rms_um"] ==
            pytest.approx(own["baseline"]["z_um"]["test_rms_um"], 1e-3))


def slashes(rows):
    # One row per month: both orders are valid and equidistant dates.
    own = with_time(rows[:5], lambda s: f"{s // 60 + 3:02d}/{s // 60 + 4:02d}/2026 08:00:00")
    return joined(["Zeit", *UNITS[1:]], own)


@pytest.mark.parametrize("write, asked", [
    (slashes, ['date_order = "day.month.year" or "month.day.year"']),
], ids=lambda value: getattr(value, "__name__", ""))
@pytest.mark.parametrize("command", ["fit", "diagnose"])
def test_ambiguous_columns_must_be_defined(write, asked, command, tmp_path):
    file = tmp_path / "run.csv"
    file.write_text(write(simulated(0)), encoding="utf-8")
    model = tmp_path / "base.toml"
    if command == "fit":
        answer = run("fit", file, "--outputs", "z_um", "-o", model)
    else:
        model.write_text('format = 1\ninputs = ["t1_degC"]\noutputs = ["z_um"]\n'
                         'reference = "first_sample"\nmatrix_um_per_K = [[5.0]]\n',
                         encoding="utf-8")
        answer = run("diagnose", "--model", model, "--train", file, "--test", file,
                     "--json", tmp_path / "found.json")
    assert answer.returncode == 2
    assert "run.csv" in answer.stderr
    for line in asked:
        assert line in answer.stderr, answer.stderr


def test_test_rows_must_not_be_fitted(tmp_path):
    file = tmp_path / "run.csv"
    with file.open("w", newline="", encoding="utf-8") as text:
        csv.writer(text).writerows([PLAIN, *simulated(0)])
    model = tmp_path / "base.toml"
    model.write_text('format = 1\ninputs = ["t1_degC"]\noutputs = ["z_um"]\n'
                     'reference = "first_sample"\nmatrix_um_per_K = [[5.0]]\n', encoding="utf-8")
    for train, test in ((file, file), (f"{file}@:4000", f"{file}@3000:"),
                        (file, tmp_path / "." / "run.csv")):
        answer = run("diagnose", "--model", model, "--train", train, "--test", test,
                     "--json", tmp_path / "found.json")
        assert answer.returncode == 2 and "run.csv" in answer.stderr, answer.stderr
    answer = run("fit", f"{file}@:4000", f"{file}@3000:", "--outputs", "z_um", "-o", model)
    assert answer.returncode == 2 and "given twice" in answer.stderr


def test_one_map_describes_both_files_of_a_join(tmp_path):
    (tmp_path / "temps.csv").write_text(
        "Zeit;T1\n20.11.2026 10:00:00;20,5\n20.11.2026 10:10:00;21,5\n", encoding="utf-8")
    (tmp_path / "entered.csv").write_text(
        "Zeit;axis;value\n20.11.2026 10:05:00;Z;-0,012\n", encoding="utf-8")
    columns = tmp_path / "columns.toml"
    ask = ("import", tmp_path / "temps.csv", "--join", tmp_path / "entered.csv", "--corrections",
           "steps", "--columns", columns, "-o", tmp_path / "run.csv")
    columns.write_text('[columns]\nT1 = "t1_degC"\nZ = { name = "z_mm", unit = "mm" }\n',
                       encoding="utf-8")
    answer = run(*ask)
    assert answer.returncode == 0, answer.stderr
    assert "time_s,t1_degC,z_um\n0,20.5,\n300,21,12\n600,21.5,\n" in (
        tmp_path / "run.csv").read_text(encoding="utf-8")
    columns.write_text('[columns]\nT2 = "t1_degC"\n', encoding="utf-8")
    answer = run(*ask)
    assert answer.returncode == 2
    assert "T2: is a column neither of " in answer.stderr, answer.stderr
