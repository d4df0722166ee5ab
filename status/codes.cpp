#include "status/codes.hpp"

#include <algorithm>
#include <array>

namespace thermocomp {

namespace {

template <class Code>
struct Entry {
  Code code;
  Severity severity;
  std::string_view meaning;
  std::string_view remedy;
  std::string_view command{};
};

using enum Severity;

constexpr std::array<Entry<Mode>, 5> mode_table{{
    {Mode::starting, fault, "starting: nothing compensated yet, offsets stay", ""},
    {Mode::disabled, intended, "switched off: offsets at or on the way to zero", ""},
    {Mode::compensating, normal, "compensating", ""},
    {Mode::holding, fault, "offsets held",
     "the correction is frozen and the tool may drift from here; do not finish a precise cut"},
    {Mode::ramping_to_zero, fault, "offsets on the way to zero",
     "the correction is being removed; do not finish a precise cut"},
}};
constexpr CodeText dry_run_text{"dry_run", "dry run: nothing is written to the controller", "",
                                intended};

constexpr std::array<Entry<Reason>, reasons_count> reason_table{{
    {Reason::operator_disabled, intended, "switched off: by an operator, or never switched on yet",
     "switch it on", "thermocomp enable"},
    {Reason::controller_disabled, intended, "switched off at the controller",
     "release the switch that the configuration names as disable_signal"},
    {Reason::block_lost, fault, "an input of the model has no good sensor left",
     "repair the sensor or its bus", "thermocomp sensors"},
    {Reason::signal_lost, fault,
     "a signal of the controller is missing that the model or disable_signal needs",
     "look at what the controller reports; check its [[controller.signal]] entries"},
    {Reason::no_reference, fault, "there is no reference state yet",
     "wait until every sensor has had a value, or take the reference", "thermocomp reference"},
    {Reason::controller_offline, fault, "the controller cannot be read",
     "where it is silent, check power, cable and address; where it refuses, table and address; the "
     "offset it applied last may stay in effect",
     "thermocomp scan"},
    {Reason::not_synced, fault, "the offset that the controller applies is not known yet",
     "wait a moment; if it stays, check the read-back (`applied`) of every axis"},
    {Reason::mismatch, warning, "the controller applies another offset than the one sent",
     "compare offset and applied below; check scale, sign and bounds at the controller"},
    {Reason::cutting, normal,
     "the offset is held while the machine cuts, or where it is not known whether it cuts",
     "nothing to do during a cut; else look at the controller's cutting_signal"},
    {Reason::at_bound, warning,
     "an offset is at its bound, so that part of the displacement remains",
     "check the sensors and the reference; do not finish a precise cut. Raise offset_um_max only "
     "where the warming is real"},
    {Reason::applied_out_of_bound, fault,
     "the controller applies an offset beyond the bound that is configured here",
     "that axis is not driven; set the offset at the controller to zero and find out what set it"},
    {Reason::block_estimated, warning,
     "an input of the model has no good sensor left and is estimated",
     "compensation continues; repair the sensor", "thermocomp sensors"},
    {Reason::mismatch_latched, fault,
     "the read-back cannot result from the sent offsets: that axis is not driven",
     "compare the sent and read values below, remove the cause, then release the axis",
     "thermocomp release AXIS"},
    {Reason::no_target, fault, "the model gives no finite displacement",
     "check the reference and the model file", "thermocomp reference"},
    {Reason::outside_domain, warning, "the machine is outside the range of its model's data",
     "the offset may be wrong: record such a day with probings, then fit the model again"},
    {Reason::sensor_suspected, warning, "a sensor disagrees with its neighbours",
     "check its contact, its place and its wiring; compare it with a hand-held thermometer"},
    {Reason::not_written, fault, "the controller answers, but takes no offset",
     "see which write failed and how; check the function, the addresses and who may write"},
    {Reason::sensor_unconfirmed, fault, "a reading jumped and nothing confirms the new value",
     "compare it with a hand-held thermometer; where it is right, accept it",
     "thermocomp accept SENSOR"},
    {Reason::start_unknown, fault, "the offset last sent to the controller is unknown: not driven",
     "give the axis a read-back (`applied`), or set the offset at the controller to zero, then "
     "release the axis",
     "thermocomp release AXIS"},
}};

constexpr std::array<Entry<Fault>, faults_count> fault_table{{
    {Fault::none, normal, "good", ""},
    {Fault::never_read, fault, "nothing has arrived yet", "check the bus and the device's address"},
    {Fault::stale, fault, "not renewed in time",
     "check the device; compare stale_after_s with its period"},
    {Fault::open_circuit, fault, "sensor wire broken", "check the sensor's wire and its terminals"},
    {Fault::short_circuit, fault, "sensor wires shorted",
     "check the insulation of the sensor's wires"},
    {Fault::out_of_range, fault, "implausible value",
     "check type, scale and offset of the channel"},
    {Fault::too_fast, fault, "changed faster than the structure can",
     "check the contact and the shielding"},
    {Fault::stuck, fault, "unchanged for too long", "check the device"},
    {Fault::no_answer, fault, "the unit does not answer", "check its power, cable and unit number"},
    {Fault::bad_frame, fault, "the answer was garbled",
     "check shielding, termination and line settings"},
    {Fault::device_busy, fault, "the device was busy", "poll it less often"},
    {Fault::device_error, fault, "the device reports an error",
     "see its status register and manual"},
    {Fault::unconfirmed, fault, "jumped, and nothing confirms the new value yet",
     "compare it with a hand-held thermometer; where it is right, accept it",
     "thermocomp accept SENSOR"},
}};

template <class Table, class Code>
CodeText text_in(const Table& table, Code code) noexcept {
  for (const auto& entry : table)
    if (entry.code == code)
      return {to_string(code), entry.meaning, entry.remedy, entry.severity, entry.command};
  return {to_string(code), to_string(code), "", fault};
}

template <class Code, std::size_t count>
std::optional<Code> named_in(const std::array<Entry<Code>, count>& table,
                             std::string_view name) noexcept {
  for (const auto& entry : table)
    if (to_string(entry.code) == name) return entry.code;
  return std::nullopt;
}

}  // namespace

CodeText code_text(Reason reason) noexcept {
  return text_in(reason_table, reason);
}
CodeText code_text(Fault code) noexcept {
  return text_in(fault_table, code);
}
CodeText code_text(Mode mode, bool dry_run) noexcept {
  return dry_run && mode == Mode::compensating ? dry_run_text : text_in(mode_table, mode);
}
CodeText nan_text() noexcept {
  return {to_string(Fault::out_of_range), "NaN, no number",
          "many modules send NaN for a broken wire: look at the terminals", fault};
}

std::string with_command(std::string_view remedy, std::string_view command) {
  return std::string(remedy) + (command.empty() ? "" : ": ") + std::string(command);
}

std::optional<Reason> reason_named(std::string_view name) noexcept {
  return named_in(reason_table, name);
}
std::optional<Fault> fault_named(std::string_view name) noexcept {
  return named_in(fault_table, name);
}
std::optional<Mode> mode_named(std::string_view name) noexcept {
  return name == dry_run_text.name ? Mode::compensating : named_in(mode_table, name);
}

std::vector<Reason> members_of(std::uint32_t reasons) {
  std::vector<Reason> members;
  for (std::size_t i = 0; i < reasons_count; ++i) {
    const auto reason = static_cast<Reason>(1u << i);
    if (has_reason(reasons, reason)) members.push_back(reason);
  }
  return members;
}

std::vector<Reason> by_severity(std::uint32_t reasons) {
  std::vector<Reason> members = members_of(reasons);
  std::stable_sort(members.begin(), members.end(), [](Reason a, Reason b) {
    return code_text(a).severity > code_text(b).severity;
  });
  return members;
}

}  // namespace thermocomp
