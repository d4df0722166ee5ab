#include "gateway/http/page_files.hpp"

#include <array>
#include <stdexcept>
#include <utility>
#include <zlib.h>

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

std::string gzipped(std::string_view bytes) {
  z_stream stream{};
  constexpr int window_bits_gzip = 15 + 16;
  constexpr int memory_level = 8;
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, window_bits_gzip, memory_level,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    return "";
  std::string text(deflateBound(&stream, bytes.size()), '\0');
  // The library does not write into what it reads.
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(text.data());
  stream.avail_out = static_cast<uInt>(text.size());
  const int ended = deflate(&stream, Z_FINISH);
  text.resize(ended == Z_STREAM_END ? stream.total_out : 0);
  deflateEnd(&stream);
  return text;
}

PageFiles::PageFiles(const std::filesystem::path& folder, const std::filesystem::path& charts,
                     const std::filesystem::path& body) {
  try {
    for (const Place& place : page_places) add(place.path, place.type, folder / place.file);
    if (!body.empty()) {
      add("/body", "text/html; charset=utf-8", body);
      files_["/body"].has_own_scripts = true;
    }
  } catch (const ConfigurationError& error) {
    throw std::runtime_error(std::string("the page cannot be read: ") + error.what());
  }
  for (const Place& place : chart_places) {
    try {
      add(place.path, place.type, charts / place.file);
    } catch (const ConfigurationError& error) {
      spdlog::warn("no charts (package libjs-dygraphs): {}", error.what());
    }
  }
}

void PageFiles::add(const std::string& path, const std::string& type,
                    const std::filesystem::path& file) {
  constexpr std::uintmax_t bytes_max = 64 * bytes_per_MB;  // a body of many faces
  std::string bytes = read_text_file(file, bytes_max);
  std::string gzip = gzipped(bytes);
  files_[path] = {type, std::move(bytes), std::move(gzip)};
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
