/// A thread for calls that may block: disk, name service, pipe.
#pragma once

#include <chrono>
#include <functional>
#include <memory>

namespace thermocomp {

/// Runs one job at a time; start() never blocks. A job cannot be interrupted and may run on until
/// the process ends, so it must own everything it uses. A job must not throw.
class SideThread {
 public:
  /// @param name  shown by the system, at most 15 characters
  /// @throws std::system_error when no thread can be created
  explicit SideThread(const char* name);
  /// Waits at most `patience` for the running job.
  ~SideThread();
  SideThread(const SideThread&) = delete;
  SideThread& operator=(const SideThread&) = delete;

  static constexpr std::chrono::seconds patience{2};

  /// @pre !is_busy()
  void start(std::function<void()> job);
  /// False also makes the job's writes visible to the caller.
  [[nodiscard]] bool is_busy() const;
  /// Waits for the job to end. @return true if it has ended
  bool wait(std::chrono::steady_clock::duration at_most) const;

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
};

}  // namespace thermocomp
