/// What a machine sends, each batch in one transaction together with how far it goes: a batch that
/// is sent again changes nothing.
#pragma once

#include <cstdint>
#include <pqxx/connection>
#include <pqxx/transaction>
#include <string>
#include <vector>

#include "daemon/history/replay/history_means.hpp"
#include "status/event.hpp"

namespace thermocomp::fleet {

/// Of a machine's history, as the store has it.
struct Progress {
  HistoryPosition position;
  std::int64_t event_run{0};
  std::uint64_t event_number{0};
};

struct Taken {
  std::uint64_t sent{0};
  std::uint64_t refused{0};   ///< of an impossible time
  std::uint64_t repeated{0};  ///< of a time that was there already
};

class MachineRows {
 public:
  /// @param machine  nullopt: the one whose role is logged in
  /// @param history  the file's name
  /// @throws std::runtime_error: there is no such machine; pqxx::failure
  MachineRows(pqxx::connection& store, const std::string& machine, std::string history);

  [[nodiscard]] Progress progress();
  /// @throws pqxx::failure; nothing was taken then, or everything (pqxx::in_doubt_error)
  Taken send(const MeansBatch& batch);
  void send(const std::vector<RecordedEvent>& events);
  /// That the uplink is there, though nothing is new.
  /// @param damaged  parts of the history that could not be read
  void greet(std::uint64_t damaged);

 private:
  [[nodiscard]] int setup_number(pqxx::work& work, const MeansBatch& batch);

  pqxx::connection& store_;
  int machine_{0};
  std::string history_;
};

}  // namespace thermocomp::fleet
