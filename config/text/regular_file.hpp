/// Opening files that somebody else may have replaced.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace thermocomp {

/// Closes itself; -1 is none.
class FileDescriptor {
 public:
  explicit FileDescriptor(int fd = -1) noexcept : fd_(fd) {}
  ~FileDescriptor();
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  [[nodiscard]] int get() const noexcept { return fd_; }

 private:
  int fd_;
};

/// Opens a regular file and nothing else: opening a pipe waits for its other end, reading a device
/// may never end.
/// @param flags  of open(2); O_NONBLOCK and O_CLOEXEC are added
/// @throws std::runtime_error "no such file", "must be a regular file", "cannot be opened: ..."
[[nodiscard]] FileDescriptor open_regular_file(const std::filesystem::path& path, int flags);

/// All of it. @throws as above, and where it has more than `bytes_max`
[[nodiscard]] std::string read_regular_file(const std::filesystem::path& path,
                                            std::uintmax_t bytes_max);

/// For a library that opens the file itself.
/// @throws std::runtime_error "must be a regular file" where something else stands there
void require_regular_or_missing(const std::filesystem::path& path);

}  // namespace thermocomp
