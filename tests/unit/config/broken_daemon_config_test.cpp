#include <algorithm>
#include <cstdint>

#include "config/daemon/daemon_config.hpp"
#include "config/model/model_file.hpp"
#include "files.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

DaemonConfig parse_with(const std::string& text, const std::string& model_text) {
  return parse_daemon_config(text, "machine.toml", model_text, "model.toml");
}

// NOLINTNEXTLINE(readability-function-size): a table
const std::vector<Broken>& broken_small_machine() {
  static const std::vector<Broken> table = {
      // ---- keys, types, ranges
      {"unknown key at the top", "log_level = \"info\"", "log_levl = \"info\"", "", "log_levl",
       "did you mean \"log_level\"?"},
      {"unknown key in a table", "rate_hz = 100", "rate_Hz = 100", "", "loop.rate_Hz",
       "did you mean \"rate_hz\"?"},
      {"unknown table", "[loop]", "[lopp]\nx = 1\n[loop]", "", "lopp", "did you mean \"loop\"?"},
      {"unknown key of a sensor", "screening.rate_K_per_s_max = 1.0", "colour = \"red\"", "",
       "sensor[spindle_front].colour", "unknown key"},
      {"unknown key of an override", "smoothing.half_width_K", "smoothing.half_with_K",
       "smoothing.half_with_K", "sensor[room].smoothing.half_with_K",
       "did you mean \"half_width_K\"?"},
      {"format missing", "format = 1\n", "# no format\n", "# thermocompd for", "format",
       "must be given"},
      {"format of the future", "format = 1\n", "format = 2\n", "", "format", "[1, 1]"},
      {"text for a number", "rate_hz = 100", "rate_hz = \"fast\"", "", "loop.rate_hz",
       "must be a number"},
      {"rate too high", "rate_hz = 100", "rate_hz = 2000", "", "loop.rate_hz", "[1, 1000]"},
      {"rate not a number", "rate_hz = 100", "rate_hz = nan", "", "loop.rate_hz", "finite"},
      {"rate infinite", "rate_hz = 100", "rate_hz = inf", "", "loop.rate_hz", "finite"},
      {"priority out of range", "priority = 60", "priority = 99", "", "loop.priority", "[1, 98]"},
      {"priority no whole number", "priority = 60", "priority = 60.5", "", "loop.priority",
       "whole number"},
      {"cpu out of range", "cpu = -1", "cpu = -2", "", "loop.cpu", "[-1, 1023]"},
      {"unknown choice", "real_time = \"warn\"", "real_time = \"maybe\"", "", "loop.real_time",
       "\"warn\" \"require\""},
      {"unknown log level", "log_level = \"info\"", "log_level = \"loud\"", "", "log_level",
       "\"trace\" \"debug\" \"info\""},
      {"state file without a name", "state_file = \"/var/lib/thermocomp/state.json\"",
       "state_file = \"/var/lib/\"", "", "state_file", "must name a file"},
      {"state file is the history", "state_file = \"/var/lib/thermocomp/state.json\"",
       "state_file = \"/var/lib/thermocomp/history.db\"", "", "state_file", "history"},
      {"a table that is a number",
       "valid_bits = { table = \"holding\", address = 10, encoding = \"uint16\" }",
       "valid_bits = 5", "", "controller.valid_bits", "must be a table"},
      // ---- buses
      {"bus name used twice", "[[device]]                               # one",
       "[[bus]]\nname = \"cabinet\" # again\nkind = \"can\"\ninterface = \"can0\"\n[[device]]  # "
       "one",
       "# again", "bus[cabinet].name", "used twice"},
      {"host not an address", "host = \"192.168.10.20\"", "host = \"192.168.10.400\"", "",
       "bus[cabinet].host", "IP address"},
      {"host with a blank", "host = \"192.168.10.20\"", "host = \"the cabinet\"", "",
       "bus[cabinet].host", "host's name"},
      {"host missing", "host = \"192.168.10.20\"\n", "", "[[bus]]", "bus[cabinet].host",
       "must be given"},
      {"host empty", "host = \"192.168.10.20\"", "host = \"\"", "", "bus[cabinet].host",
       "not empty"},
      {"port out of range", "port = 502 ", "port = 65536 ", "", "bus[cabinet].port", "[1, 65535]"},
      {"baud on TCP", "port = 502 ", "baud = 9600 ", "", "bus[cabinet].baud",
       "does not apply to kind = \"modbus_tcp\""},
      {"host on a serial line", "rs485 = false", "host = \"a\"", "", "bus[column_line].host",
       "does not apply to kind = \"modbus_rtu\""},
      {"unusual baud", "baud = 19200", "baud = 19201", "", "bus[column_line].baud", "usual rate"},
      {"parity", "parity = \"even\"", "parity = \"mark\"", "", "bus[column_line].parity",
       "\"none\" \"even\" \"odd\""},
      {"parity missing", "parity = \"even\"", "# parity", "[[bus]]\nname = \"column_line\"",
       "bus[column_line].parity", "must be given"},
      {"serial device relative", "device = \"/dev/ttyUSB0\"", "device = \"ttyUSB0\"", "",
       "bus[column_line].device", "absolute path"},
      {"stop bits", "stop_bits = 1", "stop_bits = 3", "", "bus[column_line].stop_bits", "[1, 2]"},
      {"time-out of zero", "timeout_ms = 200", "timeout_ms = 0", "", "bus[cabinet].timeout_ms",
       "[1, 60000]"},
      {"retries", "retries = 1", "retries = 100", "", "bus[cabinet].retries", "[0, 10]"},
      {"bus nobody uses", "[[device]]                               # one",
       "[[bus]]\nname = \"idle\"\nkind = \"can\"\ninterface = \"can0\"\n[[device]]      # one",
       "name = \"idle\"", "bus[idle].name", "no device"},
      {"serial line used by two buses", "[[device]]                               # one",
       "[[bus]]\nname = \"b\"\nkind = \"modbus_rtu\"\nbaud = 9600\nparity = \"none\"\n"
       "device = \"/dev/ttyUSB0\" # again\n[[device]]\nname = \"d\"\nbus = \"b\"\nunit = 1\n"
       "table = \"input\"\nencoding = \"int16\"\n[[sensor]]\nname = \"s\"\ndevice = \"d\"\n"
       "address = 0\n[[device]]  # one",
       "device = \"/dev/ttyUSB0\" # again", "bus[b].device", "used by two buses"},
      // ---- devices
      {"device on an unknown bus", "bus = \"column_line\"", "bus = \"column_lime\"", "",
       "device[column_module].bus", "must name a bus: cabinet, column_line"},
      {"device name used twice", "[[sensor]]\nname = \"bed_front\"",
       "[[device]]\nname = \"bed_module\" # again\nbus = \"cabinet\"\nunit = 2\n[[sensor]]\nname = "
       "\"bed_front\"",
       "# again", "device[bed_module].name", "used twice"},
      {"unit out of range", "unit = 7", "unit = 248", "", "device[column_module].unit", "[1, 247]"},
      {"broadcast on a serial line", "unit = 7", "unit = 0", "", "device[column_module].unit",
       "broadcast"},
      {"unit on TCP", "unit = 1\nperiod_s", "unit = 250\nperiod_s", "unit = 250",
       "device[bed_module].unit", "[0, 247] or 255"},
      {"period of zero", "period_s = 1.0 ", "period_s = 0.0 ", "", "device[bed_module].period_s",
       "[0.01, 3600]"},
      {"request too large", "registers_per_request_max = 125", "registers_per_request_max = 126",
       "", "device[bed_module].registers_per_request_max", "[1, 125]"},
      {"encoding", "encoding = \"float32\"\nword", "encoding = \"float16\"\nword", "",
       "device[column_module].encoding", "must be one of"},
      {"word order", "word_order = \"CDAB\"", "word_order = \"cdab\"", "",
       "device[column_module].word_order", "\"ABCD\" \"DCBA\" \"BADC\" \"CDAB\""},
      {"temperature in bits", "table = \"holding\"\nencoding = \"float32\"",
       "table = \"coil\"\nencoding = \"float32\"", "", "device[column_module].table",
       "\"input\" \"holding\""},
      {"scale of zero", "scale = 0.1 ", "scale = 0.0 ", "", "device[bed_module].scale",
       "must not be 0"},
      {"code that cannot occur", "open_circuit_codes = [32767]", "open_circuit_codes = [65536]", "",
       "device[bed_module].open_circuit_codes", "[-32768, 65535]"},
      {"code listed twice", "short_circuit_codes = []", "short_circuit_codes = [32767]", "",
       "device[bed_module].short_circuit_codes", "listed twice"},
      {"codes no list", "error_codes = []", "error_codes = 5", "", "device[bed_module].error_codes",
       "must be a list"},
      {"key of a CAN node", "unit = 7", "unit = 7\nid = 5 # here", "id = 5 # here",
       "device[column_module].id", "unknown key"},
      // ---- sensors
      {"sensor on an unknown device", "device = \"bed_module\"\naddress = 0",
       "device = \"bad_module\"\naddress = 0", "", "sensor[bed_front].device",
       "must name a device: bed_module, column_module"},
      {"address missing", "address = 1\n", "# no address\n", "[[sensor]]\nname = \"bed_rear\"",
       "sensor[bed_rear].address", "must be given"},
      {"address of another table as a manual has it", "address = 1\n", "address = 400002\n", "",
       "sensor[bed_rear].address", "table = \"holding\", address = 1"},
      {"serial transaction numbers", "rs485 = false ", "ignore_transaction = true ", "",
       "bus[column_line].ignore_transaction", "serial frames"},
      {"function of writes", "write_function = 16 ", "write_function = 5 ", "",
       "controller.write_function", "[6, 16]"},
      {"address negative", "address = 1\n", "address = -1\n", "", "sensor[bed_rear].address",
       "[0, 65535]"},
      {"value passes the last register", "address = 6\n", "address = 65535\n", "",
       "sensor[spindle_rear].address", "pass register 65535"},
      {"status bit with a mask", "address = 6\n",
       "address = 6\nstatus = { table = \"discrete_input\", address = 0, mask = 1 }\n",
       "status = {", "sensor[spindle_rear].status.mask", "does not apply to a bit"},
      {"mask that hides a code", "address = 6\n",
       "address = 6\nstatus = { table = \"holding\", address = 0, mask = 1, error_codes = [2] }\n",
       "status = {", "sensor[spindle_rear].status.mask", "hides bits of the code 2"},
      {"sensor that refers to itself", "address = 6\n",
       "address = 6\nreference_sensor = \"spindle_rear\"\n", "reference_sensor = \"spindle_rear\"",
       "sensor[spindle_rear].reference_sensor", "another sensor"},
      {"unknown reference sensor", "address = 6\n", "address = 6\nreference_sensor = \"rom\"\n",
       "reference_sensor = \"rom\"", "sensor[spindle_rear].reference_sensor", "must name a sensor"},
      // ---- screening and smoothing
      {"screening range upside down", "temp_degC_min = -30.0", "temp_degC_min = 300.0", "",
       "screening.temp_degC_min", "below temp_degC_max"},
      {"below absolute zero", "temp_degC_min = -30.0", "temp_degC_min = -300.0", "",
       "screening.temp_degC_min", "-273.15"},
      {"stale within the period", "stale_after_s = 5.0", "stale_after_s = 0.0", "",
       "screening.stale_after_s", "(0, 3600]"},
      {"slew of zero", "rate_K_per_s_max = 0.5 ", "rate_K_per_s_max = 0.0 ", "",
       "screening.rate_K_per_s_max", "(0, 1e6]"},
      {"override out of range", "screening.rate_K_per_s_max = 1.0",
       "screening.rate_K_per_s_max = -1.0", "", "sensor[spindle_front].screening.rate_K_per_s_max",
       "(0, 1e6]"},
      {"stale before the next reading", "screening.rate_K_per_s_max = 1.0",
       "screening.stale_after_s = 0.5", "[[sensor]]\nname = \"spindle_front\"",
       "sensor[spindle_front].screening.stale_after_s", "period_s of the device column_module"},
      {"smoothing form", "form = \"sliding_line\"", "form = \"median\"", "", "smoothing.form",
       "\"off\" \"sliding_line\" \"line_of_lines\""},
      {"too few samples", "samples = 6", "samples = 2", "", "smoothing.samples", "[3, 32]"},
      {"band of zero", "half_width_K = 0.3", "half_width_K = 0.0", "", "smoothing.half_width_K",
       "(0, 100]"},
      // ---- blocks
      {"block name used twice", "name = \"table\"\ninput", "name = \"bed\"\ninput",
       "name = \"bed\"\ninput = \"table_degC\"", "block[bed].name", "used twice"},
      {"block without sensors", "sensors = [\"table\"]", "sensors = []", "", "block[table].sensors",
       "at least one"},
      {"block of an unknown sensor", "sensors = [\"table\"]", "sensors = [\"tabel\"]", "",
       "block[table].sensors", "sensor's name"},
      {"sensor twice in a block", "[\"bed_front\", \"bed_rear\"]", "[\"bed_front\", \"bed_front\"]",
       "", "block[bed].sensors", "named twice"},
      {"number among the sensors", "sensors = [\"table\"]", "sensors = [5]", "",
       "block[table].sensors", "element 1 must be a string"},
      {"model temperature without a block",
       "[[block]]\nname = \"room\"\ninput = \"room_degC\"\n"
       "sensors = [\"room\"]\n",
       "", "[[block]]\nname = \"bed\"", "block", "needs a block"},
      // ---- controller
      {"controller kind", "kind = \"modbus_tcp\"                      # dry_run",
       "kind = \"profinet\"                      # dry_run", "", "controller.kind",
       "\"dry_run\" \"modbus_tcp\" \"modbus_rtu\" \"modbus_rtu_over_tcp\" \"modbus_udp\" \"s7\" "
       "\"piezo_tcp\" \"piezo_rtu\" \"can\" "
       "\"linuxcnc\""},
      {"controller host", "host = \"192.168.10.30\"", "host = \"1.2.3\"", "", "controller.host",
       "IP address"},
      {"controller period", "period_s = 0.1", "period_s = 0.0", "", "controller.period_s",
       "[0.005, 60]"},
      {"offset written to inputs", "offset = { table = \"holding\", address = 0",
       "offset = { table = \"input\", address = 0", "", "axis[x].offset.table",
       "must be one of \"holding\""},
      {"heartbeat as a float", "address = 11, encoding = \"uint16\"",
       "address = 11, encoding = \"float32\"", "", "controller.heartbeat.encoding", "\"uint16\""},
      {"two offsets in one register", "offset = { table = \"holding\", address = 2",
       "offset = { table = \"holding\", address = 1", "", "axis[y].offset", "register 1"},
      {"heartbeat in an offset", "heartbeat = { table = \"holding\", address = 11",
       "heartbeat = { table = \"holding\", address = 5", "", "controller.heartbeat", "register 5"},
      {"bound beyond the register",
       "offset = { table = \"holding\", address = 4, encoding = \"int32\", scale = 0.01 }",
       "offset = { table = \"holding\", address = 4, encoding = \"int16\", scale = 0.001 }", "",
       "axis[z].offset", "reaches from -32.768 to 32.767"},
      {"offset without a sign",
       "offset = { table = \"holding\", address = 4, encoding = \"int32\", scale = 0.01 }",
       "offset = { table = \"holding\", address = 4, encoding = \"uint32\", scale = 0.01 }", "",
       "axis[z].offset", "-offset_um_max"},
      {"offset missing",
       "offset = { table = \"holding\", address = 4, encoding = \"int32\", scale = 0.01 }\n", "",
       "[[axis]]\nname = \"z\"", "axis[z].offset", "must be given"},
      {"one axis without read-back",
       "applied = { table = \"input\", address = 4, encoding = \"int32\", scale = 0.01 }\n", "",
       "[[axis]]\nname = \"z\"", "axis[z].applied", "for all axes or for none"},
      {"unknown key of an offset", "address = 4, encoding = \"int32\", scale = 0.01 }\napplied",
       "address = 4, encoding = \"int32\", scal = 0.01 }\napplied", "", "axis[z].offset.scal",
       "did you mean \"scale\"?"},
      {"bit with an encoding", "table = \"discrete_input\"\naddress = 0\n",
       "table = \"discrete_input\"\nencoding = \"int16\" # bit\naddress = 0\n",
       "encoding = \"int16\" # bit", "controller.signal[cutting_on].encoding",
       "does not apply to a bit"},
      {"axis name used twice", "name = \"y\"\noutput", "name = \"x\"\noutput",
       "name = \"x\"\noutput = \"y_um\"", "axis[x].name", "used twice"},
      {"output not in the model", "output = \"y_um\"", "output = \"w_um\"", "", "axis[y].output",
       "output of the model: x_um, y_um, z_um"},
      {"output with a temperature's unit", "output = \"y_um\"", "output = \"y_degC\"", "",
       "axis[y].output", "displacement"},
      {"bound missing", "output = \"y_um\"\noffset_um_max = 60.0\n", "output = \"y_um\"\n",
       "[[axis]]\nname = \"y\"", "axis[y].offset_um_max", "must be given"},
      {"bound too large", "output = \"y_um\"\noffset_um_max = 60.0",
       "output = \"y_um\"\noffset_um_max = 600.0", "offset_um_max = 600.0", "axis[y].offset_um_max",
       "(0, 500]"},
      {"slew not a number", "output = \"y_um\"\noffset_um_max = 60.0\nrate_um_per_s_max = 0.5",
       "output = \"y_um\"\noffset_um_max = 60.0\nrate_um_per_s_max = nan",
       "rate_um_per_s_max = nan", "axis[y].rate_um_per_s_max", "finite"},
      {"sign of two", "sign = 1 ", "sign = 2 ", "", "axis[x].sign", "[-1, 1]"},
      {"sign of zero", "sign = 1 ", "sign = 0 ", "", "axis[x].sign", "1 or -1"},
      // ---- compensation, history, socket
      {"loss policy", "on_loss = \"hold\"", "on_loss = \"clear\"", "", "compensation.on_loss",
       "\"hold\" \"ramp_to_zero\""},
      {"stop policy", "on_stop = \"hold\"", "on_stop = \"zero\"", "", "compensation.on_stop",
       "\"hold\" \"ramp_to_zero\""},
      {"a stop without an end", "stop_ramp_s_max = 120.0", "stop_ramp_s_max = 1e6", "",
       "compensation.stop_ramp_s_max", "(0, 3600]"},
      {"cutting signal not read", "cutting_signal = \"cutting_on\"", "cutting_signal = \"cut_on\"",
       "", "compensation.cutting_signal", "must be a signal"},
      {"disable signal not read", "disable_signal = \"compensation_off_on\"",
       "disable_signal = \"off_on\"", "", "compensation.disable_signal", "must be a signal"},
      {"flag as a number", "hold_while_cutting = false", "hold_while_cutting = 0", "",
       "compensation.hold_while_cutting", "true or false"},
      {"controller stale before it is read", "controller_stale_after_s = 2.0",
       "controller_stale_after_s = 0.05", "", "compensation.controller_stale_after_s",
       "controller's period_s"},
      {"negative mismatch", "mismatch_um = 2.0", "mismatch_um = -2.0", "",
       "compensation.mismatch_um", "(0, 500]"},
      {"commit too rare", "commit_s = 5.0", "commit_s = 11.0", "", "history.commit_s", "[0.1, 10]"},
      {"history without room", "size_MB_max = 512", "size_MB_max = 0", "", "history.size_MB_max",
       "[1, 1e+06]"},
      {"history file a number", "file = \"/var/lib/thermocomp/history.db\"", "file = 1", "",
       "history.file", "must be a string"},
      {"socket path too long", "path = \"/run/thermocomp/status.sock\"",
       "path = \"/run/" + std::string(120, 'a') + "\"", "", "socket.path", "107 characters"},
      {"no group", "operator_group = \"thermocomp-operator\"", "operator_group = \"\"", "",
       "socket.operator_group", "not empty"},
  };
  return table;
}

const std::vector<Broken>& broken_can() {
  static const std::vector<Broken> table = {
      {"baud on a CAN bus", "reconnect_s = 0.5                        # default, at",
       "baud = 9600                        # default, at", "", "bus[machine_bus].baud",
       "does not apply to kind = \"can\""},
      {"long pauses before a CAN interface is tried again", "reconnect_s = 0.5    ",
       "reconnect_s = 1.5    ", "", "bus[machine_bus].reconnect_s", "[0.01, 1]"},
      {"interface with a slash", "interface = \"can0\"\nreconnect_s = 0.5    ",
       "interface = \"/dev/can0\"\nreconnect_s = 0.5    ", "", "bus[machine_bus].interface",
       "interface's name"},
      {"interface missing", "interface = \"can0\"\nperiod_s", "period_s", "[controller]",
       "controller.interface", "must be given"},
      {"a place beyond a classic frame", "start_bit = 0\n", "start_bit = 64\n", "start_bit = 64",
       "sensor[column].start_bit", "[0, 63]"},
      {"a place beyond an FD frame", "fd = false  ", "fd = true\nstart_bit = 512 ",
       "start_bit = 512", "device[node].start_bit", "[0, 511]"},
      {"a counter beyond the frame", "counter = { start_bit = 60, length_bits = 4 }",
       "counter = { start_bit = 60, length_bits = 5 }", "", "device[node].counter.start_bit",
       "does not fit into 8 bytes"},
      {"a page without a multiplexor", "start_bit = 0\n", "start_bit = 0\nmultiplexor_value = 1\n",
       "multiplexor_value = 1", "sensor[column].multiplexor_value", "without a multiplexor"},
      {"a page that the multiplexor cannot show", "start_bit = 0\n",
       "start_bit = 0\nmultiplexor = { start_bit = 56, length_bits = 2 }\nmultiplexor_value = 4\n",
       "multiplexor_value = 4", "sensor[column].multiplexor_value", "[0, 3]"},
      {"a message without a DBC file's signal", "start_bit = 0\n",
       "start_bit = 0\nmessage = \"NODE\"\n", "message = \"NODE\"", "sensor[column].message",
       "without the signal's name"},
      {"unit on a CAN node", "signed = true   ", "unit = 1 ", "", "device[node].unit",
       "does not apply on a CAN bus"},
      {"address on a CAN node", "start_bit = 16\n\n[[block]]",
       "address = 1\nstart_bit = 16\n\n[[block]]", "", "sensor[spindle].address",
       "does not apply on a CAN bus"},
      {"identifier of 12 bits", "id = 0x181", "id = 0x800", "", "device[node].id", "[0, 2047]"},
      {"start bit missing", "start_bit = 16\n\n[[block]]", "\n[[block]]",
       "[[sensor]]\nname = \"spindle\"", "sensor[spindle].start_bit", "must be given"},
      {"signal that leaves the frame", "start_bit = 16\n\n[[block]]", "start_bit = 49\n\n[[block]]",
       "", "sensor[spindle].start_bit", "does not fit into 8 bytes"},
      {"big-endian signal that leaves the frame", "start_bit = 7, length_bits = 16",
       "start_bit = 54, length_bits = 16", "", "axis[z].applied.start_bit",
       "does not fit into 8 bytes"},
      {"float of 16 bits", "start_bit = 16\n\n[[block]]",
       "start_bit = 16\nfloat = true\n\n[[block]]", "[[sensor]]\nname = \"spindle\"",
       "sensor[spindle].length_bits", "32 or 64"},
      {"code beyond the signal", "open_circuit_codes = [0x7FFF]", "open_circuit_codes = [0x10000]",
       "", "device[node].open_circuit_codes", "[-32768, 65535]"},
      {"byte order", "byte_order = \"little_endian\"", "byte_order = \"intel\"", "",
       "device[node].byte_order", "\"little_endian\" \"big_endian\""},
      {"heartbeat over the offset", "heartbeat = { id = 0x200, start_bit = 56",
       "heartbeat = { id = 0x200, start_bit = 8", "", "controller.heartbeat", "shares bits"},
      {"applied in a frame we send", "applied = { id = 0x281", "applied = { id = 0x200", "",
       "axis[z].applied", "sent, not received"},
      {"a sensor in a frame we send", "start_bit = 0\n", "start_bit = 0\nid = 0x200\n",
       "name = \"column\"", "sensor[column].name", "the daemon itself sends"},
      {"bound beyond the bits", "start_bit = 0, length_bits = 16, scale",
       "start_bit = 0, length_bits = 12, scale", "", "axis[z].offset", "reaches from"},
      {"one bit with a sign", "signed = false\n", "signed = true # one bit\n", "",
       "controller.signal[cutting_on].signed", "0 or -1"},
      {"hold while cutting without a signal", "cutting_signal = \"cutting_on\"\n", "",
       "hold_while_cutting = true", "compensation.hold_while_cutting", "needs a cutting_signal"},
      {"host on a CAN controller", "silent_after_s = 2.0", "host = \"a\"", "", "controller.host",
       "does not apply"},
  };
  return table;
}

bool mentions(const std::vector<Problem>& problems, const std::string& key,
              const std::string& rule) {
  return std::any_of(problems.begin(), problems.end(), [&](const Problem& problem) {
    return problem.key == key && problem.rule.find(rule) != std::string::npos;
  });
}

}  // namespace

TEST_CASE("each broken configuration is refused with file, line, key, value and rule", "[config]") {
  const std::string good = example("small_machine.toml");
  const std::string model = example("small_machine_model.toml");
  CHECK(broken_small_machine().size() >= 75);
  for (const Broken& broken : broken_small_machine()) {
    check_refused(broken, good, "machine.toml",
                  [&](const std::string& text) { return parse_with(text, model); });
  }
}

TEST_CASE("each broken CAN configuration is refused with file, line, key, value and rule",
          "[config][can]") {
  const std::string model = example("column_model.toml");
  for (const Broken& broken : broken_can()) {
    check_refused(broken, example("can.toml"), "machine.toml",
                  [&](const std::string& text) { return parse_with(text, model); });
  }
}

TEST_CASE("a dry run accepts no place for offsets", "[config]") {
  const std::string model = example("column_model.toml");
  const std::string good = example("modbus_rtu.toml");
  const std::vector<Broken> table = {
      {"host", "kind = \"dry_run\"", "host = \"a\"\nkind = \"dry_run\"", "", "controller.host",
       "does not apply"},
      {"dry run twice", "kind = \"dry_run\"", "dry_run = true\nkind = \"dry_run\"", "",
       "controller.dry_run", "give its kind and dry_run = true"},
      {"signal", "[[axis]]", "[[controller.signal]]\nname = \"x_mm\"\n[[axis]]", "",
       "controller.signal", "does not apply"},
      {"offset", "output = \"z_um\"", "offset = { address = 0 }\noutput = \"z_um\"", "",
       "axis[z].offset", "does not apply"},
  };
  for (const Broken& broken : table) {
    check_refused(broken, good, "machine.toml",
                  [&](const std::string& text) { return parse_with(text, model); });
  }
}

TEST_CASE("all problems are reported at once, in both files, in the order of their lines",
          "[config]") {
  std::string text = example("small_machine.toml");
  text = edited(text, "rate_hz = 100", "rate_hz = 0");
  text = edited(text, "port = 502 ", "prt = 502 ");
  text = edited(text, "samples = 6", "samples = 99");
  text = edited(text, "half_width_K = 0.3", "half_width_K = 0.0");
  text = edited(text, "outage_s = 5.0", "outage_s = -1");
  text = edited(text, "output = \"y_um\"", "output = \"w_um\"");
  const std::string model =
      edited(example("small_machine_model.toml"), "tau_s = 900.0", "tau_s = -900.0");
  const auto problems = problems_of([&] { return parse_with(text, model); });
  CHECK(problems.size() == 7);
  CHECK(mentions(problems, "loop.rate_hz", "[1, 1000]"));
  CHECK(mentions(problems, "bus[cabinet].prt", "unknown key"));
  CHECK(mentions(problems, "smoothing.samples", "[3, 32]"));
  CHECK(mentions(problems, "smoothing.half_width_K", "(0, 100]"));
  CHECK(mentions(problems, "smoothing.outage_s", "(0, 86400]"));
  CHECK(mentions(problems, "axis[y].output", "output of the model"));
  CHECK(mentions(problems, "term[1].tau_s", "1e+06"));
  REQUIRE(!problems.empty());
  CHECK(problems.back().file == "model.toml");
  CHECK(std::is_sorted(problems.begin(), problems.end() - 1,
                       [](const Problem& a, const Problem& b) { return a.line < b.line; }));
}

TEST_CASE("suspected sensors can be weighed down only with a covariance", "[config]") {
  const std::string asked = edited(example("small_machine.toml"), "suspected_sensors = \"warn\"",
                                   "suspected_sensors = \"weigh_down\"");
  const std::string model = example("small_machine_model.toml");
  CHECK(mentions(problems_of([&] { return parse_with(asked, model); }),
                 "compensation.suspected_sensors", "thermocomp covariance"));
  const std::string blind =
      edited(asked, "estimate_lost_blocks = true", "estimate_lost_blocks = false");
  CHECK(mentions(problems_of([&] { return parse_with(blind, model); }),
                 "compensation.estimate_lost_blocks", "must be true where suspected_sensors"));
  const std::string odd = edited(asked, "\"weigh_down\"", "\"ignore\"");
  CHECK(mentions(problems_of([&] { return parse_with(odd, model); }),
                 "compensation.suspected_sensors", "\"weigh_down\""));
  const ThermalModel read = parse_model(model, "model.toml");
  std::string rows;
  for (std::size_t i = 0; i < read.inputs.size(); ++i) {
    rows += "[";
    for (std::size_t j = 0; j < read.inputs.size(); ++j) rows += i == j ? "5.0, " : "4.0, ";
    rows += "], ";
  }
  const std::string able = model + "\n[covariance]\nmatrix_K2 = [" + rows + "]\n";
  CHECK(parse_with(asked, able).estimator.compensation.suspected_sensors ==
        SuspectedPolicy::weigh_down);
}

TEST_CASE("a model that needs a signal is refused without a controller", "[config]") {
  const std::string model = example("column_model.toml") +
                            "[[term]]\nkind = \"speed_growth\"\nsubject = \"spindle_rpm\"\n"
                            "gain_um_per_unit2 = { z_um = 1e-7 }\n";
  CHECK(mentions(problems_of([&] { return parse_with(example("modbus_rtu.toml"), model); }),
                 "controller.signal", "kind and dry_run = true"));
}

TEST_CASE("an edit that breaks several rules is reported once per rule", "[config]") {
  const std::string good = example("small_machine.toml");
  const std::string model = example("small_machine_model.toml");
  const auto problems_after = [&](const std::string& from, const std::string& to) {
    return problems_of([&] { return parse_with(edited(good, from, to), model); });
  };
  CHECK(mentions(problems_after("name = \"bed_rear\"", "name = \"bed_front\""),
                 "sensor[bed_front].name", "used twice"));
  CHECK(mentions(problems_after("name = \"spindle_rpm\"", "name = \"cutting_on\""),
                 "controller.signal[cutting_on].name", "used twice"));
  CHECK(mentions(problems_after("name = \"compensation_off_on\"", "name = \"oil_degC\""),
                 "controller.signal[oil_degC].name", "by its unit"));
  const auto unread = problems_after("name = \"x_mm\"", "name = \"w_mm\"");
  CHECK(mentions(unread, "controller.signal", "model.toml needs this signal from the controller"));
  CHECK(mentions(unread, "controller.signal", "ignore = [\"x_mm\"]"));
  CHECK(mentions(problems_after("input = \"room_degC\"", "input = \"bed_degC\""),
                 "block[room].input", "another block"));
  CHECK(mentions(problems_after("input = \"room_degC\"", "input = \"oil_degC\""),
                 "block[room].input", "temperature of the model"));
  CHECK(mentions(problems_after("input = \"room_degC\"", "input = \"room_um\""),
                 "block[room].input", "must be a temperature"));
  CHECK(mentions(problems_after("kind = \"modbus_rtu\"", "kind = \"profibus\""),
                 "bus[column_line].kind", "must be one of"));
  CHECK(mentions(problems_after("unit = 7", "unit = 7\nregisters_per_request_max = 1"),
                 "sensor[column_left].address", "registers_per_request_max"));
}

TEST_CASE("a cycle of reference sensors is refused", "[config]") {
  const std::string good = example("small_machine.toml");
  std::string text = edited(good, "address = 4\nscreening",
                            "address = 4\nreference_sensor = "
                            "\"spindle_rear\"\nscreening");
  text = edited(text, "address = 6\n", "address = 6\nreference_sensor = \"spindle_front\"\n");
  const auto problems =
      problems_of([&] { return parse_with(text, example("small_machine_model.toml")); });
  CHECK(problems.size() == 2);
  CHECK(mentions(problems, "sensor[spindle_front].reference_sensor", "lead back"));
  CHECK(mentions(problems, "sensor[spindle_rear].reference_sensor", "lead back"));
}

TEST_CASE("too many axes and too many signals are refused", "[config]") {
  std::string text = example("modbus_rtu.toml");
  for (int i = 0; i < 16; ++i) {
    text += "[[axis]]\nname = \"a" + std::to_string(i) +
            "\"\noutput = \"z_um\"\noffset_um_max = 1\nrate_um_per_s_max = 1\n";
  }
  const std::string model = example("column_model.toml");
  CHECK(mentions(problems_of([&] { return parse_with(text, model); }), "axis[a15].name",
                 "at most 16 axes"));
  text = example("can.toml");
  for (int i = 0; i < 48; ++i) {
    text += "[[controller.signal]]\nname = \"s" + std::to_string(i) +
            "\"\nid = 5\nstart_bit = 0\nlength_bits = 8\n";
  }
  CHECK(mentions(problems_of([&] { return parse_with(text, model); }),
                 "controller.signal[s47].name", "at most 48 signals"));
}

TEST_CASE("invalid TOML is refused with its line", "[config]") {
  const std::string model = example("column_model.toml");
  for (const std::string text : {"format = 1\nformat = 2\n", "format = 1\n[loop\n",
                                 "format = 1\nx = \n", "format = 1\nx = \"\xff\"\n"}) {
    const auto problems = problems_of([&] { return parse_with(text, model); });
    REQUIRE(problems.size() == 1);
    CHECK(problems.front().line == 2);
    CHECK_THAT(problems.front().rule, Catch::Contains("not TOML"));
  }
}

TEST_CASE("an empty file is reported with all missing keys", "[config]") {
  const auto problems = problems_of([] { return parse_with("", ""); });
  for (const char* key : {"format", "model", "bus", "device", "sensor", "block", "axis",
                          "controller", "inputs", "outputs"}) {
    INFO(key);
    CHECK(mentions(problems, key, "must be given"));
  }
}

TEST_CASE("unreadable files are named", "[config]") {
  CHECK(problems_of([] { return load_daemon_config("/nonexistent/machine.toml"); }).size() == 1);
  CHECK(problems_of([] { return load_daemon_config("/"); }).size() == 1);
  const auto folder =
      std::filesystem::temp_directory_path() / ("thermocomp-config-" + std::to_string(std::rand()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "machine.toml") << example("can.toml");
  const auto problems = problems_of([&] { return load_daemon_config(folder / "machine.toml"); });
  std::filesystem::remove_all(folder);
  REQUIRE(problems.size() == 1);
  CHECK(problems.front().key == "model.file");
  CHECK_THAT(problems.front().rule, Catch::Contains("no such file"));
}

TEST_CASE("a damaged file is at worst refused", "[config][property]") {
  // Bytes dropped, doubled and replaced at pseudo-random positions.
  const std::string good = example("small_machine.toml");
  const std::string model = example("small_machine_model.toml");
  std::uint32_t state = 12345;
  const auto next = [&](std::size_t below) {
    state = state * 1664525u + 1013904223u;
    return static_cast<std::size_t>(state >> 8u) % below;
  };
  for (int round = 0; round < 300; ++round) {
    std::string text = good;
    for (int i = 0; i < 3; ++i) {
      const std::size_t at = next(text.size());
      const std::size_t sort = next(3);
      if (sort == 0) text.erase(at, 1 + next(20));
      if (sort == 1) text.insert(at, text.substr(next(text.size()), next(60)));
      if (sort == 2) text[at] = static_cast<char>(next(256));
    }
    for (const Problem& problem : problems_of([&] { return parse_with(text, model); })) {
      CHECK(!problem.rule.empty());
    }
  }
}
