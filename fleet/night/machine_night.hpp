/// Evaluation of one machine's night.
#pragma once

#include <filesystem>
#include <pqxx/connection>
#include <string>
#include <vector>

namespace thermocomp::fleet {

struct MachineNight {
  int machine{0};
  std::string name;
  std::string type;
  std::string night;  ///< date: 24 h from 0:00 UTC
};

/// Temporary folder; the destructor removes it.
class WorkFolder {
 public:
  WorkFolder();
  ~WorkFolder();
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  [[nodiscard]] std::string operator/(const std::string& name) const {
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
};

/// Runs a program to its end. @param log  receives its output; empty: the output is inherited
/// @return its exit status, or 128 plus the signal that ended it. @throws std::system_error
int run_and_wait(const std::string& program, const std::vector<std::string>& arguments,
                 const std::filesystem::path& log);

/// Runs `thermocomp-modelling` from the program's own folder.
/// @return its exit status, 0 or 1. @throws std::runtime_error with its last output otherwise
int run_modelling(const std::vector<std::string>& arguments, const std::filesystem::path& log);

/// Writes a run file of minute means and probings: time_s, temperatures, signals, outputs.
/// @return number of probings of all outputs
int write_run(pqxx::connection& store, const MachineNight& night,
              const std::filesystem::path& file);

struct NightOutcome {
  bool departs{false};
  std::string text;  ///< one line
};
/// Compares the night and stores the result. @throws std::exception: nothing was stored
NightOutcome evaluate_night(pqxx::connection& store, const MachineNight& night);
/// Stores the failure with its reason; the next run retries.
void note_failure(pqxx::connection& store, const MachineNight& night, const std::string& why);

/// If the type's series is older than a week, makes the series of the type and of each machine's
/// sisters from the seven nights before `night`. The series of a machine's own past is made once.
void make_series(pqxx::connection& store, const std::string& type, const std::string& night);

}  // namespace thermocomp::fleet
