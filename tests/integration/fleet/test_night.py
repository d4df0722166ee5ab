"""Results of a night: a machine departs from its series, another's sensor ages, and failures stop nothing."""

import datetime
import random

import pytest

from fleet_lab import BIN

pytestmark = pytest.mark.skipif(not (BIN / "thermocomp-modelling").exists(),
                                reason="thermocomp-modelling is not in this build")
TODAY = datetime.datetime.now(datetime.timezone.utc).date()
MODEL = """format = 1
inputs = ["head_degC", "column_degC"]
outputs = ["z_um"]
reference = "first_sample"
matrix_um_per_K = [[5.0, -2.0]]
"""


def write_day(path, seed, gain, *, scale=1.0, leaps=False):
    """A heated place and one that follows; z = gain * first - 2 * second, probed every 10 min. An
    ageing sensor shows its rise times `scale`; a loose plug leaps between probings."""
    chance = random.Random(seed)
    quick = slow = heat = 0.0
    lines = ["time_s,head_degC,column_degC,z_um"]
    for minute in range(1439):
        if minute % 60 == 10:
            heat = chance.uniform(0, 15)
        quick += (heat - quick) / 15
        slow += (quick - slow) / 90
        z = f"{gain * quick - 2 * slow + chance.gauss(0, 0.3):.3f}" if minute % 10 == 0 else ""
        leap = 0.8 if leaps and minute in (305, 615, 925) else 0.0
        lines.append(f"{60 * minute},{20 + scale * quick + leap:.4f},{20 + slow:.4f},{z}")
    # Marks the end of this day's data.
    lines.append(f"{86390},{20 + scale * quick:.4f},{20 + slow:.4f},")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def workshop(store, tmp_path):
    """Five machines, nine nights; in the last two mill_3's sensor shows half and mill_1's leaps,
    which is a recording fault and not a departure; mill_4 differed from the start."""
    (tmp_path / "model.toml").write_text(MODEL)
    for number, gain in enumerate((4.8, 5.2, 5.1, 4.9, 12.0)):
        store.add(f"mill_{number}")
        for night in range(9):
            ageing = 0.5 if number == 3 and night >= 7 else 1.0
            run = write_day(tmp_path / "day.csv", 100 * number + night, gain, scale=ageing,
                            leaps=number == 1 and night >= 7)
            day = TODAY - datetime.timedelta(days=9 - night)
            assert "1440 rows" in store.fleet("load", f"mill_{number}", run, "--begin", f"{day}T00:00:00Z",
                                              "--model", tmp_path / "model.toml")
    return store


def test_a_night_names_who_departs_and_why(workshop):
    output = workshop.fleet("night", "-j", 2, "--nights", 20, status=1)
    rows = workshop.ask("SELECT name, night, state, coalesce(departs::text, ''), departure, diagnosis IS NOT NULL "
                        "FROM fleet.night_result JOIN fleet.machine ON id = machine ORDER BY name, night")
    assert len(rows) == 45 and {row[2] for row in rows} == {"done"}, output
    last = {row[0]: row for row in rows if row[1] == str(TODAY - datetime.timedelta(days=1))}
    departing = {name for name, row in last.items() if row[3] == "true"}
    assert departing == {"mill_3", "mill_4"}, last
    assert "head_degC" in last["mill_3"][4] and last["mill_3"][5] == "t"
    # One unusual night is not a departure; without a series there is no judgement.
    assert {row[3] for row in rows if row[1] == str(TODAY - datetime.timedelta(days=2))} == {"false"}
    assert {row[3] for row in rows if row[1] < str(TODAY - datetime.timedelta(days=2))} == {""}
    assert workshop.value("SELECT count(*) FROM fleet.minute") == str(45 * 1440)
    # Nothing is left to do.
    assert "0 machine-nights" in workshop.fleet("night", "--nights", 20)
    assert "DEPARTS" in workshop.fleet("status", status=1)


def test_a_failed_night_is_reported_and_retried_and_stops_no_other(store, tmp_path):
    for name in ("mill_0", "mill_1"):
        store.add(name)
        store.fleet("load", name, write_day(tmp_path / "day.csv", 1, 5.0), "--begin",
                    f"{TODAY - datetime.timedelta(days=2)}T00:00:00Z")
    # A machine with unusable temperatures.
    store.ask("UPDATE fleet.sample SET value = '{NULL,NULL}' WHERE machine = "
              "(SELECT id FROM fleet.machine WHERE name = 'mill_0')")
    assert "1 failed" in store.fleet("night", status=1)
    assert store.ask("SELECT name, state FROM fleet.night_result JOIN fleet.machine ON id = machine ORDER BY 1") == [
        ["mill_0", "failed"], ["mill_1", "done"]]
    assert "mill_0" in store.fleet("night", status=1)


def test_a_day_is_worked_off_once_all_of_it_has_arrived(store, tmp_path):
    store.add("mill_0")
    day = write_day(tmp_path / "day.csv", 1, 5.0)
    half = tmp_path / "half.csv"
    half.write_text("\n".join(day.read_text().splitlines()[:700]) + "\n")
    begin = ("--begin", f"{TODAY - datetime.timedelta(days=2)}T00:00:00Z")
    store.fleet("load", "mill_0", half, *begin)
    assert "0 machine-nights" in store.fleet("night")
    store.fleet("load", "mill_0", day, *begin)
    assert "1 machine-nights" in store.fleet("night")


def test_a_task_of_slurm_works_off_one_machine(store, tmp_path):
    begin = f"{TODAY - datetime.timedelta(days=2)}T00:00:00Z"
    for name in ("mill_0", "mill_1"):
        store.add(name)
        store.fleet("load", name, write_day(tmp_path / "day.csv", 1, 5.0), "--begin", begin)
    number = store.value("SELECT id FROM fleet.machine WHERE name = 'mill_1'")
    assert "mill_1" in store.fleet("night", "--machine-number", number)
    assert store.ask("SELECT machine::text FROM fleet.night_result") == [[number]]
    assert "0 machine-nights" in store.fleet("night", "--machine-number", number)
    assert "1 machine-nights" in store.fleet("night")
