#include "daemon/cycle/real_time_thread.hpp"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <malloc.h>
#include <sched.h>

#include <sys/mman.h>

namespace thermocomp {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::size_t stack_bytes = 2048 * 1024;  // the sanitizers' frames are larger
#else
constexpr std::size_t stack_bytes = std::size_t{256} * 1024;
#endif

/// Touches the stack once, to avoid page faults in the cycle.
void __attribute__((noinline)) touch_stack() noexcept {
  constexpr std::size_t depth_bytes = std::size_t{96} * 1024;
  char stack[depth_bytes];
  std::memset(stack, 0, sizeof stack);
  // Keeps the compiler from removing the buffer.
  asm volatile("" : : "r"(stack) : "memory");
}

}  // namespace

std::string lock_memory() {
  // One arena, no trimming, no mmap(): allocated memory is never returned.
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  // MCL_ONFAULT locks pages when they are touched, so that unused library pages need no memory. The
  // cycle touches all of its memory before the daemon reports ready.
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return {};
  return std::string("memory is not locked: ") + std::strerror(errno) +
         " (needs CAP_IPC_LOCK or a larger LimitMEMLOCK)";
}

std::string RealTimeThread::start(const RealTimeThreadConfig& config, std::function<void()> body) {
  body_ = std::move(body);
  std::string warning;
  int error = create(config, true);
  if (error == EPERM) {
    warning =
        "the cycle runs without SCHED_FIFO: not permitted (needs CAP_SYS_NICE or LimitRTPRIO)";
    error = create(config, false);
  }
  if (error != 0)
    throw RealTimeError(std::string("cannot start the cycle's thread: ") + std::strerror(error));
  running_ = true;
  return warning;
}

int RealTimeThread::create(const RealTimeThreadConfig& config, bool fifo) {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_bytes);
  if (fifo) {
    sched_param parameters{};
    parameters.sched_priority = config.priority;
    pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
    pthread_attr_setschedparam(&attributes, &parameters);
  }
  int error = 0;
  if (config.cpu >= 0) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(static_cast<unsigned>(config.cpu), &cpus);
    error = pthread_attr_setaffinity_np(&attributes, sizeof cpus, &cpus);
  }
  // A thread inherits the signal mask of its creator; main handles all signals.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  if (error == 0) error = pthread_create(&thread_, &attributes, &RealTimeThread::enter, this);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&attributes);
  return error;
}

void* RealTimeThread::enter(void* self) noexcept {
  pthread_setname_np(pthread_self(), "cycle");
  touch_stack();
  auto* thread = static_cast<RealTimeThread*>(self);
  thread->body_();
  thread->ended_.release();
  return nullptr;
}

void RealTimeThread::join() noexcept {
  if (!running_) return;
  pthread_join(thread_, nullptr);
  running_ = false;
}

bool RealTimeThread::join_within(std::chrono::seconds patience) noexcept {
  if (!running_) return true;
  if (!ended_.try_acquire_for(patience)) return false;
  join();
  return true;
}

}  // namespace thermocomp
