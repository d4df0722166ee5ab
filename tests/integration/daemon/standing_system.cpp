// Preloaded into thermocompd by tests: blocks system calls. While the file named by
// THERMOCOMP_STANDS exists, the calls listed in THERMOCOMP_STANDING do not return for up to 6 s:
// "fsync:TEXT" and "open:TEXT" (files whose path contains TEXT), "groups".
#undef _FORTIFY_SOURCE
#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <dlfcn.h>
#include <fcntl.h>
#include <grp.h>
#include <string>
#include <unistd.h>

namespace {

template <class Function>
Function* real(Function*, const char* name) {
  auto* const found = reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
  if (found == nullptr) std::abort();
  return found;
}

/// True if `call` is listed, with a text contained in `path`.
bool is_standing(const char* call, const char* path) {
  const char* listed = std::getenv("THERMOCOMP_STANDING");
  std::string rest = listed != nullptr ? listed : "";
  for (std::size_t end = 0; !rest.empty(); rest.erase(0, end + 1)) {
    end = std::min(rest.find(','), rest.size() - 1);
    std::string each = rest.substr(0, rest.find(','));
    const std::size_t colon = each.find(':');
    const std::string text = colon == std::string::npos ? "" : each.substr(colon + 1);
    if (each.substr(0, colon) == call && std::strstr(path, text.c_str()) != nullptr) return true;
  }
  return false;
}

void stand(const char* call, const char* path) {
  const char* file = std::getenv("THERMOCOMP_STANDS");
  if (file == nullptr || !is_standing(call, path)) return;
  const timespec pause{0, 5'000'000};
  for (int i = 0; i < 1200 && ::access(file, F_OK) == 0; ++i) ::nanosleep(&pause, nullptr);
}

void stand_at_disk(int file) {
  std::array<char, 4096> path{};
  const std::string link = "/proc/self/fd/" + std::to_string(file);
  if (::readlink(link.c_str(), path.data(), path.size() - 1) > 0) stand("fsync", path.data());
}

}  // namespace

extern "C" int fsync(int file) {
  stand_at_disk(file);
  static const auto next = real(&fsync, "fsync");
  return next(file);
}

extern "C" int fdatasync(int file) {
  stand_at_disk(file);
  static const auto next = real(&fdatasync, "fdatasync");
  return next(file);
}

extern "C" int open(const char* path, int flags, ...) {
  std::va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  stand("open", path);
  static const auto next = real(&open, "open");
  return next(path, flags, mode);
}

extern "C" FILE* fopen(const char* path, const char* mode) {
  stand("open", path);
  static const auto next = real(&fopen, "fopen");
  return next(path, mode);
}

extern "C" FILE* fopen64(const char* path, const char* mode) {
  return fopen(path, mode);
}

extern "C" int getgrnam_r(const char* name, group* entry, char* text, size_t size, group** found) {
  stand("groups", "");
  static const auto next = real(&getgrnam_r, "getgrnam_r");
  return next(name, entry, text, size, found);
}
