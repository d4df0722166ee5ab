"""`thermocomp correction`: gains from probed days, applied to the model and used by the daemon's estimator."""
import math
import re

import pytest
from conftest import SOURCE, run

EXAMPLES = SOURCE / "config" / "examples"
GROUPS = '[[correction.group]]\ninputs = ["spindle_degC"]\n[[correction.group]]\ninputs = ["column_degC"]\n'


def day(path, gain, tau_s=1800.0):
    """Two hours of spindle heat; displacement is `gain` times the model's."""
    lines = ["time_s,column_degC,spindle_degC,x_um,z_um"]
    for i in range(240):
        time_s = 60.0 * i
        on = 1.0 - math.exp(-min(time_s, 7200.0) / tau_s)
        spindle_K = 8.0 * on * (1.0 if time_s <= 7200.0 else math.exp(-(time_s - 7200.0) / tau_s))
        column_K = 0.2 * spindle_K
        z_um = gain * 3.0 * spindle_K + 2.0 * column_K
        lines.append(f"{time_s},{20 + column_K:.4f},{20 + spindle_K:.4f},,{z_um:.4f}")
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def lab(tmp_path):
    model = ('format = 1\ninputs = ["column_degC", "spindle_degC"]\noutputs = ["x_um", "z_um"]\n'
             'reference = "first_sample"\nmatrix_um_per_K = [[0.0, 0.0], [2.0, 3.0]]\n')
    (tmp_path / "model.toml").write_text(model)
    text = (EXAMPLES / "modbus_tcp.toml").read_text()
    text = re.sub(r'(\[model\]\nfile = )"[^"]*"', r'\1"model.toml"', text)
    (tmp_path / "config.toml").write_text(
        text + '\n[correction]\nform = "recursive"\nnoise_um = 0.5\n' + GROUPS)
    for name, gain in (("day_1", 1.25), ("day_2", 1.35), ("day_3", 1.3)):
        day(tmp_path / f"{name}.csv", gain)
    return tmp_path


def correction(lab, *records, output="recorded.toml"):
    return run("correction", *records, "--config", "config.toml", "-o", output, cwd=lab)


def last_offset(lab, model, record):
    config = lab / "replayed.toml"
    config.write_text((lab / "config.toml").read_text().replace('"model.toml"', f'"{model}"'))
    assert run("check", config, cwd=lab).returncode == 0
    answer = run("replay", "--config", config, record, "-o", "out.csv", cwd=lab)
    assert answer.returncode == 0, answer.stderr
    rows = [line.split(",") for line in (lab / "out.csv").read_text().splitlines()]
    at = rows[0].index("z_offset_um")
    return min(float(row[at]) for row in rows[1:] if row[at])


def test_two_days_replace_probings_on_a_third(lab):
    answer = correction(lab, "day_1.csv", "day_2.csv")
    assert answer.returncode == 0, answer.stderr
    printed = re.search(r"z_um: (\d+) probings determined gains, (\d+) kept; left-out runs: RMS ([\d.]+) um "
                        r"\(without a record ([\d.]+) um\)", answer.stderr)
    assert printed, answer.stderr
    assert float(printed[3]) < 0.5 * float(printed[4])
    # The third day without its probings: its gain is 1.3, the model's 1.
    text = (lab / "day_3.csv").read_text().splitlines()
    (lab / "unprobed.csv").write_text(
        "\n".join([text[0]] + [line.rsplit(",", 1)[0] + "," for line in text[1:]]) + "\n")
    bare_um = last_offset(lab, "model.toml", "unprobed.csv")
    recorded_um = last_offset(lab, "recorded.toml", "unprobed.csv")
    rise_K = 8.0 * (1.0 - math.exp(-4.0))
    true_um = -(1.3 * 3.0 + 0.4) * rise_K
    assert abs(bare_um - true_um) > 5.0
    assert abs(recorded_um - true_um) < 0.25 * abs(bare_um - true_um)


def test_a_missed_probing_changes_no_gain(lab):
    clean = correction(lab, "day_1.csv", "day_2.csv").stderr
    lines = (lab / "day_1.csv").read_text().splitlines()
    for row in (60, 61, 200):
        rest, z_um = lines[row].rsplit(",", 1)
        lines[row] = f"{rest},{float(z_um) + 4300.0}"
    (lab / "missed.csv").write_text("\n".join(lines) + "\n")
    printed = correction(lab, "missed.csv", "day_2.csv").stderr
    assert "missed.csv: z_um: 3 values are left out" in printed, printed
    rms_um = [float(re.search(r"left-out runs: RMS ([\d.]+) um", each)[1]) for each in (clean, printed)]
    assert abs(rms_um[1] - rms_um[0]) < 0.2, rms_um


def test_a_record_of_one_day_is_reported_as_untested_on_another(lab):
    answer = correction(lab, "day_1.csv")
    assert answer.returncode == 0, answer.stderr
    assert "not tested on another" in answer.stderr


@pytest.mark.parametrize("change, printed", [
    (('form = "recursive"', 'form = "off"'), 'form is "off"; choose'),
    (("spindle_degC\"]\n[[correction", "nothing_degC\"]\n[[correction"), "must be an input of the model"),
])
def test_a_configuration_without_gains_is_refused(lab, change, printed):
    config = lab / "config.toml"
    config.write_text(config.read_text().replace(*change))
    answer = correction(lab, "day_1.csv")
    assert answer.returncode == 2
    assert printed in answer.stderr
    assert not (lab / "recorded.toml").exists()


def test_records_without_measured_values_or_inputs(lab):
    (lab / "bare.csv").write_text("time_s,column_degC,spindle_degC\n0,20,20\n60,20,21\n")
    answer = correction(lab, "bare.csv")
    assert answer.returncode == 2
    assert "none of them determines a gain" in answer.stderr
    (lab / "other.csv").write_text("time_s,column_degC,z_um\n0,20,0\n60,20,1\n")
    answer = correction(lab, "other.csv")
    assert answer.returncode == 2
    assert "spindle_degC" in answer.stderr


def test_a_course_of_other_groups_is_refused_by_check(lab):
    assert correction(lab, "day_1.csv").returncode == 0
    config = lab / "config.toml"
    text = config.read_text().replace('"model.toml"', '"recorded.toml"')
    config.write_text(text.replace('inputs = ["spindle_degC"]', 'inputs = ["s"]')
                      .replace('inputs = ["column_degC"]', 'inputs = ["spindle_degC"]')
                      .replace('inputs = ["s"]', 'inputs = ["column_degC"]'))
    answer = run("check", config)
    assert answer.returncode == 2
    assert "must be the groups of the model's [course]" in answer.stderr + answer.stdout
