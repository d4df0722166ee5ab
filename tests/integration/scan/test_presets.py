"""Every preset with its simulated device over real bytes: the right temperature, and each code of
the device as the right fault and never as a temperature.

The registers are defined independently of the presets, from the manuals: function, address and
words of a channel at 25.0 degC, and of each code.
"""

import json
import struct
import tomllib

import pytest
from conftest import PLANT, ROOM_DEGC, SOURCE, bus, configuration, scan, table, thermocomp

INPUT, HOLDING, DISCRETE = 4, 3, 2
FUNCTION = {"input": INPUT, "holding": HOLDING, "discrete_input": DISCRETE}


def float_words(value):
    return list(struct.unpack(">HH", struct.pack(">f", value)))


TENTHS = [250]
OPEN, SHORT, RANGE, ERROR = "open_circuit", "short_circuit", "out_of_range", "device_error"
# name: (second channel's number, function, address, words at 25 degC, required keys,
#        [(event, fault, kind of place, function and address of the code, word)])
KL331X_STATUS = (INPUT, 2)
DEVICES = {
    "wago_750_469": (2, INPUT, 1, TENTHS, {}, [("open_circuit", OPEN, (INPUT, 1), 0x7FFF)]),
    "wago_750_458": (2, INPUT, 1, TENTHS, {}, [
        ("open_circuit", OPEN, (INPUT, 1), 0x7FFF), ("channel_error", ERROR, (INPUT, 1), 0x8000)]),
    "wago_750_489": (2, INPUT, 1, TENTHS, {}, [
        ("over_range", RANGE, (INPUT, 1), 0x7FFF), ("under_range", RANGE, (INPUT, 1), 0x8000)]),
    "beckhoff_kl331x": (2, INPUT, 3, TENTHS, {}, [
        ("under_range", RANGE, KL331X_STATUS, 0x41), ("over_range", RANGE, KL331X_STATUS, 0x42),
        ("channel_error", ERROR, KL331X_STATUS, 0x40)]),
    "omega_dp606a": (2, HOLDING, 0x102, float_words(25.0), {}, [
        ("under_range", RANGE, (HOLDING, 0x181), 1), ("over_range", RANGE, (HOLDING, 0x181), 2),
        ("short_circuit", SHORT, (HOLDING, 0x181), 3),
        ("open_circuit", OPEN, (HOLDING, 0x181), 4)]),
    "wachendorff_urdr0001": (1, HOLDING, 1000, TENTHS, {}, [
        ("open_circuit", OPEN, (HOLDING, 1014), 8),
        ("channel_error", ERROR, (HOLDING, 1014), 1)]),
    "pixsys_atr142": (1, HOLDING, 1000, TENTHS, {}, []),
    "pixsys_atr401": (2, HOLDING, 901, TENTHS, {}, []),
    "moxa_iologik_e1262": (1, INPUT, 2050, [0, 250], {}, []),
    "icpdas_m7018": (1, INPUT, 1, TENTHS, {}, [
        ("open_circuit", OPEN, (INPUT, 1), 0x7FFF), ("under_range", RANGE, (INPUT, 1), 0x8000)]),
    "icpdas_tm_th8": (1, INPUT, 1, [2500], {}, [("over_range", RANGE, (DISCRETE, 129), 1)]),
    "isma_sfar_1m_1ti1do": (1, INPUT, 52, TENTHS, {}, [("open_circuit", OPEN, (INPUT, 50), 0)]),
    "isma_sfar_s_6ti": (2, INPUT, 53, TENTHS, {}, [("open_circuit", OPEN, (INPUT, 50), 0)]),
    "emerson_rsti_st3808": (1, INPUT, 1, TENTHS, {}, [("open_circuit", OPEN, (INPUT, 1), 0x8000)]),
    "exemys_rme1_tc": (2, HOLDING, 1, TENTHS, {}, []),
    "omega_iserver2": (2, HOLDING, 2, float_words(25.0), {}, []),
    # 0 to 65535 for 0 to 1370 degC, as a configuration must specify according to the file.
    "advantech_adam_4018p": (1, HOLDING, 1, [round(25.0 / 1370 * 65535)],
                             {"scale": 1370 / 65535}, [
        ("over_range", RANGE, (HOLDING, 1), 0xFFFF), ("under_range", RANGE, (HOLDING, 1), 0)]),
    "advantech_adam_6018": (1, HOLDING, 1, [round(125.0 / 500 * 65535)], {"thermocouple": "T"}, [
        ("over_range", RANGE, (HOLDING, 1), 0xFFFF), ("under_range", RANGE, (HOLDING, 1), 0)]),
    "beckhoff_kl320x": (2, INPUT, 3, TENTHS, {}, [
        ("under_range", RANGE, KL331X_STATUS, 0x41), ("over_range", RANGE, KL331X_STATUS, 0x42),
        ("channel_error", ERROR, KL331X_STATUS, 0x40)]),
    "wago_750_461": (2, INPUT, 1, TENTHS, {}, [
        ("over_range", RANGE, (INPUT, 1), 0x2134), ("under_range", RANGE, (INPUT, 1), 0xF830)]),
    "wago_750_464": (2, INPUT, 1, TENTHS, {}, [
        ("over_range", RANGE, (INPUT, 1), 0x2134), ("under_range", RANGE, (INPUT, 1), 0xF830)]),
    "calex_excelog_6": (2, INPUT, 0x1002, [0, 250], {}, []),
    "moxa_iologik_e1260": (1, INPUT, 1537, TENTHS, {}, []),
    "sequent_smtc": (2, INPUT, 1, [2500], {}, []),
    "sequent_rtd": (2, INPUT, 1, TENTHS, {}, []),
    "sequent_multiio": (2, INPUT, 1, TENTHS, {}, []),
    "sequent_two_channel_converter": (1, INPUT, 2, float_words(25.0), {}, []),
    "comwintop_8pt1000": (2, HOLDING, 1, TENTHS, {}, []),
    "mb8art": (1, INPUT, 1, TENTHS, {}, [
        ("open_circuit", OPEN, (INPUT, 1), 30000), ("channel_error", ERROR, (INPUT, 1), 0x8AD0)]),
    "emko_eplc9600": (2, INPUT, 1, TENTHS, {}, []),
    "eurotherm_3500": (2, HOLDING, 1313, TENTHS, {}, []),
    "eurotherm_3216": (1, HOLDING, 0x8002, float_words(25.0), {}, [
        ("open_circuit", OPEN, (HOLDING, 75), 0x20), ("over_range", RANGE, (HOLDING, 75), 0x400)]),
    "omron_e5c": (1, HOLDING, 0x2000, TENTHS, {}, []),
    "omega_cn7500": (1, HOLDING, 0x1000, TENTHS, {}, []),
    "owen_mv110_8a": (2, HOLDING, 10, float_words(25.0), {}, []),
    "wirenboard_mai6": (2, INPUT, 0x2504, TENTHS, {}, [
        ("channel_error", ERROR, (INPUT, 0x2504), 0x7FFF)]),
    "wirenboard_m1w2": (2, INPUT, 8, [400], {}, [("open_circuit", OPEN, (DISCRETE, 17), 0)]),
    "wirenboard_msw2": (1, INPUT, 0, TENTHS, {}, [
        ("channel_error", ERROR, (INPUT, 0), 0x7FFF)]),
    "xy_md02": (1, INPUT, 1, TENTHS, {}, []),
    "benshaw_rtd_module": (2, INPUT, 1, [25], {}, []),
    "maxwell_ft200": (1, HOLDING, 0, TENTHS, {}, []),
    "controlbox_tb260": (1, HOLDING, 0, float_words(25.0), {}, []),
    "controlbox_tb232": (1, HOLDING, 0, float_words(25.0), {}, []),
    "egnite_querx_th": (1, INPUT, 10, TENTHS, {}, []),
    "eletechsup_n4dsc08": (2, INPUT, 1, TENTHS, {}, [("open_circuit", OPEN, (INPUT, 1), 0x8000)]),
    "eletechsup_r4dcb08": (2, HOLDING, 1, TENTHS, {}, [
        ("open_circuit", OPEN, (HOLDING, 1), 0x8000)]),
    "eletechsup_pta8d08": (2, HOLDING, 1, TENTHS, {}, []),
    "eletechsup_pta8c04": (2, HOLDING, 1, TENTHS, {}, []),
    "eletechsup_pta8e16": (2, HOLDING, 1, TENTHS, {}, []),
    "eletechsup_ampti04": (2, INPUT, 1, [2500], {}, []),
    "eletechsup_nt18b07": (2, HOLDING, 1, TENTHS, {}, []),
    "seneca_z_4rtd2": (2, HOLDING, 3, TENTHS, {}, [("over_range", RANGE, (HOLDING, 3), 8500)]),
    "andivi_andrtf3": (1, INPUT, 50, TENTHS, {}, []),
    "pixsys_atr141": (1, HOLDING, 1000, TENTHS, {}, [
        ("open_circuit", OPEN, (HOLDING, 1008), 8), ("channel_error", ERROR, (HOLDING, 1008), 4)]),
    "atal_awp_c": (2, HOLDING, 0x9C7A, float_words(25.0), {}, []),
    "sm100": (1, INPUT, 0x7534, TENTHS, {}, []),
}
MODBUS = sorted(DEVICES)


def all_preset_files():
    return {path.stem: tomllib.loads(path.read_text())
            for path in (SOURCE / "config" / "devices").glob("*.toml")}


def preset_files():
    return {name: preset for name, preset in all_preset_files().items()
            if preset["protocol"] == "modbus"}


def test_every_preset_is_tested_here_and_names_its_source():
    presets = preset_files()
    assert sorted(presets) == MODBUS
    for preset in all_preset_files().values():
        assert preset["document"] and preset["section"] and preset["maker"] and preset["model"]


def lists_of(preset, channel):
    """All codes of a channel: {(event, code)}, from the preset's own lists."""
    events = {"open_circuit_codes": "open_circuit", "short_circuit_codes": "short_circuit",
              "over_range_codes": "over_range", "under_range_codes": "under_range",
              "error_codes": "channel_error"}
    found = set()
    for source in (preset["device"], channel, channel.get("status", {})):
        for key, event in events.items():
            found |= {(event, code) for code in source.get(key, [])}
    return found


FAULTS = {"open_circuit": OPEN, "short_circuit": SHORT, "over_range": RANGE, "under_range": RANGE,
          "channel_error": ERROR}


def devices_of_all_codes(names):
    """A unit for each preset and code (and one without fault), with all channels of the preset.

    -> [(unit, preset, event or None, code)]
    """
    presets = preset_files()
    units = []
    for name in names:
        channel = next(c for c in presets[name]["channel"] if c["channel"] == DEVICES[name][0])
        for event, code in [(None, None), *sorted(lists_of(presets[name], channel))]:
            units.append((len(units) + 1, name, event, code))
    return units, presets


def machine(units, presets):
    text = PLANT
    for where in ("net", "line"):
        for unit, name, event, code in units:
            device = f"{where}{unit}"
            text += table("[[device]]", name=device, bus=where, unit=unit, preset=name,
                          **DEVICES[name][4])
            for channel in presets[name]["channel"]:
                number = channel["channel"]
                text += table("[[channel]]", name=f"{device}c{number}", device=device,
                              column="body_degC", channel=number)
            if event:
                text += table("[[event]]", kind=event, target=f"{device}c{DEVICES[name][0]}",
                              at_s=0.0, duration_s=1e9, code=code)
    return text


@pytest.mark.parametrize("kind", ["modbus_tcp", "modbus_rtu"])
def test_every_preset_gives_the_temperature_and_each_code_its_fault(simulate, tmp_path, kind):
    units, presets = devices_of_all_codes(MODBUS)
    simulator = simulate(machine(units, presets))
    devices = "".join(table("[[device]]", name=f"d{unit}", bus="bus", unit=unit, preset=name,
                            **DEVICES[name][4]) for unit, name, _, _ in units)
    sensors = [(f"s{unit}_{number['channel']}", {"device": f"d{unit}", "channel": number["channel"],
                                                 "screening.temp_degC_max": 2000.0})
               for unit, name, _, _ in units for number in presets[name]["channel"]]
    path = configuration(tmp_path, bus(simulator, kind, timeout_ms=10000.0), devices, sensors)
    _, channels = scan(path)
    for unit, name, event, code in units:
        for channel in presets[name]["channel"]:
            number = channel["channel"]
            seen = channels[f"s{unit}_{number}"]
            where = (kind, name, number, event, code, seen)
            if event and number == DEVICES[name][0]:
                assert seen["fault"] == FAULTS[event] and seen["temp_degC"] is None, where
            else:
                assert seen["fault"] == "none", where
                assert seen["temp_degC"] == pytest.approx(ROOM_DEGC, abs=0.03), where


@pytest.mark.parametrize("name", MODBUS)
def test_the_registers_are_where_the_manual_has_them(simulate, name):
    number, function, address, words, keys, codes = DEVICES[name]
    presets = preset_files()
    units = [(1, name, None, None)]
    units += [(i + 2, name, event, word if word < 0x8000 or "uint" in json.dumps(presets[name])
               else word - 0x10000) for i, (event, _, _, word) in enumerate(codes)]
    simulator = simulate(machine(units, presets))
    assert simulator.read(1, function, address, len(words)) == words
    for (unit, _, event, _), (_, _, (code_function, code_address), word) in zip(units[1:], codes):
        read = simulator.read(unit, code_function, code_address, 1)[0]
        if name == "isma_sfar_s_6ti":  # the bits of the other inputs stay 1
            assert read == 0x3F & ~0x02
        else:
            assert read == word, event


@pytest.mark.parametrize("name", sorted(name for name, preset in all_preset_files().items()
                                        if preset["protocol"] != "modbus"))
def test_presets_for_other_buses_load_with_all_their_channels(tmp_path, name):
    preset = all_preset_files()[name]
    needed = tomllib.loads(
        (SOURCE / "tests/example_buses" / (preset["protocol"] + ".toml")).read_text())
    if "scale" not in preset["device"]:
        needed["device"]["scale"] = 0.1
    path = configuration(
        tmp_path, table("[[bus]]", name="bus", **needed["bus"]),
        table("[[device]]", name="d", bus="bus", preset=name, **needed["device"]),
        [(f"s{c['channel']}", {"device": "d", "channel": c["channel"]})
         for c in preset["channel"]])
    done = thermocomp("check", path)
    assert done.returncode == 0, done.stderr
