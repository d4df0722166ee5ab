"""From a machine to errors in its modelled heat flow: structure --plant-parts, simulate, diagnose
--thermal, and the corrected machine file."""
import csv
import json
import math
import pathlib
import re
import tomllib

import pytest

from conftest import PROGRAM, run

pytestmark = pytest.mark.skipif(
    not (pathlib.Path(PROGRAM).parent / "thermocomp-modelling").exists(),
    reason="thermocomp-modelling is not in this build")

STRUCTURE = """
format = 1
[[material]]
name = "cast_iron"
youngs_modulus_GPa = 110.0
poisson_ratio = 0.25
expansion_um_per_m_K = 11.0
conductivity_W_per_m_K = 50.0
density_kg_per_m3 = 7200.0
heat_capacity_J_per_kg_K = 500.0
[[part]]
name = "column"
material = "cast_iron"
size_mm = [{size}, {size}, {size}]
[[part.box]]
from_mm = [0, 0, 0]
to_mm = [300, 300, 900]
[[part]]
name = "head"
material = "cast_iron"
size_mm = [{size}, {size}, {size}]
[[part.box]]
from_mm = [0, -300, 500]
to_mm = [300, 0, 800]
[[spring]]
on = {{ part = "column", z_mm = [0, 0] }}
stiffness_N_per_um = [300, 300, 600]
[[joint]]
name = "head_on_column"
from = {{ part = "head", y_mm = [0, 0] }}
to = {{ part = "column", y_mm = [0, 0] }}
conductance_W_per_m2_K = {joint}
[[block]]
name = "column_degC"
on = {{ part = "column" }}
[[block]]
name = "head_degC"
on = {{ part = "head" }}
[[output]]
name = "z_um"
direction = "z"
tool = {{ part = "head", at_mm = [150, -300, 500] }}
work = {{ part = "column", at_mm = [150, 0, 0] }}
[room]
temp_degC = 20.0
[[convection]]
on = {{ part = "column" }}
coefficient_W_per_m2_K = {column_film}
[[convection]]
on = {{ part = "head" }}
coefficient_W_per_m2_K = 10.0
[[heat]]
name = "bearing"
on = {{ part = "head", z_mm = [500, 500] }}
heat_W = 150.0
signal = "spindle_rpm"
at = 6000.0
[[sensor]]
name = "head_front"
part = "head"
at_mm = [150, -300, 650]
[[sensor]]
name = "head_rear"
part = "head"
at_mm = [150, 0, 800]
[[sensor]]
name = "column_low"
part = "column"
at_mm = [0, 150, 200]
[[sensor]]
name = "column_high"
part = "column"
at_mm = [150, 300, 700]
"""

MACHINE = """
format = 1
seed = {seed}
duration_h = {hours}
pitch_s = 60.0
[plant]
step_s = 60.0
{body}
[room]
mean_degC = 21.0
daily_swing_K = 1.0
wander_K = 0.2
[[signal]]
name = "spindle_rpm"
kind = "random"
values = [0, 2000, 6000]
dwell_s_min = 1200.0
dwell_s_max = 5400.0
[[output]]
name = "z_um"
"""
BODY = 'body = "body.toml"'

LUMPS = """
[[node]]
name = "head"
capacity_J_per_K = 20000
room_W_per_K = {head_film}
[[node]]
name = "column"
capacity_J_per_K = 40e3
room_W_per_K = 6.0
[[link]]
between = ["head", "column"]                 # as read from a drawing
conductance_W_per_K = {joint}
[[source]]
node = "head"
signal = "spindle_rpm"
heat_W = {heat_W}
at = 6000.0
"""


def thermocouples(names, lag_s=0.0):
    return "".join(f"""
[[thermocouple]]
name = "{name}"
node = "{name}"
noise_K = 0.02
resolution_K = 0.05
lag_s = {lag_s if name == "head" else 0.0}
""" for name in [*names, "room"])


SENSORS = thermocouples(["head_front", "head_rear", "column_low", "column_high"])


def lumped_machine(folder, head_film=8.0, joint=10.0, heat_W=200.0, lag_s=0.0):
    folder.mkdir()
    text = LUMPS.format(head_film=head_film, joint=joint, heat_W=heat_W)
    text += thermocouples(["head", "column"], lag_s)
    (folder / "machine.toml").write_text(MACHINE.format(seed=1, hours=1.0, body="") + text)
    return folder


def machine(folder, size=150, joint=300.0, column_film=8.0):
    """machine.toml and body.toml of a structure, with the element size [mm]."""
    folder.mkdir()
    text = STRUCTURE.format(size=size, joint=joint, column_film=column_film)
    (folder / "structure.toml").write_text(text)
    made = run("structure", folder / "structure.toml", "-o", folder / "model.toml", "--plant",
               folder / "body.toml", "--plant-parts")
    assert made.returncode == 0, made.stderr
    (folder / "machine.toml").write_text(MACHINE.format(seed=1, hours=1.0, body=BODY) + SENSORS)
    return folder


def measured(folder):
    text = (folder / "machine.toml").read_text()
    files = []
    for seed, hours in ((11, 14.0), (12, 8.0)):
        longer = text.replace("seed = 1\nduration_h = 1.0", f"seed = {seed}\nduration_h = {hours}")
        (folder / "machine.toml").write_text(longer)
        files.append(folder / f"run_{seed}.csv")
        made = run("simulate", folder / "machine.toml", "-o", files[-1])
        assert made.returncode == 0, made.stderr
    return files


def diagnosis(model, runs, *more):
    answer = run("diagnose", "--thermal", model / "machine.toml", "--train", runs[0], "--test",
                 runs[1], "--json", "-", *more)
    assert answer.returncode == 0, answer.stderr
    return json.loads(answer.stdout)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return machine(tmp_path_factory.mktemp("body") / "model")


def test_a_body_names_its_films_joints_and_parts(model):
    parts = tomllib.loads((model / "body.toml").read_text())["part"]
    assert {(part["kind"], part["name"]) for part in parts} == {
        ("capacity", "column"), ("capacity", "head"), ("joint", "head_on_column"),
        ("room_film", "part column|room"), ("room_film", "part head|room")}


def test_a_body_that_is_right_is_left_alone(model, tmp_path):
    answer = diagnosis(model, measured(machine(tmp_path / "truth", size=100)))
    assert answer["verdict"] == "none" and answer["findings"] == []


@pytest.mark.parametrize("cause, subject, changed, factor", [
    ("wrong_conductance", "head_on_column", {"joint": 90.0}, 0.3),
    ("wrong_film_coefficient", "part column|room", {"column_film": 20.0}, 2.5)])
def test_problems_of_a_body_are_named(model, tmp_path, cause, subject, changed, factor):
    """The machine has finer elements than the model given to the diagnosis."""
    answer = diagnosis(model, measured(machine(tmp_path / "truth", size=100, **changed)))
    finding = answer["findings"][0]
    assert (finding["cause"], finding["subject"]) == (cause, subject), answer
    assert finding["parameters"]["factor"] == pytest.approx(factor, rel=0.25)
    most = max(finding["test_rms_K"].values(), key=lambda test: test["before"])
    assert most["after"] < 0.5 * most["before"]


@pytest.mark.parametrize("changed, key", [
    ({"head_film": 16.0}, "room_W_per_K"), ({"joint": 4.0}, "conductance_W_per_K"),
    ({"heat_W": 320.0}, "heat_W"), ({"lag_s": 900.0}, "lag_s")])
def test_the_corrected_machine_file_gives_what_was_measured(tmp_path, changed, key):
    model, truth = lumped_machine(tmp_path / "model"), lumped_machine(tmp_path / "truth", **changed)
    runs, out = measured(truth), tmp_path / "out"
    before = diagnosis(model, runs, "--out", out)
    assert len(before["findings"]) == 1, before
    wanted = [line for line in (truth / "machine.toml").read_text().splitlines()
              if line.startswith(key)]
    found = tomllib.loads((out / "machine.toml").read_text())
    values = {**found["node"][0], **found["link"][0], **found["source"][0],
              **found["thermocouple"][0]}
    assert values[key] == pytest.approx(float(wanted[0].split("=")[1]), rel=0.1)
    after = diagnosis(out, runs)
    assert after["verdict"] == "none"
    for sensor, output in before["extended"].items():
        assert after["baseline"][sensor]["test_rms_K"] == pytest.approx(output["test_rms_K"], rel=1e-6)
    worst = max(before["baseline"], key=lambda name: before["baseline"][name]["test_rms_K"])
    assert after["baseline"][worst]["test_rms_K"] < 0.3 * before["baseline"][worst]["test_rms_K"]


def rises_at(page, at_mm):
    """Rises on a body's page at the node nearest to a place: {group: {time_s: rise_K}}."""
    body = json.loads(re.search(r'<script id="body" type="application/json">(.*?)</script>',
                                page.read_text(), re.DOTALL)[1])
    node = min(range(len(body["nodes_mm"]) // 3),
               key=lambda i: math.dist(body["nodes_mm"][3 * i:3 * i + 3], at_mm))
    groups = {}
    for state in body["states"]:
        name = state["group"].split(", ")[1]
        groups.setdefault(name, {})[state["time_s"]] = state["rise_K"][node]
    return groups


@pytest.mark.skipif(not pathlib.Path("/usr/share/javascript/three").exists(),
                    reason="libjs-three is not installed")
def test_the_body_is_as_warm_as_its_sensors_once_the_cause_is_found(model, tmp_path):
    runs = measured(machine(tmp_path / "truth", size=100, column_film=20.0))
    diagnosis(model, runs, "--structure", model / "structure.toml", "--out", tmp_path)
    rise_K = rises_at(tmp_path / "body.html", [0, 150, 200])
    assert list(rise_K) == ["as in the file", "as found", "what the findings change"]
    with open(runs[1]) as file:
        rows = list(csv.DictReader(line for line in file if line[0] != "#"))
    read_K = {float(row["time_s"]): float(row["column_low_degC"]) - float(rows[0]["column_low_degC"])
              for row in rows}
    left_K = {name: math.sqrt(sum((of[at] - read_K[at]) ** 2 for at in of) / len(of))
              for name, of in rise_K.items()}
    assert len(rise_K["as found"]) == 25
    assert left_K["as found"] < 0.6 * left_K["as in the file"], left_K
    assert left_K["as found"] < 0.06, left_K


def test_a_structure_that_is_not_the_body_s_is_refused(model, tmp_path):
    runs = measured(machine(tmp_path / "other", size=100))
    answer = run("diagnose", "--thermal", model / "machine.toml", "--structure",
                 tmp_path / "other" / "structure.toml", "--train", runs[0], "--test", runs[1],
                 "--out", tmp_path / "out")
    assert answer.returncode == 2
    assert "machine.toml: body" in answer.stderr and "--structure given" in answer.stderr
    assert not (tmp_path / "out").exists()


def test_a_machine_file_is_not_written_over(tmp_path):
    model = lumped_machine(tmp_path / "model")
    text = (model / "machine.toml").read_text()
    runs = measured(lumped_machine(tmp_path / "truth"))
    answer = run("diagnose", "--thermal", model / "machine.toml", "--train", runs[1], "--test",
                 runs[0], "--out", model)
    assert answer.returncode == 2 and "would write over" in answer.stderr
    assert (model / "machine.toml").read_text() == text
