#include "config/text/regular_file.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <stdexcept>
#include <unistd.h>

#include <sys/stat.h>

namespace thermocomp {
namespace {

constexpr const char* regular_rule = "must be a regular file";

[[noreturn]] void refuse(const std::string& rule) {
  throw std::runtime_error(rule);
}

}  // namespace

FileDescriptor::~FileDescriptor() {
  if (fd_ >= 0) close(fd_);
}

FileDescriptor open_regular_file(const std::filesystem::path& path, int flags) {
  constexpr mode_t mode = 0640;
  FileDescriptor file(open(path.c_str(), flags | O_NONBLOCK | O_CLOEXEC | O_NOCTTY, mode));
  const int error = errno;
  struct stat found {};
  // open() fails for a pipe without a reader and for a socket; stat() identifies them.
  const bool is_known =
      file.get() >= 0 ? fstat(file.get(), &found) == 0 : stat(path.c_str(), &found) == 0;
  if (is_known && !S_ISREG(found.st_mode)) refuse(regular_rule);
  if (file.get() >= 0) return file;
  if (error == ENOENT) refuse("no such file");
  refuse(std::string("cannot be opened: ") + std::strerror(error));
}

std::string read_regular_file(const std::filesystem::path& path, std::uintmax_t bytes_max) {
  const FileDescriptor file = open_regular_file(path, O_RDONLY);
  const auto refuse_size = [=] {
    constexpr std::uintmax_t bytes_per_megabyte = std::uintmax_t{1024} * 1024;
    refuse("must have at most " + std::to_string(bytes_max / bytes_per_megabyte) + " MB");
  };
  struct stat found {};
  if (fstat(file.get(), &found) == 0 && static_cast<std::uintmax_t>(found.st_size) > bytes_max)
    refuse_size();
  std::string text;
  std::string part(std::size_t{64} * 1024, '\0');
  while (true) {
    const ssize_t count = read(file.get(), part.data(), part.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) refuse(std::string("cannot be read: ") + std::strerror(errno));
    if (count == 0) return text;
    // The file may grow while it is read.
    if (text.size() + static_cast<std::size_t>(count) > bytes_max) refuse_size();
    text.append(part, 0, static_cast<std::size_t>(count));
  }
}

void require_regular_or_missing(const std::filesystem::path& path) {
  struct stat found {};
  if (stat(path.c_str(), &found) == 0 && !S_ISREG(found.st_mode)) refuse(regular_rule);
}

}  // namespace thermocomp
