"""Links with wrong, late, partial or unsolicited answers."""

import functools
import struct
import time

from modbus_server import Hold, as_it_is
from process import eventually
from registry import attack

BEFORE_UM, WANTED_UM = -3.0, -24.0
LOOKED_AT_S = 3.0


def spoiled(rig, spoil, slave=None, follows=True):
    """The link is faulty while the axis moves, then good again."""
    if not rig.start(BEFORE_UM):
        return
    slave = slave or rig.machine.slave
    rig.machine.wants_um(WANTED_UM)
    slave.spoil = spoil
    time.sleep(LOOKED_AT_S)
    slave.spoil = as_it_is
    slave.drop_links()
    if follows:
        rig.follows_again()


def sometimes(rig, share, other):
    def spoil(frame_of, request, answer):
        return other(frame_of, request, answer) if rig.random.random() < share else [answer]
    return spoil


def exceptions(rig):
    codes = (1, 2, 3, 4, 5, 6, 8, 10, 11, 0, 255)
    return sometimes(rig, rig.random.choice((0.1, 0.5, 1.0)), lambda frame_of, request, _: [
        frame_of(bytes([request[0] | 0x80, rig.random.choice(codes)]))])


def half_answers(rig):
    def half(_frame_of, _request, answer):
        cut = answer[:rig.random.randrange(len(answer))]
        return [cut, Hold(0.3, close=rig.random.random() < 0.5)]
    return sometimes(rig, 0.1, half)


def late_answers(rig):
    return sometimes(rig, 0.15, lambda _f, _r, answer: [
        Hold(rig.random.choice((0.19, 0.21, 0.25, 0.45, 1.1))), answer])


def answers_before_the_question(rig):
    """An unsolicited answer with another position is in the buffer when the request is sent."""
    def spoil(frame_of, request, answer):
        false_answer = struct.pack(">BB2H", 4, 4, *struct.unpack(">2H", struct.pack(
            ">i", rig.random.choice((-40000, 30000, 0)))))
        if rig.random.random() > 0.2:
            return [answer]
        return [answer, Hold(0.004), frame_of(false_answer, frame_of.transaction + 1)]
    return spoil


def answers_twice(rig):
    return sometimes(rig, 0.3, lambda _f, _r, answer: [answer, Hold(0.002), answer])


def answers_of_another_question(rig):
    rig.axis.had_read_error = True  # some contain another position

    def other(frame_of, request, _answer):
        pdu = rig.random.choice((struct.pack(">BB2H", 4, 4, 0, 7000), bytes([4, 200]) + bytes(200),
                                 struct.pack(">BHH", 16, 0, 4), bytes([request[0]]),
                                 struct.pack(">BB1H", 4, 2, 1000),
                                 struct.pack(">BB4H", 4, 8, 1, 2, 3, 4)))
        return [frame_of(pdu, frame_of.transaction + rig.random.choice((0, 0, 1, -1, 4711)))]
    return sometimes(rig, 0.3, other)


def garbage(rig):
    def noise(_frame_of, _request, answer):
        spoilt = bytearray(answer)
        for _ in range(rig.random.randint(1, 3)):
            spoilt[rig.random.randrange(len(spoilt))] ^= 1 << rig.random.randrange(8)
        return [rig.random.randbytes(rig.random.randint(0, 400)) if rig.random.random() < 0.5
                else bytes(spoilt)]
    return noise


def byte_by_byte(rig):
    def slowly(_frame_of, _request, answer):
        parts = []
        for byte in answer:
            parts += [bytes([byte]), Hold(0.002)]
        return parts
    return sometimes(rig, 0.5, slowly)


def hangs_up_at_any_byte(rig):
    return sometimes(rig, 0.2, lambda _f, _r, answer: [
        answer[:rig.random.randrange(len(answer) + 1)], Hold(0.0, close=True)])


def floods(rig):
    return sometimes(rig, 0.2, lambda _f, _r, answer: [answer * 500])


for _name, _links, _spoil in (
        ("exceptions", ("tcp", "rtu", "piezo"), exceptions),
        ("half answers", ("tcp", "rtu", "piezo"), half_answers),
        ("late answers", ("tcp", "rtu", "piezo"), late_answers),
        ("answers before the question", ("tcp", "rtu"), answers_before_the_question),
        ("answers twice", ("tcp", "rtu"), answers_twice),
        ("answers of another question", ("tcp", "rtu", "piezo"), answers_of_another_question),
        ("garbage", ("tcp",), garbage),
        ("byte by byte", ("tcp", "rtu"), byte_by_byte),
        ("hangs up at any byte", ("tcp", "piezo"), hangs_up_at_any_byte),
        ("floods", ("tcp", "rtu"), floods)):
    attack(links=_links, name=_name)(
        functools.partial(lambda rig, make: spoiled(rig, make(rig)), make=_spoil))


@attack(links=("tcp", "rtu"))
def noise_on_the_thermocouples(rig):
    """Late, doubled, corrupted and refused answers of the sensor module."""
    makers = (exceptions, half_answers, late_answers, answers_twice, answers_of_another_question)
    spoilers = [make(rig) for make in makers]
    spoiled(rig, lambda *args: rig.random.choice(spoilers)(*args),
            slave=rig.machine.sensor_slave)


@attack(links=("tcp",))
def greets_before_it_is_asked(rig):
    """Every new connection begins with an unsolicited answer."""
    false_answer = struct.pack(">BB2H", 4, 4, 0xFFFF, 0x63C0)  # -40 um

    def greet(link):
        for transaction in range(4):
            link.sendall(struct.pack(">HHHB", transaction, 0, len(false_answer) + 1, 1) + false_answer)
    if not rig.start(BEFORE_UM):
        return
    rig.machine.slave.greet = greet
    rig.machine.wants_um(WANTED_UM)
    for _ in range(6):
        rig.machine.slave.drop_links()
        time.sleep(0.4)
    rig.machine.slave.greet = lambda link: None
    rig.machine.slave.drop_links()
    rig.follows_again()


@attack(links=("tcp",))
def connection_is_lost_again_and_again(rig):
    """Reset 20 times a second, accepted and closed at once, refused."""
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(WANTED_UM)
    end = time.monotonic() + LOOKED_AT_S
    while time.monotonic() < end:
        rig.machine.slave.drop_links()
        time.sleep(rig.random.choice((0.01, 0.05, 0.3)))
        if rig.random.random() < 0.1:
            rig.machine.slave.stop()
            time.sleep(0.1)
            rig.machine.slave.start()
    rig.follows_again()


@attack(links=("tcp", "rtu", "can", "can_travel", "bridge"))
def goes_silent_and_comes_back(rig):
    """The cable is disconnected for moments and for longer than any timeout."""
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(WANTED_UM)
    for _ in range(4):
        rig.machine.slave.stop()
        time.sleep(rig.random.choice((0.1, 0.3, 1.3)))
        rig.machine.slave.start()
        time.sleep(rig.random.choice((0.05, 0.5)))
    rig.follows_again()


@attack(links=("can",))
def strange_frames(rig):
    """Frames of all identifiers, lengths and kinds, error frames, offsets of another sender."""
    import can_nodes
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(WANTED_UM)
    buses = [can_nodes.open_bus("vcan0"), can_nodes.open_bus("vcan1")]
    end = time.monotonic() + LOOKED_AT_S
    while time.monotonic() < end:
        for bus in buses:
            identifier = rig.random.choice((0x181, 0x300, 0x281, rig.random.randrange(0x800),
                                            0x20000000 | rig.random.randrange(0x200),
                                            0x80000000 | rig.random.randrange(1 << 29)))
            length = 8 if identifier & 0x20000000 else rig.random.randint(0, 8)
            try:
                bus.send(can_nodes.frame(identifier, rig.random.randbytes(length)))
            except OSError:
                time.sleep(0.001)
        time.sleep(0.001)
    for bus in buses:
        bus.close()
    time.sleep(1.2)
    rig.follows_again()


def losses(rig):
    """Randomly loses, repeats and delays frames."""
    held_back = []

    def spoil(frames):
        come, chosen = held_back + frames, rig.random.random()
        held_back.clear()
        if chosen < 0.3:
            return []
        if chosen < 0.4:
            return come * 2
        if chosen < 0.5:
            held_back.extend(frames)
            return come[:-len(frames)]
        return come
    return spoil


def loses_frames_of_sets(rig, controller):
    controller.spoil, controller.spoil_shown = losses(rig), losses(rig)


def without(identifier):
    return lambda frames: [each for each in frames if each[0] != identifier]


def loses_nothing(controller):
    controller.spoil = controller.spoil_shown = lambda frames: frames


@attack(links=("can_travel",), limit_s=90.0)
def frames_of_sets_are_lost(rig):
    """An interpolating controller loses frames in both directions, then those of one node for
    longer than the set numbers take to repeat."""
    if not rig.start(BEFORE_UM):
        return
    controller = rig.machine.controller
    rig.machine.wants_um(WANTED_UM)
    loses_frames_of_sets(rig, controller)
    time.sleep(LOOKED_AT_S)
    loses_nothing(controller)
    rig.follows_again()
    time.sleep(1.0)
    controller.spoil = without(0x201)
    rig.machine.wants_um(rig.axis.position_um - 1.0)  # less than would be a mismatch
    time.sleep(256 * 0.02 + 0.5)
    loses_nothing(controller)
    rig.follows_again()
    rig.must(controller.mixtures == 0, "values of two sets were taken over")


@attack(links=("can_travel",), limit_s=150.0)
def killed_between_frames_of_a_set(rig):
    """kill -9 while one node's frames are lost, with a controller that keeps all frames; the next
    daemon at first loses the other node's. Its frames must not complete the interrupted set."""
    if not rig.start(BEFORE_UM):
        return
    controller = rig.machine.controller
    controller.forgets = False
    for way in (1, -1, 1, -1, 1, -1):
        rig.tries += 1
        near, far = rig.random.sample((0x201, 0x202), 2)
        rig.machine.wants_um(way * WANTED_UM)
        time.sleep(rig.random.uniform(0.3, 0.6))
        controller.spoil = without(near)
        time.sleep(rig.random.uniform(0.0, 0.1))
        rig.daemon.kill()
        time.sleep(0.1)  # until frames in transit have arrived
        controller.spoil = without(far)
        rig.machine.wants_um(-way * WANTED_UM)
        seen = controller.nodes[near][1]
        if not rig.restart():
            return
        rig.must(eventually(lambda: controller.nodes[near][1] != seen), "sends nothing again")
        time.sleep(0.4)
        loses_nothing(controller)
        rig.must(rig.daemon.wait_for("compensating"), "does not compensate again")
    rig.follows_again()
    rig.must(controller.mixtures == 0, "values of two sets were taken over")


# ---- bridges

@attack(links=("bridge",))
def bridge_takes_and_does_not(rig):
    """Switched off and on many times a second; LinuxCNC clears its offset when switched off."""
    if not rig.start(BEFORE_UM):
        return
    bridge = rig.machine.slave

    def raw():
        if rig.random.random() < 0.2:
            bridge.taking = not bridge.taking
        if not bridge.taking:
            rig.axis.reports_position(0.0)
        return bridge.params()
    rig.machine.wants_um(WANTED_UM)
    bridge.raw = raw
    time.sleep(LOOKED_AT_S)
    bridge.raw = None
    bridge.taking = True
    rig.follows_again()


@attack(links=("bridge",))
def two_bridges(rig):
    """A second bridge with another session reports another position at the same time."""
    from rogue_bridge import RogueBridge
    if not rig.start(BEFORE_UM):
        return
    other = RogueBridge(rig.axis)
    other.raw = lambda: {"session": rig.random.choice((2, 3, 1 << 60)), "taking": True,
                         "applied_um": {"z": rig.random.uniform(-40, 40)}, "signals": {}}
    other.report_to(rig.daemon.socket)
    rig.machine.wants_um(WANTED_UM)
    time.sleep(LOOKED_AT_S)
    other.close()
    rig.follows_again()


@attack(links=("bridge",))
def session_changes_with_each_report(rig):
    """Like a bridge that restarts continually; the axis keeps its position."""
    if not rig.start(BEFORE_UM):
        return
    bridge = rig.machine.slave

    def raw():
        bridge.session += 1
        return bridge.params()
    rig.machine.wants_um(WANTED_UM)
    bridge.raw = raw
    time.sleep(LOOKED_AT_S)
    bridge.raw = None
    rig.follows_again()


@attack(links=("bridge",))
def reports_of_any_kind(rig):
    """Wrong types, missing and unknown keys, huge and missing numbers among good reports."""
    if not rig.start(BEFORE_UM):
        return
    bridge = rig.machine.slave
    wrong = [1e300, -1e300, None, "5", [1], {"z": 1}, True, 1e9, float(1 << 63)]

    def raw():
        params = bridge.params()
        kind = rig.random.randrange(6)
        if kind == 0:
            params["applied_um"]["z"] = rig.random.choice(wrong)
        elif kind == 1:
            params[rig.random.choice(list(params))] = rig.random.choice(wrong)
        elif kind == 2:
            params.pop(rig.random.choice(list(params)))
        elif kind == 3:
            params["more"] = rig.random.choice(wrong)
        return params
    rig.machine.wants_um(WANTED_UM)
    bridge.raw = raw
    time.sleep(LOOKED_AT_S)
    bridge.raw = None
    rig.follows_again()


@attack(links=("bridge",))
def reports_a_thousand_times_a_second(rig):
    """Far more often than a bridge should."""
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(WANTED_UM)
    rig.machine.slave.period_s = 0.0
    time.sleep(LOOKED_AT_S)
    rig.machine.slave.period_s = rig.machine.slave.PERIOD_S
    rig.follows_again()
