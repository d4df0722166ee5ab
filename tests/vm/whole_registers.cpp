/// Preloaded into linux.uml, which saves the first 2696 bytes of a process's vector registers,
/// enough for AVX-512. With AMX tiles they are 11 kB, and the host's kernel gives out the first
/// bytes but accepts only all of them: the guest dies before its first program. This library
/// restores all bytes: those saved by the guest, the rest unchanged. No program of the guest has
/// tiles, since none requests them from the host.
#include <array>
#include <cerrno>
#include <cstdarg>
#include <cstddef>
#include <cstring>
#include <dlfcn.h>
#include <elf.h>

#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

namespace {

using Ptrace = long (*)(__ptrace_request, ...);
const auto ptrace_of_libc = reinterpret_cast<Ptrace>(dlsym(RTLD_NEXT, "ptrace"));

// The guest's kernel has one thread, and small stacks.
alignas(64) std::array<std::byte, std::size_t{64} * 1024> whole;

long set_with_the_rest_as_it_is(pid_t process, void* set, const iovec& kept) {
  iovec all{whole.data(), whole.size()};
  const long got = ptrace_of_libc(PTRACE_GETREGSET, process, set, &all);
  if (got != 0) return got;
  std::memcpy(whole.data(), kept.iov_base, kept.iov_len);
  return ptrace_of_libc(PTRACE_SETREGSET, process, set, &all);
}

}  // namespace

extern "C" long ptrace(__ptrace_request request, ...) noexcept {
  std::va_list more;
  va_start(more, request);
  const pid_t process = va_arg(more, pid_t);
  void* const address = va_arg(more, void*);
  void* const data = va_arg(more, void*);
  va_end(more);
  const long answer = ptrace_of_libc(request, process, address, data);
  if (answer == 0 || errno != EFAULT || request != PTRACE_SETREGSET ||
      address != reinterpret_cast<void*>(NT_X86_XSTATE))
    return answer;
  return set_with_the_rest_as_it_is(process, address, *static_cast<const iovec*>(data));
}
