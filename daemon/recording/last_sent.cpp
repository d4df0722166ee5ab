#include "daemon/recording/last_sent.hpp"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <stdexcept>
#include <unistd.h>

#include <linux/magic.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/vfs.h>

#include "estimator/types.hpp"

namespace thermocomp {
namespace {

constexpr std::uint64_t magic = 0x746E6573636D6874u;  ///< "thmcsent"
/// Incremented when the layout changes.
constexpr std::uint64_t format = 1;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what) {
  throw std::runtime_error("last-sent record " + file.string() + ": " + what);
}

std::uint64_t mixed(std::uint64_t hash, std::uint64_t word) noexcept {
  hash = (hash ^ word) * 0x9E3779B97F4A7C15u;
  return hash ^ (hash >> 29);
}

std::uint64_t mixed(std::uint64_t hash, const std::string& text) noexcept {
  for (const char letter : text) hash = mixed(hash, static_cast<unsigned char>(letter));
  return mixed(hash, text.size());
}

/// Boot ID. A service may be unable to read it; a folder in memory is then of the present boot.
std::string boot_of(const std::filesystem::path& file) {
  std::ifstream given("/proc/sys/kernel/random/boot_id");
  std::string id;
  if (std::getline(given, id)) return id;
  struct statfs system {};
  const auto folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  if (statfs(folder.c_str(), &system) == 0 && system.f_type == TMPFS_MAGIC) return "in memory";
  fail(file, "the boot of the system is not known, and the folder is on a disk");
}

std::uint64_t key_of(const std::filesystem::path& file, const std::string& controller,
                     const std::vector<AxisConfig>& axes) {
  std::uint64_t key = mixed(mixed(format, boot_of(file)), controller);
  for (const AxisConfig& axis : axes)
    key = mixed(mixed(key, axis.name), std::bit_cast<std::uint64_t>(axis.sign));
  return key;
}

void* map(const std::filesystem::path& file, std::size_t size) {
  const int fd = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0640);
  if (fd < 0) fail(file, std::strerror(errno));
  struct stat status {};
  const bool is_file = fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
  // Allocated now, so that the cycle's stores cannot fail for lack of space.
  const int no_room = is_file ? posix_fallocate(fd, 0, static_cast<off_t>(size)) : 0;
  void* memory = MAP_FAILED;
  if (is_file && no_room == 0)
    memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd, 0);
  const int error = no_room != 0 ? no_room : errno;
  close(fd);
  if (!is_file) fail(file, "is not a regular file");
  if (memory == MAP_FAILED) fail(file, std::strerror(error));
  return memory;
}

}  // namespace

LastSent::LastSent(const std::filesystem::path& file, const std::string& controller,
                   const std::vector<AxisConfig>& axes)
    : key_(key_of(file, controller, axes)),
      axes_(axes.size()),
      file_(static_cast<File*>(map(file, sizeof(File)))) {
  if (file_->magic == 0 && file_->format == 0) return;  // new
  if (file_->magic != magic || file_->format != format) {
    problem_ = "last-sent record " + file.string() + ": " +
               (file_->magic == magic ? "is of format " + std::to_string(file_->format) +
                                            ", this program reads format " + std::to_string(format)
                                      : "was not written by this program") +
               "; it is ignored and replaced with the first offset sent";
    return;
  }
  for (const Place& place : file_->places)
    if (place.number > now_.number && place.checksum == checksum_of(place)) now_ = place;
  for (std::size_t i = 0; i < axes_; ++i)
    if ((now_.forgotten >> i & 1u) != 0)
      before_[axes[i].name] = not_a_number;
    else if ((now_.known >> i & 1u) != 0)
      before_[axes[i].name] = now_.offset_um[i];
}

LastSent::~LastSent() {
  munmap(file_, sizeof(File));
}

void LastSent::note(const OffsetCommand& command, std::uint32_t forgotten) noexcept {
  Place next = now_;
  next.forgotten = forgotten;
  for (std::size_t i = 0; i < axes_; ++i) {
    if (command.valid[i]) next.offset_um[i] = command.offset_um[i];
    const std::uint64_t bit = std::uint64_t{1} << i;
    if (command.valid[i]) next.known |= bit;
    if ((forgotten >> i & 1u) != 0) next.known &= ~bit;
  }
  if (next.known == now_.known && next.forgotten == now_.forgotten &&
      next.offset_um == now_.offset_um)
    return;
  // Nothing has been sent yet, so the record of another format is still valid.
  if (next.number == 0 && next.known == 0 && !problem_.empty()) return;
  // Otherwise a later process with another key could read its own obsolete slot.
  if (next.number == 0) *file_ = File{magic, format, {}};
  ++next.number;
  next.checksum = checksum_of(next);
  now_ = next;
  std::memcpy(&file_->places[next.number % file_->places.size()], &next, sizeof next);
}

std::uint64_t LastSent::checksum_of(const Place& place) const noexcept {
  std::uint64_t hash = mixed(mixed(mixed(key_, place.number), place.known), place.forgotten);
  for (std::size_t i = 0; i < axes_; ++i)
    hash = mixed(hash, std::bit_cast<std::uint64_t>(place.offset_um[i]));
  return hash;
}

}  // namespace thermocomp
