"""A machine connected to the daemon only through its buses: thermocouples showing a test's values and
a controller with possibly false read-backs."""

import math
import pathlib
import struct

import configuration as text
from axis import Axis
from modbus_server import RtuSlaves, Registers, TcpSlave

BOUND_UM = 50.0
RATE_UM_PER_S = 2.0
UM_PER_K = 3.0
RESOLUTION_UM = 0.001
LINK_PERIOD_S = 0.02
REFERENCE_degC = 20.0
VALID, HEARTBEAT, APPLIED = 2, 3, 10  # registers; the offset is in 0 and 1
LINKS = ("tcp", "rtu", "can", "can_travel", "bridge", "piezo")
CURVE = ((0.0, -22.0), (25.0, -16.5), (50.0, -9.4), (75.0, -1.3), (100.0, 7.2), (125.0, 15.4),
         (150.0, 22.8))
PIEZO_BOUND_UM = 20.0


def encoded(value, kind, scale):
    """Registers, high word first; saturates."""
    if kind == "float32":
        return struct.unpack(">2H", struct.pack(">f", value / scale))
    if not math.isfinite(value):
        value = 0.0
    counts = max(-2**31, min(2**31 - 1, round(value / scale)))
    return struct.unpack(">2H", struct.pack(">i", counts))


class Thermocouples:
    """Registers with two temperatures; a test may write other words."""

    def __init__(self, encoding="int32", scale=0.001):
        self.encoding, self.scale = encoding, scale
        self.registers = Registers()
        self.show(REFERENCE_degC, REFERENCE_degC)

    def show(self, column_degC, spindle_degC=REFERENCE_degC):
        for address, temp in ((0, column_degC), (2, spindle_degC)):
            self.registers.put(4, address, encoded(temp, self.encoding, self.scale))


class ModbusController:
    """Registers of an Axis."""

    def __init__(self, axis, shown_as="int32", shown_scale=RESOLUTION_UM):
        self.axis = axis
        self.shown_as, self.shown_scale = shown_as, shown_scale
        self.registers = Registers()
        self.registers.before_read = self.show
        self.registers.after_write = self.written

    def show(self, function, address, count):
        if function == 4 and address <= APPLIED < address + count:
            shown_um = self.axis.shown_um(self.registers.writer)
            self.registers.put(4, APPLIED, encoded(shown_um, self.shown_as, self.shown_scale))

    def written(self):
        if self.registers.words(3, VALID, 1)[0] & 1:
            counts, = struct.unpack(">i", struct.pack(">2H", *self.registers.words(3, 0, 2)))
            self.axis.written(RESOLUTION_UM * counts, self.registers.writer)

    def restart(self):
        """Power cycle: all registers 0."""
        with self.registers.lock:
            self.registers.clear()
            self.axis.reports_position(0.0)


class PiezoAmplifier:
    """Registers of the amplifier; the axis position follows from the curve and its voltage."""

    def __init__(self, axis):
        self.axis = axis
        self.volts = []  # without repetitions
        self.hysteresis = 0  # voltages not approached from 0 V
        self.registers = Registers()
        self.registers.before_read = self.show
        self.registers.after_write = self.written
        axis.reports_position(CURVE[0][1])

    def show(self, function, address, count):
        if function == 4 and address <= APPLIED < address + count:
            volts = self.volts[-1] if self.volts else 0.0
            if self.axis.read_error is not None:
                self.axis.had_read_error = True
                with self.axis.lock:
                    stands, self.axis.position_um = self.axis.position_um, volts
                    volts = self.axis.read_error(self.axis, 0.0)
                    self.axis.position_um = stands
            self.registers.put(4, APPLIED, [max(0, min(65535, round(100 * volts)))])

    def written(self):
        volts = 0.01 * self.registers.words(3, 0, 1)[0]
        if volts > 0.0 and self.volts and self.volts[-1] not in (0.0, volts):
            self.hysteresis += 1
        if not self.volts or volts != self.volts[-1]:
            self.volts.append(volts)
        if volts > 0.0:  # 0 V precedes every voltage and is not an offset
            self.axis.written(displacement_um(volts))

    def restart(self):
        with self.registers.lock:
            self.registers.clear()


def displacement_um(volts):
    for (low_V, low_um), (high_V, high_um) in zip(CURVE, CURVE[1:]):
        if volts <= high_V:
            return low_um + (volts - low_V) / (high_V - low_V) * (high_um - low_um)
    return math.inf


class Machine:
    """`link`: one of LINKS. The thermocouples use the same kind of bus, or Modbus TCP for
    controllers without a bus."""

    def __init__(self, folder, link, shown_as="int32", shown_scale=RESOLUTION_UM, **choices):
        self.folder = pathlib.Path(folder)
        self.link = link
        self.choices = {"rate_hz": 100, "stale_after_s": 1.0, "compensation": "", "more": "",
                        "model": "model.toml", "rate": RATE_UM_PER_S,
                        "bound": PIEZO_BOUND_UM if link == "piezo" else BOUND_UM} | choices
        self.axis = Axis(self.choices["bound"], self.choices["rate"])
        self.shown_as, self.shown_scale = shown_as, shown_scale
        self.choices |= {"shown_as": shown_as, "shown_scale": shown_scale,
                         "can_float": "float = true, " if shown_as == "float32" else ""}
        self.thermocouples = Thermocouples(self.choices.get("encoding", "int32"))
        self.slaves = []
        getattr(self, "make_" + link)()
        model = text.TRAVEL_MODEL if link == "can_travel" else text.MODEL
        (self.folder / "model.toml").write_text(model)

    def make_tcp(self):
        self.controller = ModbusController(self.axis, self.shown_as, self.shown_scale)
        self.sensor_slave = self.tcp_slave(self.thermocouples.registers, "module")
        self.slave = self.tcp_slave(self.controller.registers, "cnc")

    def make_rtu(self):
        self.controller = ModbusController(self.axis, self.shown_as, self.shown_scale)
        self.sensor_slave = RtuSlaves({1: self.thermocouples.registers}, "module")
        self.slave = RtuSlaves({1: self.controller.registers}, "cnc")
        self.slaves += [self.sensor_slave, self.slave]

    def make_piezo(self):
        self.controller = PiezoAmplifier(self.axis)
        self.sensor_slave = self.tcp_slave(self.thermocouples.registers, "module")
        self.slave = self.tcp_slave(self.controller.registers, "amplifier")

    def make_bridge(self):
        from rogue_bridge import RogueBridge
        self.controller = self.slave = RogueBridge(self.axis)
        self.sensor_slave = self.tcp_slave(self.thermocouples.registers, "module")
        self.slaves.append(self.slave)

    def make_can(self, travel=False):
        from can_nodes import CanController, CanThermocouples, CanTravelController
        self.thermocouples = self.sensor_slave = CanThermocouples("vcan0")
        made = CanTravelController if travel else CanController
        self.controller = self.slave = made(self.axis, "vcan1", self.shown_as, self.shown_scale)
        self.slaves += [self.sensor_slave, self.slave]

    def make_can_travel(self):
        self.make_can(travel=True)

    def tcp_slave(self, registers, name):
        self.slaves.append(TcpSlave(registers, name))
        return self.slaves[-1]

    def sensor_text(self):
        if self.link.startswith("can"):
            return text.CAN_SENSORS
        kind = "modbus_rtu" if self.link == "rtu" else "modbus_tcp"
        return (f'[[bus]]\nname = "cabinet"\nkind = "{kind}"\n{self.sensor_slave.place()}' +
                text.SENSOR_TABLE.format(encoding=self.thermocouples.encoding,
                                    scale=self.thermocouples.scale))

    def controller_text(self, choices):
        if self.link == "can":
            return text.CAN_CONTROLLER.format(**choices)
        if self.link == "can_travel":
            return text.CAN_TRAVEL_CONTROLLER.format(**choices)
        if self.link == "bridge":
            return text.BRIDGE.format(**choices)
        choices = choices | {"place": self.slave.place()}
        if self.link == "piezo":
            return text.PIEZO.format(volts=[volt for volt, _ in CURVE],
                                     um=[um for _, um in CURVE], **choices)
        return text.MODBUS_CONTROLLER.format(kind="modbus_" + self.link, **choices)

    def config(self, folder, socket, unit=1, **other):
        """A daemon configuration with its files in `folder`."""
        choices = self.choices | {"folder": folder, "socket": socket, "unit": unit} | other
        return (text.HEAD.format(**choices) + self.sensor_text() + text.REST.format(**choices) +
                self.controller_text(choices) + text.TAIL.format(**choices))

    def wants_um(self, offset_um):
        """Sets the column temperature for this offset (with the reference of the start)."""
        self.thermocouples.show(REFERENCE_degC - offset_um / UM_PER_K)

    def close(self):
        for slave in self.slaves:
            slave.close()
