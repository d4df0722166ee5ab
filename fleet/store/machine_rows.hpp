/// A machine's data in the store. Each batch is one transaction with its position, so repeating it
/// changes nothing.
#pragma once

#include <cstdint>
#include <optional>
#include <pqxx/connection>
#include <pqxx/transaction>
#include <string>
#include <vector>

#include "daemon/history/replay/history_means.hpp"
#include "status/event.hpp"

namespace thermocomp::fleet {

/// The store's progress in a machine's history.
struct Progress {
  HistoryPosition position;
  std::int64_t event_run{0};
  std::uint64_t event_number{0};
};

struct Taken {
  std::uint64_t sent{0};
  std::uint64_t refused{0};   ///< impossible time
  std::uint64_t repeated{0};  ///< time already present
  bool by_another{false};     ///< another sender has sent from this history since the last send()
};

class MachineRows {
 public:
  /// @param machine  empty: the one whose role is logged in
  /// @param history  name of the file
  /// @throws std::runtime_error if there is no such machine; pqxx::failure
  MachineRows(pqxx::connection& store, const std::string& machine, std::string history);

  [[nodiscard]] Progress progress();
  /// @throws pqxx::failure; then nothing was stored, or everything (pqxx::in_doubt_error)
  Taken send(const MeansBatch& batch);
  void send(const std::vector<RecordedEvent>& events);
  /// Reports a live uplink without new data.
  /// @param damaged  number of unreadable parts of the history
  void greet(std::uint64_t damaged);

 private:
  [[nodiscard]] bool is_moved(pqxx::work& work) const;
  [[nodiscard]] int setup_number(pqxx::work& work, const MeansBatch& batch);

  pqxx::connection& store_;
  int machine_{0};
  std::string history_;
  std::optional<HistoryPosition> position_;  ///< in the store; unknown before progress()
};

}  // namespace thermocomp::fleet
