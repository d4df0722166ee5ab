#include "gateway/http/page_files.hpp"

#include <array>
#include <stdexcept>

#include <spdlog/spdlog.h>
#include <system_error>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::gateway {
namespace {

struct Place {
  const char* path;
  const char* file;
  const char* type;
};

constexpr std::array<Place, 6> page_places{
    {{"/", "index.html", "text/html; charset=utf-8"},
     {"/page.js", "page.js", "text/javascript; charset=utf-8"},
     {"/charts.js", "charts.js", "text/javascript; charset=utf-8"},
     {"/manifest.json", "manifest.json", "application/manifest+json"},
     {"/page.css", "page.css", "text/css; charset=utf-8"},
     {"/icon.svg", "icon.svg", "image/svg+xml"}}};
constexpr std::array<Place, 2> chart_places{
    {{"/dygraph.js", "dygraph.min.js", "text/javascript; charset=utf-8"},
     {"/dygraph.css", "dygraph.min.css", "text/css; charset=utf-8"}}};

}  // namespace

PageFiles::PageFiles(const std::filesystem::path& folder, const std::filesystem::path& charts) {
  for (const Place& place : page_places) {
    try {
      files_[place.path] = {place.type, read_text_file(folder / place.file)};
    } catch (const ConfigurationError& error) {
      throw std::runtime_error(std::string("the page cannot be read: ") + error.what());
    }
  }
  for (const Place& place : chart_places) {
    try {
      files_[place.path] = {place.type, read_text_file(charts / place.file)};
    } catch (const ConfigurationError& error) {
      spdlog::warn("no charts (package libjs-dygraphs): {}", error.what());
    }
  }
}

const PageFile* PageFiles::find(std::string_view path) const {
  const auto found = files_.find(path);
  return found != files_.end() ? &found->second : nullptr;
}

std::filesystem::path page_folder() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  return program.parent_path().parent_path() / "share/thermocomp/gateway";
}

std::filesystem::path charts_folder() {
  return "/usr/share/javascript/dygraphs";
}

}  // namespace thermocomp::gateway
