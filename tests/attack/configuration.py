"""Configurations of the attacked machine as a commissioning engineer would write them."""

MODEL = """format = 1
inputs = ["column_degC", "spindle_degC"]
outputs = ["z_um"]
reference = "first_sample"
matrix_um_per_K = [[3.0, -1.5]]
"""
HEAD = """format = 1
state_file = "{folder}/state.json"
[loop]
rate_hz = {rate_hz}
[model]
file = "{model}"
"""
SENSOR_TABLE = """[[device]]
name = "module"
bus = "cabinet"
unit = 1
period_s = 0.02
table = "input"
encoding = "{encoding}"
scale = {scale}
[[sensor]]
name = "column"
device = "module"
address = 0
[[sensor]]
name = "spindle"
device = "module"
address = 2
"""
CAN_SENSORS = """[[bus]]
name = "cabinet"
kind = "can"
interface = "vcan0"
[[device]]
name = "module"
bus = "cabinet"
id = 0x181
length_bits = 16
scale = 0.01
[[sensor]]
name = "column"
device = "module"
start_bit = 0
[[sensor]]
name = "spindle"
device = "module"
start_bit = 16
"""
REST = """[screening]
settle_s = 0.0
temp_degC_min = -30.0
temp_degC_max = 120.0
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
MODBUS_CONTROLLER = """[controller]
name = "cnc"
kind = "{kind}"
unit = {unit}
{place}timeout_ms = 200
reconnect_s = 0.1
period_s = 0.02
valid_bits = {{ table = "holding", address = 2, encoding = "uint16" }}
heartbeat = {{ table = "holding", address = 3, encoding = "uint16" }}
[[axis]]
name = "z"
output = "z_um"
offset_um_max = {bound}
rate_um_per_s_max = {rate}
offset = {{ table = "holding", address = 0, encoding = "int32", scale = 0.001 }}
applied = {{ table = "input", address = 10, encoding = "{shown_as}", scale = {shown_scale} }}
"""
CAN_LINK = """[controller]
name = "cnc"
kind = "can"
interface = "vcan1"
period_s = 0.02
silent_after_s = 0.5
reconnect_s = 0.1
valid_bits = {{ id = 0x200, start_bit = 32, length_bits = 8 }}
heartbeat = {{ id = 0x200, start_bit = 40, length_bits = 8 }}
"""
CAN_CONTROLLER = CAN_LINK + """[[axis]]
name = "z"
output = "z_um"
offset_um_max = {bound}
rate_um_per_s_max = {rate}
offset = {{ id = 0x200, start_bit = 0, length_bits = 32, scale = 0.001 }}
applied = {{ id = 0x300, start_bit = 0, length_bits = 32, {can_float}scale = {shown_scale} }}
"""
# The displacement is constant along the travel: both nodes have the same offset.
TRAVEL_MODEL = MODEL + """[guideway.bed]
axis = "y_mm"
positions_mm = [0.0, 500.0]
rows_um_per_K.z_um = [[0.0, 0.0], [0.0, 0.0]]
"""
CAN_TRAVEL_CONTROLLER = CAN_LINK + """[[controller.signal]]
name = "y_mm"
id = 0x302
start_bit = 0
length_bits = 16
signed = false
[[axis]]
name = "z"
output = "z_um"
offset_um_max = {bound}
rate_um_per_s_max = {rate}
[axis.table]
position = "y_mm"
nodes_mm = [0.0, 500.0]
offsets = [
  {{ id = 0x201, start_bit = 0, length_bits = 32, scale = 0.001 }},
  {{ id = 0x202, start_bit = 0, length_bits = 32, scale = 0.001 }},
]
set_numbers = [
  {{ id = 0x201, start_bit = 32, length_bits = 8 }},
  {{ id = 0x202, start_bit = 32, length_bits = 8 }},
]
[axis.table.applied]
offsets = [
  {{ id = 0x301, start_bit = 0, length_bits = 32, {can_float}scale = {shown_scale} }},
  {{ id = 0x303, start_bit = 0, length_bits = 32, {can_float}scale = {shown_scale} }},
]
set_numbers = [
  {{ id = 0x301, start_bit = 32, length_bits = 8 }},
  {{ id = 0x303, start_bit = 32, length_bits = 8 }},
]
"""
BRIDGE = """[controller]
name = "mill"
kind = "linuxcnc"
silent_after_s = 1.0
[[axis]]
name = "z"
output = "z_um"
offset_um_max = {bound}
rate_um_per_s_max = {rate}
"""
PIEZO = """[controller]
name = "amplifier"
kind = "piezo_tcp"
unit = {unit}
{place}timeout_ms = 200
reconnect_s = 0.1
period_s = 0.02
[[axis]]
name = "z"
output = "z_um"
offset_um_max = {bound}
rate_um_per_s_max = {rate}
offset = {{ table = "holding", address = 0, encoding = "uint16", scale = 0.01 }}
applied = {{ table = "input", address = 10, encoding = "uint16", scale = 0.01 }}
[axis.piezo]
curve_V = {volts}
curve_um = {um}
settle_s = 0.1
steady_s = 0.2
"""
TAIL = """[compensation]
enabled_at_first_start = true
mismatch_um = 2.0
mismatch_after_s = 1.0
{compensation}[history]
file = "{folder}/history.db"
commit_s = 0.2
offsets_period_s = 0.02
{more}[socket]
path = "{socket}"
"""
