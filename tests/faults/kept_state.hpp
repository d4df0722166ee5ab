/// State that survives a daemon without read-back: its real state file and last-sent record, on a
/// disk that is slow and fills up.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "chance.hpp"
#include "daemon/recording/last_sent.hpp"
#include "daemon/start_state.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "fault_schedule.hpp"
#include "machine.hpp"

namespace thermocomp::faults {

class KeptState {
 public:
  /// @param folder  used by this life only; removed at its end
  KeptState(std::filesystem::path folder, std::uint64_t seed, const FaultSchedule& schedule);
  ~KeptState();
  KeptState(const KeptState&) = delete;
  KeptState& operator=(const KeptState&) = delete;

  /// The state at the daemon's start.
  [[nodiscard]] StartState boot(const MachineShape& shape);
  [[nodiscard]] LastSent* record() noexcept { return record_.get(); }
  /// Work of the main thread: note completed writes, begin necessary ones.
  /// @return commands that report the saved state to the estimator
  /// @param is_waited_for  an axis is waiting for this report
  [[nodiscard]] std::vector<Command> note(const PersistentState& state, const MachineShape& shape,
                                          nanoseconds now, bool is_waited_for);
  /// Ends the process by a kill.
  void kill();
  void cut_power();
  /// True if the file contradicts the state for an axis: its offset is outside the corridor, or it
  /// has an offset that is no longer known.
  [[nodiscard]] bool is_behind(const PersistentState& then, const std::string& axis) const;
  /// Orderly end: the final state is saved.
  void end(const PersistentState& state);

 private:
  struct Save {
    PersistentState state;
    nanoseconds done_at{};
  };
  void begin(PersistentState state, nanoseconds now);
  void write(const PersistentState& state);

  std::filesystem::path folder_;
  Chance chance_;
  const FaultSchedule& schedule_;
  std::unique_ptr<LastSent> record_;
  PersistentState on_disk_;
  bool is_on_disk_{false};
  std::optional<Save> writing_;
  std::optional<PersistentState> waiting_;
  nanoseconds next_offsets_{};
};

}  // namespace thermocomp::faults
