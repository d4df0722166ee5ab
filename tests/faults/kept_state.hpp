/// What outlives a daemon whose controller shows nothing: its real state file and last-sent record,
/// on a disk that takes its time and fills up.
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
  /// @param folder  of this life alone; removed at its end
  KeptState(std::filesystem::path folder, std::uint64_t seed, const FaultSchedule& schedule);
  ~KeptState();
  KeptState(const KeptState&) = delete;
  KeptState& operator=(const KeptState&) = delete;

  /// What the daemon starts with.
  [[nodiscard]] StartState boot(const MachineShape& shape);
  [[nodiscard]] LastSent* record() noexcept { return record_.get(); }
  /// Main's turn: what has been written, and what must be.
  /// @return the commands that tell the estimator what is on disk
  /// @param is_waited_for  an axis would go on if it were told
  [[nodiscard]] std::vector<Command> note(const PersistentState& state, const MachineShape& shape,
                                          nanoseconds now, bool is_waited_for);
  /// The process ends: killed, or with the system, which leaves the file as it was flushed last and
  /// nothing of the record.
  void kill();
  void cut_power();
  /// Whether the file says something else of an axis than the state then: another offset than its
  /// corridor allows, or an offset that is not known any more.
  [[nodiscard]] bool is_behind(const PersistentState& then, const std::string& axis) const;
  /// In order: what the state is at the end is saved.
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
