#include "config/run_forms/run_text.hpp"

#include <algorithm>
#include <cstdint>

#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"

namespace thermocomp {
namespace {

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    std::size_t more = 0;
    if (lead >= 0xf0)
      more = lead < 0xf8 ? 3 : 4;
    else if (lead >= 0xe0)
      more = 2;
    else if (lead >= 0xc2)
      more = 1;
    else if (lead >= 0x80)
      return false;
    if (more > 3 || i + more >= text.size() + (more == 0 ? 1 : 0)) return false;
    for (std::size_t k = 1; k <= more; ++k)
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0) != 0x80) return false;
    i += more + 1;
  }
  return true;
}

void append_letter(std::string& text, std::uint32_t letter) {
  const auto byte = [&](std::uint32_t value) { text += static_cast<char>(value); };
  if (letter < 0x80) {
    byte(letter);
  } else if (letter < 0x800) {
    byte(0xc0 | (letter >> 6));
    byte(0x80 | (letter & 0x3f));
  } else {
    byte(0xe0 | (letter >> 12));
    byte(0x80 | ((letter >> 6) & 0x3f));
    byte(0x80 | (letter & 0x3f));
  }
}

/// Code points above 0xFFFF, which logs do not contain, become '?'.
std::string utf8_of_utf16(std::string_view bytes, bool low_first) {
  std::string text;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    const auto a = static_cast<unsigned char>(bytes[i + (low_first ? 1 : 0)]);
    const auto b = static_cast<unsigned char>(bytes[i + (low_first ? 0 : 1)]);
    const std::uint32_t letter = (std::uint32_t{a} << 8) | b;
    append_letter(text, letter >= 0xd800 && letter < 0xe000 ? std::uint32_t{'?'} : letter);
  }
  return text;
}

/// Old Macintosh lines end with a carriage return only.
std::string with_line_ends(std::string text) {
  if (text.find('\n') == std::string::npos) std::replace(text.begin(), text.end(), '\r', '\n');
  return text;
}

struct Binary {
  std::string_view begin;
  const char* rule;
};
constexpr Binary binaries[] = {
    {"PK\x03\x04", "is an Excel workbook or another archive: save its sheet as CSV"},
    {"\xD0\xCF\x11\xE0", "is an Excel workbook of the old form (.xls): save its sheet as CSV"},
    {"\x1F\x8B", "is packed: unpack it with gunzip"},
    {"SQLite format 3", "is a database; a history becomes a run file by thermocomp export"},
    {"TDSm", "is LabVIEW's TDMS: save it as LVM or CSV"},
    {"\x89HDF", "is HDF5 (MATLAB's .mat too): save its table as CSV"},
    {"MATLAB 5.0", "is a MAT file: save its table as CSV (writetable)"},
    {"MDF ", "is ASAM's MDF: export its channels as CSV"},
    {"PAR1", "is Parquet: save its table as CSV"},
    {"%PDF", "is a PDF: the table itself is needed, as CSV"}};

}  // namespace

bool is_workbook(std::string_view bytes) {
  return bytes.starts_with(binaries[0].begin);
}

RunText run_text(std::string_view bytes, const std::string& name) {
  const auto refuse = [&](const char* rule) {
    throw ConfigurationError({Problem{name, 0, "", "(binary)", rule}});
  };
  for (const Binary& binary : binaries)
    if (bytes.starts_with(binary.begin)) refuse(binary.rule);
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF"))
    return {utf8_of_utf16(bytes.substr(2), bytes.front() == '\xFF'), false};
  if (bytes.starts_with(byte_order_mark)) bytes.remove_prefix(byte_order_mark.size());
  // A logger that lost power leaves preallocated zeros.
  while (!bytes.empty() && bytes.back() == '\0') bytes.remove_suffix(1);
  if (bytes.substr(0, 4096).find('\0') != std::string_view::npos)
    refuse("is neither text nor a known form; docs/run_files.md lists them");
  if (is_utf8(bytes)) return {with_line_ends(std::string(bytes)), false};
  RunText converted{{}, true};
  converted.text.reserve(bytes.size() + bytes.size() / 8);
  for (const char c : bytes) append_letter(converted.text, static_cast<unsigned char>(c));
  return converted;
}

}  // namespace thermocomp
