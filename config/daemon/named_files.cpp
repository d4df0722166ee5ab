#include "config/daemon/named_files.hpp"

#include <optional>

#include <sys/stat.h>
#include <system_error>

namespace thermocomp {
namespace {

namespace fs = std::filesystem;

constexpr int links_max = 40;  // as the kernel follows

/// The path with every link followed, also one to a file that is not there yet.
/// @return empty, and `why`, when that cannot be done
fs::path followed(fs::path path, std::string& why) {
  std::error_code error;
  for (int links = 0; fs::is_symlink(fs::symlink_status(path, error)); ++links) {
    if (links == links_max) {
      why = "must not be a loop of links";
      return {};
    }
    const fs::path target = fs::read_symlink(path, error);
    path = target.is_absolute() ? target : path.parent_path() / target;
  }
  fs::path result = fs::weakly_canonical(path, error);
  if (!error) return result;
  why = error == std::errc::too_many_symbolic_link_levels ? "must not lead through a loop of links"
                                                          : "cannot be reached: " + error.message();
  return {};
}

/// One file on the disk, by one of its names.
struct Place {
  const NamedFile* named;
  fs::path path;  ///< links followed
  std::optional<std::pair<dev_t, ino_t>> inode;
};

bool is_same(const Place& a, const Place& b) {
  return a.path == b.path || (a.inode && a.inode == b.inode);
}

std::string name_of(const NamedFile& file) {
  if (file.key.empty()) return "this configuration";
  const std::string& table = file.table.path();
  return table.empty() ? file.key : table + "." + file.key;
}

void check_kind(const NamedFile& file, const struct stat& status) {
  // A state file that cannot be used is moved aside by the daemon, whatever it is.
  if (file.use == FileUse::written && file.key != "state_file" && !S_ISREG(status.st_mode)) {
    file.table.problem(file.key, file.path.string(), "must be a regular file, or not be there");
  }
  if (file.use == FileUse::socket && !S_ISSOCK(status.st_mode)) {
    file.table.problem(file.key, file.path.string(), "must be a socket, or not be there");
  }
}

void add_places(const NamedFile& file, std::vector<Place>& places) {
  if (file.path.empty()) return;  // a problem already
  std::string why;
  const fs::path path = followed(file.path, why);
  if (!why.empty()) {
    if (!file.key.empty()) file.table.problem(file.key, file.path.string(), why);
    return;
  }
  const auto add = [&](const fs::path& place, bool is_itself) {
    struct stat status {};
    Place added{&file, place, std::nullopt};
    if (::stat(place.c_str(), &status) == 0) {
      added.inode = {status.st_dev, status.st_ino};
      if (is_itself) check_kind(file, status);
    }
    places.push_back(std::move(added));
  };
  add(path, true);
  for (const std::string& ending : file.endings) add(path.string() + ending, false);
}

}  // namespace

void check_named_files(const std::vector<NamedFile>& files) {
  std::vector<Place> places;
  for (const NamedFile& file : files) add_places(file, places);
  for (const Place& place : places) {
    if (place.named->use == FileUse::read) continue;
    for (const Place& other : places) {
      // A pair of written files is told once, at the later name.
      const bool is_told = other.named->use != FileUse::read && other.named >= place.named;
      if (other.named == place.named || is_told || !is_same(place, other)) continue;
      place.named->table.problem(place.named->key, place.named->path.string(),
                                 "must not be the same file as " + name_of(*other.named));
      break;
    }
  }
}

}  // namespace thermocomp
