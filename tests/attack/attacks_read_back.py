"""False read-backs: wrong scales and signs, second writers, re-homing."""

import functools
import math
import threading
import time

import axis as read_errors
from process import eventually
from registry import attack

BUSES = ("tcp", "rtu", "can", "bridge")
BEFORE_UM, WANTED_UM = -3.0, -24.0
SEEN_WITHIN_S = 6.0
LOOKED_AT_S = 3.0
EXPLAINED_UM = 1.0  # WriteGate::unexplained_um: closer offsets of other writers are not detected


def seen_within_s(rig):
    """Time limit of detection: while the offset moves, a difference within the controller's allowed
    lag looks like lag; it is detected at the latest when the offset has arrived."""
    return SEEN_WITHIN_S + abs(WANTED_UM - BEFORE_UM) / rig.axis.rate_um_per_s


def latched(daemon):
    status = daemon.status()
    return "mismatch_latched" in status["reasons"] and not status["axes"][0]["driven"] and status


def not_driven_from_now_on(rig, seconds=0.6):
    began = time.monotonic() + 0.2
    time.sleep(0.2 + seconds)
    return not rig.axis.written_since(began)


def must_latch(rig, likely):
    """Repeated unexplained read-backs must latch the axis and give a reason. `likely`: words of
    which the reason must contain one; empty: any reason."""
    status = eventually(lambda: latched(rig.daemon) or not rig.daemon.alive(), seen_within_s(rig))
    if not rig.must(status and status is not True, "a mismatch is not latched"):
        return
    rig.must(not_driven_from_now_on(rig), "driven although the mismatch is latched")
    mismatch = status["axes"][0].get("mismatch")
    likely_text = str(mismatch.get("likely", "")) if isinstance(mismatch, dict) else ""
    rig.must(likely_text and any(word in likely_text for word in likely or [likely_text]),
             f'the likely reason is "{likely_text}", with none of {", ".join(likely)} in it')
    if isinstance(mismatch, dict):
        rig.must(None not in (mismatch.get("sent_um"), mismatch.get("read_um")),
                 "sent and read values are not reported")


def must_not_drive(rig):
    """An axis found beyond its bound must never be driven."""
    time.sleep(1.0)
    status = rig.daemon.status()
    rig.must(not rig.axis.writes and not status["axes"][0]["driven"] and status["reasons"],
             "driven from beyond its bound")


def release_is_needed(rig):
    rig.axis.read_error = None
    rig.must(not_driven_from_now_on(rig), "driven again without an operator's release")


def run_wrong_read_back(rig, make, likely):
    """The read-back is false from the start, as after wrong commissioning, or from a time when the
    axis moves: then a factor cannot be distinguished from an additive error."""
    from_the_start = rig.random.random() < 0.5 and rig.machine.link != "piezo"
    if from_the_start:
        rig.axis.read_error = make(rig)
        if not rig.must(rig.daemon.start(), "the daemon does not start"):
            return
        if hasattr(rig.machine.slave, "report_to"):
            rig.machine.slave.report_to(rig.daemon.socket)
        rig.must(eventually(lambda: None not in rig.daemon.references()), "no reference is taken")
    elif not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(WANTED_UM)
    rig.axis.read_error = rig.axis.read_error or make(rig)
    began = time.monotonic()
    if from_the_start and likely and abs(rig.axis.read_error(rig.axis, began)) > rig.axis.bound_um:
        must_not_drive(rig)
        rig.axis.read_error = None
    elif likely and rig.machine.link != "piezo":
        must_latch(rig, likely if from_the_start else ())
        time.sleep(max(0.0, LOOKED_AT_S - (time.monotonic() - began)))
        release_is_needed(rig)
    else:
        time.sleep(LOOKED_AT_S)
        rig.axis.read_error = None
    rig.follows_again()


LIES = {  # name: (constructor, words of which the reason must contain one; None: not latched)
    "reads back twice what is sent": (lambda rig: read_errors.factor(2.0), ("twice", "scale")),
    "reads back half of what is sent": (lambda rig: read_errors.factor(0.5), ("half", "scale")),
    "reads back the opposite sign": (lambda rig: read_errors.factor(-1.0), ("sign",)),
    "reads back 3 um more": (lambda rig: read_errors.constant(3.0), ("constant",)),
    "reads back millimetres": (lambda rig: read_errors.factor(0.001), ("scale",)),
    "reads back a jump of 1 mm": (lambda rig: read_errors.constant(rig.random.choice((1000, -1000))),
                                  ("constant", "writer")),
    "reads back a drift": (lambda rig: read_errors.drift(rig.random.choice((3.0, -3.0, 0.5))), None),
    "reads back what it was": (lambda rig: read_errors.frozen(rig.axis.position_um), None),
    "jumps by 1 mm for a moment": (lambda rig: read_errors.jumps(1000.0, rig.random.randint(1, 6)), None),
    "jumps by 4 um every other time": (lambda rig: read_errors.jumps(4.0, 1), None),
    "reads back anything": (lambda rig: read_errors.anything(rig.random, 60.0), None),
    "reads back what was a second ago": (lambda rig: read_errors.late(1.0), None),
}
for _name, (_make, _likely) in LIES.items():
    attack(links=(*BUSES, "piezo"), name=_name)(
        functools.partial(run_wrong_read_back, make=_make, likely=_likely))


@attack(links=BUSES)
def takes_nothing(rig):
    """Every write is acknowledged, none is carried out."""
    if not rig.start(BEFORE_UM):
        return
    rig.axis.obeys = False
    rig.machine.wants_um(WANTED_UM)
    rig.must(eventually(lambda: set(rig.daemon.status()["reasons"]) &
                        {"mismatch", "mismatch_latched"}, 10.0), "no mismatch is reported")
    rig.axis.reports_position(rig.axis.position_um)
    rig.axis.obeys = True
    rig.follows_again()


@attack(links=("tcp", "rtu", "can"), shown_as="float32", shown_scale=1.0)
def reads_back_no_numbers(rig):
    """NaN, infinities and the ends of float32."""
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(WANTED_UM)
    values = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-40, 0.0)
    rig.axis.read_error = read_errors.numbers(rig.random, values[:rig.random.randint(1, len(values))])
    time.sleep(LOOKED_AT_S)
    rig.axis.read_error = None
    rig.follows_again()


@attack(links=("tcp", "rtu"))
def two_daemons_on_one_controller(rig):
    """Two correct daemons send different offsets: neither may jump; one must report it."""
    if not rig.start(BEFORE_UM):
        return
    second = rig.another_daemon("two", unit=2)
    if rig.machine.link == "rtu":
        rig.machine.slave.units[2] = rig.machine.controller.registers
    rig.machine.thermocouples.show(20.0 + rig.random.choice((4.0, -4.0)))
    second.start(may_refuse=True)
    time.sleep(0.5)
    rig.machine.wants_um(WANTED_UM)
    reported = eventually(lambda: any(
        daemon.alive() and latched(daemon) for daemon in (rig.daemon, second)) or
        not second.alive(), seen_within_s(rig))
    rig.must(reported, "neither reports another writer")
    began = time.monotonic()
    time.sleep(1.0)
    writers = {write.writer for write in rig.axis.written_since(began)}
    rig.must(len(writers) < 2, "both still drive the axis")
    if second.alive():
        rig.must(second.end(), "the second daemon does not end well")


@attack(links=("tcp", "bridge"))
def late_on_a_link_that_is_lost(rig):
    """A correct controller with readings half a second old, on a link lost while the axis moves."""
    if not rig.start(BEFORE_UM):
        return
    rig.axis.read_error = read_errors.late(0.5)
    for attempt in range(6):
        rig.tries += 1
        rig.machine.wants_um(WANTED_UM if attempt % 4 < 2 else -WANTED_UM)
        time.sleep(rig.random.uniform(0.5, 1.2))
        if rig.machine.link == "bridge":
            rig.machine.slave.session += 1
        else:
            rig.machine.slave.drop_links()
    rig.axis.read_error = None
    rig.follows_again()


@attack(links=("tcp", "rtu"))
def restarts_while_a_write_is_said_again(rig):
    """The answer to a write is lost, and the controller restarts at 0 before the retry."""
    if not rig.start(-6.0):
        return

    def lose_one(_frame_of, request, answer):
        if request[0] != 16:
            return [answer]
        rig.machine.slave.spoil = lambda _frame_of, _request, answer: [answer]
        threading.Timer(rig.random.choice((0.0, 0.05, 0.15, 0.3)),
                        rig.machine.controller.restart).start()
        return []
    for attempt in range(3):
        rig.tries += 1
        rig.machine.wants_um(WANTED_UM if attempt % 2 == 0 else -18.0)
        # An axis that moved by less than `mismatch_um` looks like the controller's lag.
        rig.must(eventually(lambda: rig.release() or abs(rig.axis.position_um) > 8.0, 15.0),
                 "the axis is not driven")
        rig.machine.slave.spoil = lose_one
        time.sleep(1.0)
    rig.follows_again()


@attack(links=BUSES)
def wrong_read_back_at_release(rig):
    """Another false read-back begins right after a latched axis is released."""
    if not rig.start(BEFORE_UM):
        return
    for _ in range(3):
        rig.tries += 1
        rig.axis.read_error = read_errors.constant(rig.random.choice((9.0, -9.0, 400.0)))
        rig.machine.wants_um(rig.random.uniform(WANTED_UM, -WANTED_UM))
        rig.must(eventually(lambda: latched(rig.daemon), 8.0), "a mismatch is not latched")
        rig.axis.read_error = None
        time.sleep(rig.random.uniform(0.0, 0.6))
        rig.release()
        time.sleep(rig.random.uniform(0.0, 0.06))
        rig.axis.read_error = rig.random.choice((read_errors.constant(rig.random.uniform(-12.0, 12.0)),
                                                 read_errors.factor(0.5), read_errors.factor(-1.0)))
        for _ in range(rig.random.randint(0, 4)):
            time.sleep(rig.random.uniform(0.0, 0.1))
            rig.release()
        time.sleep(rig.random.choice((0.02, 0.2, 1.0)))
    rig.axis.read_error = None
    rig.follows_again()


@attack(links=BUSES)
def adds_from_now_on_and_is_released(rig):
    """A constant error begins, and the axis is released without correcting it. The shifted position
    may be accepted once, as after another writer, but the axis must not walk away."""
    if not rig.start(BEFORE_UM):
        return
    stood_um, added_um = rig.axis.position_um, rig.random.choice((6.0, -6.0))
    rig.axis.read_error = read_errors.constant(added_um)
    rig.must(eventually(lambda: latched(rig.daemon), 8.0), "a mismatch is not latched")
    for _ in range(5):
        rig.tries += 1
        time.sleep(1.2 * abs(added_um) / rig.axis.rate_um_per_s)  # time to move by the error
        rig.release()
        time.sleep(0.5)
    # The axis also moves towards its target until it is latched again.
    rig.must(abs(rig.axis.position_um - stood_um) < 1.5 * abs(added_um),
             f"walks from {stood_um:.1f} to {rig.axis.position_um:.1f} um, release by release")
    rig.axis.read_error = None
    rig.follows_again()


@attack(links=("tcp", "rtu", "can"))
def another_writer_now_and_then(rig):
    """Another program of the controller changes the offset at times."""
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(WANTED_UM)
    end = time.monotonic() + LOOKED_AT_S
    while time.monotonic() < end:
        time.sleep(rig.random.uniform(0.05, 0.6))
        with rig.axis.lock:
            other = rig.axis.position_um
            rig.axis.position_um = rig.random.uniform(-15.0, 15.0)
        time.sleep(0.05)
        with rig.axis.lock:
            if rig.random.random() < 0.5:
                rig.axis.position_um = other
    with rig.axis.lock:
        # Put back near a recently sent offset, the axis may count as obedient: the daemon continues
        # from its last sent offset. From any other position it must restart there.
        if abs(rig.axis.position_um - rig.axis.writes[-1].value_um) > EXPLAINED_UM:
            rig.axis.reports_position(rig.axis.position_um)
    rig.follows_again()


@attack(links=("tcp", "rtu", "can", "can_travel"))
def re_homes(rig):
    """The controller loses the offset between two reads; link and registers stay alive."""
    if not rig.start(-6.0):
        return
    rig.machine.wants_um(WANTED_UM)
    for _ in range(2):
        time.sleep(rig.random.uniform(0.1, 0.5))
        home_when_read(rig.axis)
        time.sleep(1.0)
        rig.release()
    rig.follows_again()


def home_when_read(axis):
    """Homes at the time of a read, so that no write in transit is judged."""
    def home():
        axis.before_shown = lambda: None
        axis.reports_position(0.0)
    axis.before_shown = home
    eventually(lambda: axis.first_reads, 5.0)


@attack(links=("tcp", "rtu", "can", "can_travel"))
def controller_restarts(rig):
    """Power cycle: registers 0, a new link."""
    if not rig.start(-6.0):
        return
    rig.machine.wants_um(WANTED_UM)
    for _ in range(2):
        rig.machine.slave.stop()
        time.sleep(rig.random.uniform(0.7, 1.2))
        rig.machine.controller.restart()
        rig.machine.slave.start()
        time.sleep(1.0)
    rig.follows_again()


@attack(links=("tcp", "rtu"))
def applied_cannot_be_read(rig):
    """Without a read-back nothing may be sent."""
    registers = rig.machine.controller.registers
    registers.refusal = lambda function, *_: 2 if function == 4 else 0
    if not rig.must(rig.daemon.start(), "the daemon does not start"):
        return
    rig.must(eventually(lambda: None not in rig.daemon.references()), "no reference is taken")
    rig.machine.wants_um(WANTED_UM)
    time.sleep(2.0)
    rig.must(not rig.axis.writes, "driven without ever having been read")
    rig.must(rig.daemon.status()["mode"] != "compensating" or not rig.daemon.axis()["driven"],
             "reports that it compensates")
    registers.refusal = lambda function, *_: 0
    rig.daemon.wait_for("compensating")
    rig.follows_again()
