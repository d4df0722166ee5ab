"""A thermocouple module and a controller on Modbus TCP, set by a test at any time, that record
every write. Intentionally small and independent of the simulator."""

import struct
import time

from modbus_server import Registers, TcpSlave


class PlainDevice(Registers, TcpSlave):
    """Tables of one Modbus TCP device. Restarts keep the port; registers are then 0."""

    def __init__(self, port):
        Registers.__init__(self)
        self.refused = set()  # functions answered with exception 1
        self.refusal = lambda function, _address, _count: int(function in self.refused)
        self.after_write = self.written
        TcpSlave.__init__(self, self, "device", port)

    def start(self):
        self.clear()
        super().start()

    def stop(self):
        """Like a switched-off device: connections are closed, new ones refused."""
        super().stop()
        threads, self.threads = self.threads, []
        for thread in threads:
            thread.join(20)

    close = stop

    def written(self):
        pass


class PlainModule(PlainDevice):
    def show(self, *temps_degC):
        with self.lock:
            for i, temp in enumerate(temps_degC):
                self.tables[4][i] = round(100 * temp) & 0xFFFF


class PlainController(PlainDevice):
    """Applies the offset while its valid bit is set."""

    def start(self):
        self.applied_nm = 0
        self.shown_more_um = 0.0
        self.order_log = []  # (CLOCK_MONOTONIC [s], offset [um]) of every valid write
        super().start()

    def written(self):
        words = self.tables[3]
        if not words.get(2, 0) & 1:
            return
        self.applied_nm, = struct.unpack(">i", struct.pack(">2H", words.get(0, 0),
                                                           words.get(1, 0)))
        self.order_log.append((time.monotonic(), 0.001 * self.applied_nm))
        self.show_applied()

    def show_applied(self):
        shown_nm = self.applied_nm + round(1000 * self.shown_more_um)
        high, low = struct.unpack(">2H", struct.pack(">i", shown_nm))
        self.tables[4].update({10: high, 11: low})

    def switch_compensation_off(self, off):
        with self.lock:
            self.tables[2][0] = int(off)

    def force_applied_um(self, offset_um):
        with self.lock:
            self.applied_nm = round(1000 * offset_um)
            self.show_applied()

    def show_more_um(self, um):
        with self.lock:
            self.shown_more_um = um
            self.show_applied()

    def applied_um(self):
        with self.lock:
            return 0.001 * self.applied_nm

    def orders(self):
        with self.lock:
            return list(self.order_log)


RATE_UM_PER_S = 8.0
MODEL = """format = 1
inputs = ["column_degC", "spindle_degC"]
outputs = ["z_um"]
reference = "first_sample"
matrix_um_per_K = [[3.0, -1.5]]
"""
# One block per sensor, without screening and smoothing of readings.
BLOCKS = """[screening]
settle_s = 0.0
stale_after_s = {stale_after_s}
rate_allowance_K = 100.0
[smoothing]
form = "off"
[[block]]
name = "column"
input = "column_degC"
sensors = ["column"]
[[block]]
name = "spindle"
input = "spindle_degC"
sensors = ["spindle"]
"""
# Module and controller.
OVER_TCP = """[[bus]]
name = "cabinet"
kind = "modbus_tcp"
host = "127.0.0.1"
port = {module}
[[device]]
name = "module"
bus = "cabinet"
unit = 1
period_s = 0.02
table = "input"
encoding = "int16"
scale = 0.01
[[sensor]]
name = "column"
device = "module"
address = 0
[[sensor]]
name = "spindle"
device = "module"
address = 1
[controller]
name = "cnc"
kind = "modbus_tcp"
host = "127.0.0.1"
port = {controller}
unit = 1
period_s = 0.02
valid_bits = {{ table = "holding", address = 2, encoding = "uint16" }}
heartbeat = {{ table = "holding", address = 3, encoding = "uint16" }}
[[controller.signal]]
name = "compensation_off_on"
table = "discrete_input"
address = 0
[[axis]]
name = "z"
output = "z_um"
offset_um_max = 60.0
rate_um_per_s_max = 8.0
offset = {{ table = "holding", address = 0, encoding = "int32", scale = 0.001 }}
applied = {{ table = "input", address = 10, encoding = "int32", scale = 0.001 }}
"""
CONFIG = """format = 1
@STATE@
[loop]
rate_hz = 100
[model]
file = "model.toml"
""" + BLOCKS.format(stale_after_s=1.0) + OVER_TCP + """[compensation]
enabled_at_first_start = true
disable_signal = "compensation_off_on"
prove_hold_s = 0.2
[history]
@HISTORY@
offsets_period_s = 0.01
commit_s = 0.2
"""


class Machine:
    """Module, controller and a daemon between them; the test starts the daemon."""

    def __init__(self, lab, controller=PlainController):
        from lab import free_port
        self.module = lab.also_end(PlainModule(free_port()))
        self.controller = lab.also_end(controller(free_port()))
        self.module.show(20.0, 20.0)
        self.model = lab.folder / "model.toml"
        self.model.write_text(MODEL)
        self.config = CONFIG.format(module=self.module.port, controller=self.controller.port)
        self.daemon = lab.daemon(self.config)

    def warm_by(self, offset_um):
        """Sets the column temperature for this offset, relative to the 20 degC of the reference."""
        self.module.show(20.0 - offset_um / 3.0, 20.0)

    def start(self):
        self.daemon.start().wait_for_mode("compensating")
        return self.daemon


def assert_slewed(orders, slack_s=0.7):
    """Consecutive orders differ by at most the slew limit; the slack covers a busy machine's delay
    between computing an offset and its arrival."""
    assert len(orders) > 1
    for (earlier_s, earlier), (later_s, later) in zip(orders, orders[1:]):
        allowed = RATE_UM_PER_S * (later_s - earlier_s + slack_s) + 0.001
        assert abs(later - earlier) <= allowed, (earlier_s, earlier, later_s, later)


class PlainAmplifier(PlainController):
    """A piezo amplifier: register 0 is the voltage in 0.01 V. The piezo has hysteresis: it lags by
    PLAY_V behind a voltage not approached from 0 V. Input register 10 shows the voltage."""

    CURVE = ((0.0, -22.0), (25.0, -16.5), (50.0, -9.4), (75.0, -1.3), (100.0, 7.2),
             (125.0, 15.4), (150.0, 22.8))
    PLAY_V = 8.0

    def start(self):
        self.volts = []  # without repetitions
        self.bent_V = 0.0  # voltage followed by the ceramic
        super().start()

    def written(self):
        voltage = 0.01 * self.tables[3].get(0, 0)
        self.tables[4][10] = round(100 * voltage)
        if not self.volts or self.volts[-1] != voltage:
            self.volts.append(voltage)
        if voltage == 0.0:
            self.bent_V = 0.0
        else:  # follows upwards, lags downwards
            self.bent_V = max(voltage, min(self.bent_V, voltage + self.PLAY_V))

    def displacement_um(self):
        with self.lock:
            at = self.bent_V
        for (low_V, low_um), (high_V, high_um) in zip(self.CURVE, self.CURVE[1:]):
            if at <= high_V:
                return low_um + (at - low_V) / (high_V - low_V) * (high_um - low_um)
        return self.CURVE[-1][1]

    def all_volts(self):
        with self.lock:
            return list(self.volts)

# The same module and controller for thermocomp-sim.
SIMULATED = """format = 1
[[bus]]
name = "sensors"
kind = "modbus_tcp"
port = 0
[[device]]
name = "module"
bus = "sensors"
unit = 1
encoding = "int16"
scale = 0.01
[[channel]]
name = "column"
device = "module"
address = 0
[[channel]]
name = "spindle"
device = "module"
address = 1
[controller]
name = "cnc"
kind = "modbus_tcp"
port = 0
valid_bits = { table = "holding", address = 2, encoding = "uint16" }
heartbeat = { table = "holding", address = 3, encoding = "uint16" }
[[controller.signal]]
name = "compensation_off_on"
table = "discrete_input"
address = 0
value = 0
[[axis]]
name = "z"
output = "z_um"
offset = { table = "holding", address = 0, encoding = "int32", scale = 0.001 }
applied = { table = "input", address = 10, encoding = "int32", scale = 0.001 }
"""
