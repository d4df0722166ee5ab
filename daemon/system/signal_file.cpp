#include "daemon/system/signal_file.hpp"

#include <csignal>
#include <cstdint>
#include <initializer_list>
#include <unistd.h>

#include <sys/signalfd.h>

namespace thermocomp {

SignalFile::SignalFile() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, signal);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  fd_ = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

SignalFile::~SignalFile() {
  close(fd_);
}

SignalFile::Asked SignalFile::drain() const noexcept {
  Asked asked;
  signalfd_siginfo info{};
  while (read(fd_, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) {
    if (info.ssi_signo == static_cast<std::uint32_t>(SIGHUP))
      asked.reload = true;
    else
      asked.stop = static_cast<int>(info.ssi_signo);
  }
  return asked;
}

}  // namespace thermocomp
