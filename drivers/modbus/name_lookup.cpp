#include "drivers/modbus/name_lookup.hpp"

#include <atomic>
#include <cstring>
#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <netdb.h>
#include <sys/eventfd.h>

#include "drivers/bus_thread.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {

struct NameLookup::State {
  std::string host;
  std::string port;
  int done_fd{-1};
  std::atomic<bool> done{false};
  int error{EAI_AGAIN};
  SocketAddress address;

  State(std::string host_given, int port_given)
      : host(std::move(host_given)),
        port(std::to_string(port_given)),
        done_fd(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    if (done_fd >= 0) ::close(done_fd);
  }

  void look_up(int flags) {
    addrinfo hints{};
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = flags;
    addrinfo* found = nullptr;
    error = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
    if (error == 0 && found != nullptr) {
      std::memcpy(&address.storage, found->ai_addr, found->ai_addrlen);
      address.length = found->ai_addrlen;
    }
    if (found != nullptr) ::freeaddrinfo(found);
  }

  void finish() noexcept {
    done.store(true, std::memory_order_release);
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(done_fd, &one, sizeof one);
  }
};

namespace {

/// A thread nobody waits for, deaf to signals, with a stack sized on purpose.
bool run_detached(void* (*body)(void*), void* argument) noexcept {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, 2 * BusThread::stack_bytes);
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  pthread_t thread;
  const int error = pthread_create(&thread, &attributes, body, argument);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&attributes);
  return error == 0;
}

}  // namespace

NameLookup::NameLookup(const std::string& host, int port)
    : state_(std::make_shared<State>(host, port)) {
  state_->look_up(AI_NUMERICHOST | AI_NUMERICSERV);
  if (state_->error == 0) {
    state_->finish();
    return;
  }
  auto* shared = new std::shared_ptr<State>(state_);
  const bool started = run_detached(
      [](void* argument) -> void* {
        const std::unique_ptr<std::shared_ptr<State>> state(
            static_cast<std::shared_ptr<State>*>(argument));
        (*state)->look_up(AI_NUMERICSERV);
        (*state)->finish();
        return nullptr;
      },
      shared);
  if (started) return;
  delete shared;
  state_->finish();
}

NameLookup::~NameLookup() = default;

int NameLookup::done_fd() const noexcept {
  return state_->done_fd;
}

bool NameLookup::done() const noexcept {
  return state_->done.load(std::memory_order_acquire);
}

std::optional<SocketAddress> NameLookup::result(std::string& error) const {
  THERMOCOMP_ENSURE(done());  // also what makes the other thread's result visible here
  if (state_->error == 0) return state_->address;
  error = state_->host + ": " + ::gai_strerror(state_->error);
  return std::nullopt;
}

}  // namespace thermocomp
