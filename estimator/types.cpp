#include "estimator/types.hpp"

#include <cstdio>
#include <cstdlib>
#include <sstream>

#include "estimator/checks.hpp"

namespace thermocomp {

std::string_view to_string(Fault fault) noexcept {
  switch (fault) {
    case Fault::none:
      return "none";
    case Fault::never_read:
      return "never_read";
    case Fault::stale:
      return "stale";
    case Fault::open_circuit:
      return "open_circuit";
    case Fault::short_circuit:
      return "short_circuit";
    case Fault::out_of_range:
      return "out_of_range";
    case Fault::too_fast:
      return "too_fast";
    case Fault::stuck:
      return "stuck";
    case Fault::no_answer:
      return "no_answer";
    case Fault::bad_frame:
      return "bad_frame";
    case Fault::device_busy:
      return "device_busy";
    case Fault::device_error:
      return "device_error";
    case Fault::unconfirmed:
      return "unconfirmed";
  }
  return "unknown";
}

std::string_view to_string(CommandKind kind) noexcept {
  switch (kind) {
    case CommandKind::enable:
      return "enable";
    case CommandKind::disable:
      return "disable";
    case CommandKind::reference:
      return "reference";
    case CommandKind::measured:
      return "measured";
    case CommandKind::cycle_end:
      return "cycle_end";
    case CommandKind::prove:
      return "prove";
    case CommandKind::stop:
      return "stop";
    case CommandKind::release:
      return "release";
    case CommandKind::accept:
      return "accept";
    case CommandKind::saved:
      return "saved";
  }
  return "unknown";
}

std::string_view to_string(MeasuredSource source) noexcept {
  switch (source) {
    case MeasuredSource::probe:
      return "probe";
    case MeasuredSource::part:
      return "part";
    case MeasuredSource::wear:
      return "wear";
  }
  return "unknown";
}

std::string_view to_string(StartEvidence evidence) noexcept {
  switch (evidence) {
    case StartEvidence::unknown:
      return "unknown";
    case StartEvidence::read_back:
      return "read_back";
    case StartEvidence::registers:
      return "registers";
    case StartEvidence::record:
      return "record";
    case StartEvidence::corridor:
      return "corridor";
    case StartEvidence::released:
      return "released";
  }
  return "unknown";
}

std::string_view to_string(Mode mode) noexcept {
  switch (mode) {
    case Mode::starting:
      return "starting";
    case Mode::disabled:
      return "disabled";
    case Mode::compensating:
      return "compensating";
    case Mode::holding:
      return "holding";
    case Mode::ramping_to_zero:
      return "ramping_to_zero";
  }
  return "unknown";
}

std::string_view to_string(Reason reason) noexcept {
  switch (reason) {
    case Reason::operator_disabled:
      return "operator_disabled";
    case Reason::controller_disabled:
      return "controller_disabled";
    case Reason::block_lost:
      return "block_lost";
    case Reason::signal_lost:
      return "signal_lost";
    case Reason::no_reference:
      return "no_reference";
    case Reason::controller_offline:
      return "controller_offline";
    case Reason::not_synced:
      return "not_synced";
    case Reason::mismatch:
      return "mismatch";
    case Reason::cutting:
      return "cutting";
    case Reason::at_bound:
      return "at_bound";
    case Reason::applied_out_of_bound:
      return "applied_out_of_bound";
    case Reason::block_estimated:
      return "block_estimated";
    case Reason::mismatch_latched:
      return "mismatch_latched";
    case Reason::no_target:
      return "no_target";
    case Reason::outside_domain:
      return "outside_domain";
    case Reason::sensor_suspected:
      return "sensor_suspected";
    case Reason::not_written:
      return "not_written";
    case Reason::sensor_unconfirmed:
      return "sensor_unconfirmed";
    case Reason::start_unknown:
      return "start_unknown";
  }
  return "unknown";
}

InvalidValue::InvalidValue(std::string key, std::string value, std::string rule)
    : std::invalid_argument(key + " = " + value + ": " + rule),
      key_(std::move(key)),
      value_(std::move(value)),
      rule_(std::move(rule)) {}

void require(bool holds, const char* key, double value, const char* rule) {
  if (holds) return;
  std::ostringstream text;
  text << value;
  throw InvalidValue(key, text.str(), rule);
}

void require_in(double value, const char* key, double min, double max, bool min_excluded) {
  if ((min_excluded ? value > min : value >= min) && value <= max) return;
  std::ostringstream rule;
  rule << "must be in " << (min_excluded ? '(' : '[') << min << ", " << max << ']';
  std::string text = rule.str();
  if (const auto at = text.find("e+0"); at != std::string::npos) text.erase(at + 1, 2);  // 1e6
  require(false, key, value, text.c_str());
}

void abort_with(const char* expression, const char* file, int line) noexcept {
  std::fprintf(stderr, "thermocomp: broken promise: %s (%s:%d)\n", expression, file, line);
  std::abort();
}

}  // namespace thermocomp
