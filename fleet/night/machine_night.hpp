/// The work of one machine's night.
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

/// A folder that goes with this.
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

/// Runs a program to its end. @param log  of its output; empty: the output is ours
/// @return its exit status, or 128 and the signal that ended it. @throws std::system_error
int run_and_wait(const std::string& program, const std::vector<std::string>& arguments,
                 const std::filesystem::path& log);

/// Runs `thermocomp-modelling`, of the program's own folder, with these arguments.
/// @return its exit status, 0 or 1. @throws std::runtime_error with its last words otherwise
int run_modelling(const std::vector<std::string>& arguments, const std::filesystem::path& log);

/// A run file of minute means and probings: time_s, temperatures, signals, outputs.
/// @return how often all outputs were probed
int write_run(pqxx::connection& store, const MachineNight& night,
              const std::filesystem::path& file);

struct NightOutcome {
  bool departs{false};
  std::string text;  ///< one line for people
};
/// Compares, and writes the result. @throws std::exception: nothing was written
NightOutcome work_off(pqxx::connection& store, const MachineNight& night);
/// That it failed, and why; the next run tries again.
void note_failure(pqxx::connection& store, const MachineNight& night, const std::string& why);

/// The series of a type, of each machine's sisters and of its own past, from the seven nights
/// before `night`, where those of a type are older than a week. A machine's own past is made once.
void make_series(pqxx::connection& store, const std::string& type, const std::string& night);

}  // namespace thermocomp::fleet
