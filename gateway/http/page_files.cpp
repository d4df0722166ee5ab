#include "gateway/http/page_files.hpp"

#include <array>
#include <stdexcept>
#include <utility>
#include <zlib.h>

#include <spdlog/spdlog.h>
#include <system_error>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {
namespace {

/// MIME type by file suffix; nullptr: not served.
const char* type_of(const std::filesystem::path& file) {
  constexpr std::array<std::array<const char*, 2>, 5> types{
      {{".html", "text/html; charset=utf-8"},
       {".js", "text/javascript; charset=utf-8"},
       {".css", "text/css; charset=utf-8"},
       {".json", "application/manifest+json"},
       {".svg", "image/svg+xml"}}};
  for (const auto& [suffix, type] : types)
    if (file.extension() == suffix) return type;
  return nullptr;
}

constexpr std::array<const char*, 2> chart_files{"dygraph.min.js", "dygraph.min.css"};

}  // namespace

std::string gzipped(std::string_view bytes) {
  z_stream stream{};
  constexpr int window_bits_gzip = 15 + 16;
  constexpr int memory_level = 8;
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, window_bits_gzip, memory_level,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    return "";
  std::string text(deflateBound(&stream, bytes.size()), '\0');
  // zlib does not write to its input.
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
    add("/", folder / "index.html");
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      const std::string name = entry.path().filename().string();
      if (type_of(entry.path()) != nullptr && name != "index.html") add("/" + name, entry.path());
    }
    if (!body.empty()) {
      add("/body", body);
      files_["/body"].type = type_of("body.html");
      files_["/body"].has_own_scripts = true;
    }
  } catch (const ConfigurationError& error) {
    throw std::runtime_error(std::string("the page cannot be read: ") + error.what());
  }
  for (const char* file : chart_files) {
    try {
      add(std::string("/") + file, charts / file);
    } catch (const ConfigurationError& error) {
      spdlog::warn("no charts (package libjs-dygraphs): {}", error.what());
    }
  }
}

void PageFiles::add(const std::string& path, const std::filesystem::path& file) {
  std::string bytes = read_text_file(file, HttpSettings::body_bytes_max);
  std::string gzip = gzipped(bytes);
  files_[path] = {type_of(file), std::move(bytes), std::move(gzip)};
}

const PageFile* PageFiles::find(std::string_view path) const {
  const auto found = files_.find(path);
  return found != files_.end() ? &found->second : nullptr;
}

std::filesystem::path page_folder(const std::string& program) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  return self.parent_path().parent_path() / "share/thermocomp" / program;
}

std::filesystem::path charts_folder() {
  return "/usr/share/javascript/dygraphs";
}

}  // namespace thermocomp::gateway
