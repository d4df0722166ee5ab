/// Files of the page, read once at start-up: no request can name another file.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace thermocomp::gateway {

struct PageFile {
  std::string type;  ///< MIME type
  std::string bytes;
  std::string gzip;             ///< `bytes`, compressed
  bool has_own_scripts{false};  ///< inline scripts
};

/// @return empty if zlib fails
[[nodiscard]] std::string gzipped(std::string_view bytes);

class PageFiles {
 public:
  /// @param folder  index.html, served as `/`, and the other files of the page
  /// @param charts  folder of dygraph.min.js and dygraph.min.css; without them the page has no
  ///                charts and reports it
  /// @param body  page of `thermocomp structure --page`; empty: none
  /// @throws std::runtime_error naming the file
  PageFiles(const std::filesystem::path& folder, const std::filesystem::path& charts,
            const std::filesystem::path& body);

  /// @param path  of a request
  /// @return nullptr: no such file
  [[nodiscard]] const PageFile* find(std::string_view path) const;

 private:
  void add(const std::string& path, const std::filesystem::path& file);

  std::map<std::string, PageFile, std::less<>> files_;
};

/// share/thermocomp/`program` next to the folder of the programs.
[[nodiscard]] std::filesystem::path page_folder(const std::string& program);
/// Folder of Debian's libjs-dygraphs.
[[nodiscard]] std::filesystem::path charts_folder();

}  // namespace thermocomp::gateway
