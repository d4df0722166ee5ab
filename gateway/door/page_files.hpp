/// The files of the page, read once at the start: a request can name nothing else.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace thermocomp::gateway {

struct PageFile {
  std::string type;  ///< of its content
  std::string bytes;
  std::string gzip;             ///< the same, compressed
  bool has_own_scripts{false};  ///< scripts stand in the page itself
};

/// @return empty where zlib has no memory
[[nodiscard]] std::string gzipped(std::string_view bytes);

class PageFiles {
 public:
  /// @param folder  of index.html, which is `/`, and of what it needs, by suffix
  /// @param charts  of dygraph.min.js and dygraph.min.css; where they are missing the page has no
  ///                charts, and says so
  /// @param body  the page of `thermocomp structure --page`; empty: none
  /// @throws std::runtime_error naming the file
  PageFiles(const std::filesystem::path& folder, const std::filesystem::path& charts,
            const std::filesystem::path& body);

  /// By the path of a request; nullptr: none.
  [[nodiscard]] const PageFile* find(std::string_view path) const;

 private:
  void add(const std::string& path, const std::filesystem::path& file);

  std::map<std::string, PageFile, std::less<>> files_;
};

/// share/thermocomp/`program` beside the folder of the programs.
[[nodiscard]] std::filesystem::path page_folder(const std::string& program);
/// Where Debian's libjs-dygraphs puts its files.
[[nodiscard]] std::filesystem::path charts_folder();

}  // namespace thermocomp::gateway
