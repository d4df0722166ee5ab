"""Files, answers and exit statuses of series, fit --prior and inspect --series."""
import json
import pathlib
import random
import tomllib

import pytest

from conftest import PROGRAM, run

pytestmark = pytest.mark.skipif(
    not (pathlib.Path(PROGRAM).parent / "thermocomp-modelling").exists(),
    reason="thermocomp-modelling is not in this build")


def write_run(path, seed, gain, hours=10, swap=False):
    """A heated place and one that follows; z = gain * first - 2 * second."""
    chance = random.Random(seed)
    quick = slow = heat = 0.0
    lines = ["time_s,head_degC,column_degC,z_um"]
    for minute in range(hours * 60):
        if minute % 60 == 10:
            heat = chance.uniform(0, 15)
        quick += (heat - quick) / 15
        slow += (quick - slow) / 90
        z = gain * quick - 2 * slow + chance.gauss(0, 0.2)
        first, second = (slow, quick) if swap else (quick, slow)
        lines.append(f"{60 * minute},{20 + first:.4f},{20 + second:.4f},{z:.4f}")
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def series(tmp_path):
    """Five machines: two folders of two runs, two runs, one file of statistics."""
    files = []
    for machine, gain in enumerate((4.8, 5.3)):
        for day in range(2):
            write_run(tmp_path / f"m{machine}" / f"day_{day}.csv", 10 * machine + day, gain)
        files.append(tmp_path / f"m{machine}")
    files += [write_run(tmp_path / f"m{i}.csv", 50 + i, gain) for i, gain in ((2, 5.1), (3, 4.5))]
    last = write_run(tmp_path / "m4.csv", 60, 5.6)
    done = run("series", "--machine", "the fifth", last, "-o", tmp_path / "m4.toml")
    assert done.returncode == 0, done.stderr
    files.append(tmp_path / "m4.toml")
    result = tmp_path / "series.toml"
    done = run("series", *files, "-o", result)
    assert done.returncode == 0, done.stderr
    assert "5 machines, 70" in done.stdout
    return result


def left_um(model, test, folder):
    done = run("predict", "--model", model, test, "-o", folder / "predicted.csv")
    assert done.returncode == 0, done.stderr
    return float(done.stderr.split("z_um ")[1].split()[0])


def test_a_new_machine_with_one_hour_is_better_with_its_sisters(series, tmp_path):
    train = write_run(tmp_path / "new.csv", 90, 5.8)
    test = write_run(tmp_path / "test.csv", 91, 5.8)
    model, own = tmp_path / "model.toml", tmp_path / "own.toml"
    done = run("fit", f"{train}@:3600", "--outputs", "z_um", "--prior", series, "-o", model,
               "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["machines"] == 5 and 0 < answer["outputs"]["z_um"]["settled"] < 1
    assert run("fit", f"{train}@:3600", "--outputs", "z_um", "-o", own).returncode == 0
    left = left_um(model, test, tmp_path)
    assert left < 0.8 * left_um(own, test, tmp_path)
    stated = tomllib.loads(model.read_text())["made_from"]["output"]["z_um"]["left_out_rms_um"]
    assert 0.4 < stated / left < 4
    again = run("fit", test, "--outputs", "z_um", "--prior", model, "--drift-percent", 10,
                "--years", 1, "-o", tmp_path / "next.toml")
    assert again.returncode == 0, again.stderr


def test_a_prior_that_leaves_no_less_than_no_model_is_not_used(series, tmp_path):
    last_year, model = tmp_path / "last_year.toml", tmp_path / "model.toml"
    healthy = write_run(tmp_path / "healthy.csv", 93, 5.0)
    done = run("fit", healthy, "--outputs", "z_um", "--prior", series, "-o", last_year)
    assert done.returncode == 0 and "is not used" not in done.stderr, done.stderr
    assert "z_um: RMS of left-out data: with the prior" in done.stdout, done.stdout
    other = write_run(tmp_path / "other.csv", 94, -5.0)
    done = run("fit", f"{other}@:3600", "--outputs", "z_um", "--prior", last_year, "-o", model,
               "--drift-percent", 0)
    assert done.returncode == 0 and f"{last_year} is not used" in done.stderr, done.stderr
    test = write_run(tmp_path / "test.csv", 95, -5.0)
    assert left_um(model, test, tmp_path) < 0.5 * left_um(last_year, test, tmp_path)


def test_a_prior_of_one_machine_is_not_evidence_of_the_scatter(series, tmp_path):
    one, new = tmp_path / "one.toml", write_run(tmp_path / "new.csv", 96, 5.0)
    done = run("series", tmp_path / "m0", "--scatter", 0.15, "-o", one)
    assert done.returncode == 0, done.stderr
    for prior, warned in ((one, True), (series, False)):
        done = run("fit", f"{new}@:7200", "--outputs", "z_um", "--prior", prior, "-o",
                   tmp_path / "model.toml")
        assert done.returncode == 0 and "is not used" not in done.stderr, done.stderr
        assert (f"{prior} is of one machine" in done.stderr) is warned, done.stderr


def test_a_machine_whose_sensors_are_exchanged_departs_from_its_sisters(series, tmp_path):
    healthy = write_run(tmp_path / "healthy.csv", 92, 5.0)
    printed = run("inspect", healthy, "--series", series, "--json", "-")
    assert json.loads(printed.stdout)["departure"]["z_um"]["departs"] is False, printed.stdout
    other = write_run(tmp_path / "other.csv", 92, 5.0, swap=True)
    printed = run("inspect", other, "--series", series)
    assert printed.returncode == 1 and "it departs" in printed.stdout, printed.stdout


def departs(run_file, prior):
    printed = run("inspect", run_file, "--series", prior, "--json", "-")
    return json.loads(printed.stdout)["departure"]["z_um"]["departs"]


def test_a_machine_departs_from_its_own_past_before_its_sisters_show_it(series, tmp_path):
    past = [write_run(tmp_path / f"past_{i}.csv", 100 + i, 5.0) for i in range(2)]
    own = tmp_path / "own.toml"
    done = run("series", *past, "--machine", "mine", "--prior", series, "-o", own)
    assert done.returncode == 0, done.stderr
    assert tomllib.loads(own.read_text())["machines"][-1] == "mine"
    assert not departs(write_run(tmp_path / "same.csv", 103, 5.0), own)
    changed = write_run(tmp_path / "changed.csv", 103, 5.6)
    assert departs(changed, own) and not departs(changed, series)
    alone = run("series", *past, "--prior", series, "-o", own)
    assert alone.returncode == 2 and "--machine" in alone.stderr, alone.stderr


def test_unusable_input_is_refused_with_file_and_rule(series, tmp_path):
    one = write_run(tmp_path / "one.csv", 1, 5.0)
    lone = run("series", one, "-o", tmp_path / "s.toml")
    assert lone.returncode == 2 and "one machine does not show" in lone.stderr
    assert not (tmp_path / "s.toml").exists()
    fit = ("fit", one, "--prior", series, "-o", tmp_path / "m.toml", "--outputs")
    one.write_text(one.read_text().replace("z_um", "y_um"))
    other = run(*fit, "y_um")
    assert other.returncode == 2 and "has no output y_um" in other.stderr
    one.write_text(one.read_text().replace("y_um", "z_um").replace("head_degC", "head_K"))
    unit = run(*fit, "z_um")
    assert unit.returncode == 2 and "the series has head_degC, in another unit" in unit.stderr
    series.write_text(series.read_text().replace('"series"', '"statistics"', 1))
    kind = run(*fit, "z_um")
    assert kind.returncode == 2
    assert f"{series}:" in kind.stderr and 'must be "series"' in kind.stderr, kind.stderr
