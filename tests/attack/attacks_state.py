"""The state file: impossible references, and a file that cannot be read."""

import json
import time

from attacks_files import goes_on, reload_refused
from registry import attack

BEFORE_UM = -3.0


def state_with(rig, change):
    """The state file as the daemon left it, changed."""
    state = json.loads(rig.daemon.state.read_text())
    change(state)
    rig.daemon.state.write_text(json.dumps(state))


@attack(links=("tcp", "bridge"), limit_s=60.0)
def impossible_reference_in_the_state(rig):
    """1e300, -300 and 200 degC: refused, or held with a reason; never driven to the bound."""
    if not rig.start():
        return
    for reference in rig.random.sample((1e300, -1e300, -300.0, 200.0, 1e39), 3):
        rig.tries += 1
        rig.daemon.operate("reference")
        rig.daemon.end()

        def change(state, reference=reference):
            state["reference_degC"]["column_degC"] = reference
        state_with(rig, change)
        stood_um = rig.axis.position_um
        if not rig.daemon.start(may_refuse=True):
            rig.daemon.state.unlink()
            rig.daemon.start()
            continue
        time.sleep(1.5)
        moved_um = abs(rig.axis.position_um - stood_um)
        rig.must(moved_um < 0.5, f"a reference of {reference:g} degC drives the axis")
        status = rig.daemon.status()
        if status["mode"] == "compensating":
            rig.must(status["axes"][0]["target"] is not None,
                     f"compensating without a target ({reference:g} degC)")
            rig.must(status["inputs"][0]["reference_degC"] != reference,
                     f"compensating from a reference of {reference:g} degC")
        rig.told_reference = None
        rig.daemon.operate("reference")
    rig.daemon.operate("enable")
    rig.must(rig.daemon.wait_for("compensating"), "does not compensate with a new reference")


@attack(links=("tcp",))
def impossible_reference_in_the_model(rig):
    """The same by a reload: refused, with the key."""
    if not rig.start(BEFORE_UM):
        return
    model = rig.daemon.folder / "model.toml"
    for reference in ("1e300", "-300.0", "200.0", "nan", "-inf"):
        rig.tries += 1
        text = model.read_text().replace('"first_sample"', f"[{reference}, 20.0]")
        if not reload_refused(rig, model, text):
            return
    goes_on(rig)


@attack(links=("tcp",), limit_s=90.0)
def damaged_state_after_disable(rig):
    """Neither the switch nor the reference may come back by a state file that cannot be read."""
    if not rig.start():
        return
    damages = ("cut", "empty", "bits", "zeros", "text", "folder", "types")
    for damage in rig.random.sample(damages, 4):
        rig.tries += 1
        if not rig.daemon.operate("disable"):
            rig.broke("disable is refused")
        rig.told_reference = None
        cold = rig.daemon.references()
        rig.wait_for_rows(1)
        rig.daemon.end()
        damage_state(rig, damage)
        rig.machine.thermocouples.show(33.0)  # the machine is warm now
        if not rig.restart():
            return
        time.sleep(0.7)
        status = rig.daemon.status()
        rig.must(status["enabled"] is False and status["mode"] != "compensating",
                 f"{damage}: enabled again")
        taken = [warm for warm, was in zip(rig.daemon.references(), cold)
                 if warm is not None and abs(warm - was) > 0.01]
        rig.must(not taken, f"{damage}: a new reference is taken from the warm machine")
        rig.machine.thermocouples.show(20.0)
        time.sleep(0.3)
        rig.daemon.operate("reference")
    rig.daemon.operate("enable")
    rig.must(rig.daemon.wait_for("compensating"), "cannot be enabled again")
    rig.note_rows()


def damage_state(rig, damage):
    state = rig.daemon.state
    good = state.read_bytes()
    bad = bytearray(good)
    if damage == "cut":
        bad = bad[:rig.random.randrange(1, len(bad) - 3)]
    elif damage == "empty":
        bad = b""
    elif damage == "bits":
        # The word that says whose file it is; a flipped digit could not be told by anybody.
        bad = good.replace(b"thermocomp", b"thermoc\xefmp")
    elif damage == "zeros":
        bad = bytes(len(good))
    elif damage == "text":
        bad = b"enabled = true\n"
    elif damage == "types":
        bad = good.replace(b'"enabled": false', b'"enabled": "no"')
    if damage == "folder":
        state.unlink()
        state.mkdir()
    else:
        state.write_bytes(bad)
