#include "estimator/pipeline/mode.hpp"

namespace thermocomp {

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

}  // namespace thermocomp
