#include "cli/common/reason_text.hpp"

#include <algorithm>
#include <array>

namespace thermocomp::cli {

namespace {

constexpr std::array<ReasonText, 19> reasons{{
    {"operator_disabled", "switched off: by an operator, or never switched on yet",
     "thermocomp enable"},
    {"controller_disabled", "switched off at the controller",
     "release the switch that the configuration names as disable_signal"},
    {"block_lost", "an input of the model has no good sensor left",
     "thermocomp sensors says which and why; mend the sensor or its bus"},
    {"signal_lost", "a position or operating signal that the model needs is missing",
     "look at what the controller reports; check its [[controller.signal]] entries"},
    {"no_reference", "there is no reference state yet",
     "wait until every sensor has had a value, or: thermocomp reference"},
    {"controller_offline", "the controller does not answer",
     "check its power, cable and address; the offset it applied last may stay in effect"},
    {"not_synced", "what the controller applies is not known yet",
     "wait a moment; if it stays, check the read-back (`applied`) of every axis"},
    {"mismatch", "the controller applies another offset than the one sent",
     "compare offset and applied below; check scale, sign and bounds at the controller"},
    {"cutting", "the offset is held until the cut ends", "nothing to do"},
    {"at_bound", "an offset is at its bound, so that part of the displacement remains",
     "check the sensors and the reference; if the warming is real, look at offset_um_max"},
    {"applied_out_of_bound",
     "the controller applies an offset beyond the bound that is configured here",
     "that axis is not driven; set the offset at the controller to zero and look for who set it"},
    {"block_estimated", "an input of the model has no good sensor left and is estimated",
     "compensation goes on; thermocomp sensors says which and why; mend the sensor"},
    {"mismatch_latched", "what is read back cannot come from what is sent: that axis is not driven",
     "see below what was sent and read; mend it, then: thermocomp release AXIS"},
    {"no_target", "the model gives no finite displacement",
     "check the reference (thermocomp reference) and the model file"},
    {"outside_domain", "the machine is outside of what its model was made from",
     "the offset may be wrong: measure, and make the model anew with a run of such a day"},
    {"sensor_suspected", "a sensor shows what its neighbours contradict",
     "check its contact, its place and its wiring; compare it with a hand-held thermometer"},
    {"not_written", "the controller answers, but takes no offset",
     "see below which write failed and how; check the function, the addresses and who may write"},
    {"sensor_unconfirmed", "a reading jumped and nothing confirms the new value",
     "compare it with a hand-held thermometer; where it is right: thermocomp accept SENSOR"},
    {"start_unknown", "nothing tells which offset the controller was sent last: not driven",
     "give the axis a read-back (`applied`), or set the offset at the controller to zero, then: "
     "thermocomp release AXIS"},
}};

constexpr std::array<ReasonText, 13> faults{{
    {"none", "good", ""},
    {"never_read", "nothing has arrived yet", "check the bus and the device's address"},
    {"stale", "not renewed in time", "check the device; compare stale_after_s with its period"},
    {"open_circuit", "thermocouple broken", "check the thermocouple and its terminals"},
    {"short_circuit", "thermocouple shorted", "check the thermocouple's insulation"},
    {"out_of_range", "implausible value", "check type, scale and offset of the channel"},
    {"too_fast", "changed faster than the structure can", "check the contact and the shielding"},
    {"stuck", "the very same value for too long", "check the device"},
    {"no_answer", "the unit does not answer", "check its power, cable and unit number"},
    {"bad_frame", "the answer was garbled", "check shielding, termination and line settings"},
    {"device_busy", "the device was busy", "poll it less often"},
    {"device_error", "the device reports an error", "see its status register and manual"},
    {"unconfirmed", "too new, or contradicts its past, and nothing confirms it yet",
     "compare it with a hand-held thermometer; where it is right: thermocomp accept SENSOR"},
}};

template <class Table>
ReasonText find(const Table& table, std::string_view name) {
  const auto found = std::find_if(table.begin(), table.end(),
                                  [name](const ReasonText& entry) { return entry.name == name; });
  return found != table.end() ? *found : ReasonText{name, name, ""};
}

}  // namespace

ReasonText reason_text(std::string_view name) {
  return find(reasons, name);
}
ReasonText nan_text() {
  return {"out_of_range", "NaN, no number",
          "many modules send NaN for a broken wire: look at the terminals"};
}
ReasonText fault_text(std::string_view name) {
  return find(faults, name);
}

}  // namespace thermocomp::cli
