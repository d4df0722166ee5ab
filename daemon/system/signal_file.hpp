/// The signals that the daemon answers to, as a file that can be polled.
#pragma once

namespace thermocomp {

class SignalFile {
 public:
  /// What came since the last call; any number of SIGHUPs count as one.
  struct Asked {
    int stop{0};  ///< SIGTERM or SIGINT, the last of them; 0: none
    bool reload{false};
  };

  /// Blocks SIGTERM, SIGINT and SIGHUP for this thread and all that it makes from now on.
  SignalFile();
  ~SignalFile();
  SignalFile(const SignalFile&) = delete;
  SignalFile& operator=(const SignalFile&) = delete;

  [[nodiscard]] int fd() const noexcept { return fd_; }
  [[nodiscard]] Asked drain() const noexcept;

 private:
  int fd_;
};

}  // namespace thermocomp
