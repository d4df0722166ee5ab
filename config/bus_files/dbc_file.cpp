#include "config/bus_files/dbc_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "config/bus_files/dbc_scanner.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

constexpr std::uint32_t extended_flag = 0x80000000u;
constexpr std::uint32_t message_id_max = 0x7FF;
constexpr std::uint32_t extended_id_max = 0x1FFFFFFF;
constexpr std::uint64_t message_bytes_max = 1785;  // of a J1939 transport, the longest in use
constexpr std::size_t classic_bytes_max = 8;
constexpr std::size_t message_signals_max = 4096;  // per message
constexpr std::string_view no_message = "VECTOR__INDEPENDENT_SIG_MSG";
constexpr std::string_view frame_format = "VFrameFormat";
constexpr std::string_view cycle_time = "GenMsgCycleTime";
constexpr std::string_view long_signal = "SystemSignalLongSymbol";
constexpr std::string_view long_message = "SystemMessageLongSymbol";

/// Skipped statements; each ends with a semicolon.
constexpr std::array<std::string_view, 24> passed_over{
    "VAL_TABLE_",    "BO_TX_BU_",        "EV_",         "ENVVAR_DATA_",
    "EV_DATA_",      "SGTYPE_",          "SGTYPE_VAL_", "SIG_GROUP_",
    "CM_",           "BA_DEF_REL_",      "BA_REL_",     "BA_DEF_SGTYPE_",
    "BA_SGTYPE_",    "BA_DEF_DEF_REL_",  "BU_SG_REL_",  "BU_EV_REL_",
    "BU_BO_REL_",    "CAT_DEF_",         "CAT_",        "FILTER",
    "SIG_TYPE_REF_", "SIGTYPE_VALTYPE_", "NS_DESC_",    "SIG_TYPE_"};
constexpr std::array<std::string_view, 11> understood{
    "VERSION",      "NS_",         "BS_",     "BU_", "BO_", "SG_",
    "SIG_VALTYPE_", "SG_MUL_VAL_", "BA_DEF_", "BA_", "VAL_"};

bool is_keyword(std::string_view word) {
  const auto in = [word](const auto& list) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  return word == "BA_DEF_DEF_" || in(passed_over) || in(understood);
}

/// Multiplexing of a signal, from its own line.
struct Multiplexing {
  bool selects{false};                ///< M
  std::optional<std::uint64_t> page;  ///< number n of mN
};

struct Draft {
  DbcMessage message;
  std::vector<Multiplexing> multiplexing;  ///< one per signal
};

/// A statement about a message or signal defined elsewhere in the file.
struct Remark {
  int line{0};
  std::uint32_t message{0};
  std::string signal;
};
struct FloatRemark : Remark {
  std::uint64_t type{0};
};
struct PageRemark : Remark {
  std::string selector;
  std::vector<CanSelector::Pages> pages;
};
struct FormatRemark : Remark {
  std::uint64_t index{0};
  std::string format;  ///< if not empty, replaces the index
};
struct NameRemark : Remark {
  std::string name;
};
struct ValueRemark : Remark {
  std::vector<std::pair<std::int64_t, std::string>> names;
};

/// The bits of an identifier that define a J1939 group: page, format and, for a broadcast, group
/// extension; without priority, sender and destination.
std::uint32_t group_mask(std::uint32_t id) {
  constexpr std::uint32_t first_broadcast = 0xF0;
  return ((id >> 16) & 0xFFu) < first_broadcast ? 0x03FF0000u : 0x03FFFF00u;
}

/// Message and signal that a flaw concerns.
struct About {
  std::string message;
  std::string signal;
};
using Keys = std::vector<std::string_view>;

/// Parses "m3", "M", "m3M".
std::optional<Multiplexing> multiplexing_of(std::string_view word) {
  Multiplexing result;
  if (word.starts_with('m')) {
    word.remove_prefix(1);
    const std::size_t digits = std::min(word.find_first_not_of("0123456789"), word.size());
    if (digits == 0 || digits > 18) return std::nullopt;
    std::uint64_t page = 0;
    for (const char digit : word.substr(0, digits)) {
      page = 10 * page + static_cast<std::uint64_t>(digit - '0');
    }
    result.page = page;
    word.remove_prefix(digits);
  }
  if (word == "M") {
    result.selects = true;
  } else if (!word.empty()) {
    return std::nullopt;
  }
  return result;
}

/// First byte after the signal, counted from the frame's start.
std::uint64_t end_byte(const CanSignal& place) {
  const int first = place.byte_order == ByteOrder::little_endian
                        ? place.start_bit
                        : place.start_bit / 8 * 8 + (7 - place.start_bit % 8);
  return static_cast<std::uint64_t>(first + place.length_bits + 7) / 8;
}

class DbcReader {
 public:
  DbcReader(std::string_view text, std::string name)
      : scan_(text.substr(text.starts_with(byte_order_mark) ? byte_order_mark.size() : 0)),
        name_(std::move(name)) {}

  DbcFile read() {
    while (!scan_.at_end()) {
      const int line = scan_.line();
      about_ = {};
      try {
        read_statement();
      } catch (const DbcSyntaxError& error) {
        flaw(error.line, "", error.found, error.rule, about_);
        to_next_statement(line);
      }
      if (file_.flaws.size() < flaws_max) continue;
      flaw(line, "", "", "has more than 1000 flaws before this line; the rest is not read", {});
      drafts_.clear();
      return std::move(file_);
    }
    resolve();
    for (Draft& draft : drafts_) {
      if (draft.message.name == no_message) continue;
      file_.messages.push_back(std::move(draft.message));
    }
    return std::move(file_);
  }

 private:
  void flaw(int line, std::string key, std::string value, std::string rule, About about,
            Keys keys = {}) {
    if (value.empty()) std::swap(key, value);  // the attribute of a name as a whole
    flawed_.emplace(about.message, about.signal);
    file_.flaws.push_back({{name_, line, std::move(key), std::move(value), std::move(rule)},
                           std::move(about.message),
                           std::move(about.signal),
                           std::move(keys)});
  }

  /// Skips to the next keyword at the start of a line after the broken statement.
  void to_next_statement(int line) {
    while (!scan_.at_end() &&
           !(scan_.line() != line && scan_.begins_line() && is_keyword(scan_.next_word()))) {
      scan_.skip_line();
    }
  }

  void read_statement() {
    const int line = scan_.line();
    const std::string_view keyword = scan_.next_word();
    if (!is_keyword(keyword)) scan_.fail("must be a keyword of DBC files such as BO_");
    scan_.word("a keyword");
    if (keyword != "BO_" && keyword != "SG_") in_message_ = false;
    if (keyword == "VERSION") {
      scan_.text("the version");
    } else if (keyword == "NS_") {
      read_new_symbols();
    } else if (keyword == "BS_") {
      read_bit_timing();
    } else if (keyword == "BU_") {
      scan_.expect(':');
      while (!scan_.next_name().empty() && !is_keyword(scan_.next_word())) scan_.name("a node");
    } else if (keyword == "BO_") {
      read_message(line);
    } else if (keyword == "SG_") {
      read_signal(line);
    } else if (keyword == "SIG_VALTYPE_") {
      read_value_type(line);
    } else if (keyword == "SG_MUL_VAL_") {
      read_pages(line);
    } else if (keyword == "VAL_") {
      read_value_names(line);
    } else if (keyword == "BA_DEF_") {
      read_attribute_definition();
    } else if (keyword == "BA_DEF_DEF_") {
      read_attribute_default(line);
    } else if (keyword == "BA_") {
      read_attribute(line);
    } else {
      scan_.skip_statement();
    }
  }

  void read_new_symbols() {
    scan_.expect(':');
    // The list contains keywords; the next section is the first word with a colon.
    while (scan_.next_word() != "BS_" && scan_.next_word() != "BU_") scan_.word("BS_");
  }

  void read_bit_timing() {
    scan_.expect(':');
    if (!scan_.next_word().empty() || scan_.at_end()) return;
    scan_.integer("a bit rate", UINT32_MAX);
    scan_.expect(':');
    scan_.integer("a timing register", UINT32_MAX);
    scan_.expect(',');
    scan_.integer("a timing register", UINT32_MAX);
  }

  void read_message(int line) {
    in_message_ = in_broken_message_ = true;
    Draft draft;
    DbcMessage& message = draft.message;
    message.line = line;
    const auto id = static_cast<std::uint32_t>(scan_.integer("a message's number", UINT32_MAX));
    message.name = about_.message = scan_.name("a message's name");
    scan_.expect(':');
    message.bytes = scan_.integer("a number of bytes", message_bytes_max);
    scan_.name("a sender");
    message.extended = (id & extended_flag) != 0;
    message.id = id & ~extended_flag;
    if (message.name != no_message) {
      if (message.id > (message.extended ? extended_id_max : message_id_max)) {
        const Keys keys = message.id > extended_id_max ? Keys{"id"} : Keys{"extended_id", "id"};
        flaw(line, message.name, std::to_string(id),
             "must be a number of 11 bits, or one of 29 bits with bit 31 set", about_, keys);
        message.extended = true;  // too large for 11 bits
      }
      if (!names_.insert(message.name).second) {
        flaw(line, message.name, "", "is the name of two messages", about_, {"id"});
      }
    }
    if (!by_id_.emplace(id, drafts_.size()).second) {
      flaw(line, message.name, std::to_string(id), "is the number of two messages", about_, {"id"});
    }
    drafts_.push_back(std::move(draft));
    in_broken_message_ = false;
    signal_names_.clear();
  }

  void read_signal(int line) {
    if (!in_message_) {
      throw DbcSyntaxError{line, "SG_", "must follow a message (BO_)"};
    }
    if (in_broken_message_) return scan_.skip_line();
    Draft& draft = drafts_.back();
    about_.message = draft.message.name;
    if (draft.message.signals.size() == message_signals_max) {
      throw DbcSyntaxError{line, "SG_", "a message must have at most 4096 signals"};
    }
    DbcSignal signal;
    signal.line = line;
    signal.name = about_.signal = scan_.name("a signal's name");
    Multiplexing multiplexing;
    if (!scan_.next_is(':')) {
      const auto found = multiplexing_of(scan_.next_word());
      if (!found) scan_.fail("must be ':', M, mN or mNM with a number N");
      multiplexing = *found;
      scan_.word("a multiplexing");
    }
    scan_.expect(':');
    const bool has_scale = read_place(signal);
    signal.unit = scan_.text("a unit");
    read_receivers();
    signal.place.id = draft.message.id;
    signal.place.extended_id = draft.message.extended;
    check_signal(draft.message, signal, has_scale);
    draft.message.signals.push_back(std::move(signal));
    draft.multiplexing.push_back(multiplexing);
  }

  /// Parses `start|length@order sign (factor,offset) [min|max]`.
  /// @return whether the factor is valid
  bool read_place(DbcSignal& signal) {
    CanSignal& place = signal.place;
    place.start_bit = static_cast<int>(scan_.integer("a start bit", 8 * message_bytes_max));
    scan_.expect('|');
    place.length_bits = static_cast<int>(scan_.integer("a number of bits", 8 * message_bytes_max));
    scan_.expect('@');
    const std::uint64_t order = scan_.integer("1 (Intel) or 0 (Motorola)", 1);
    place.byte_order = order == 1 ? ByteOrder::little_endian : ByteOrder::big_endian;
    place.is_signed = scan_.accept('-');
    if (!place.is_signed) scan_.expect('+');
    scan_.expect('(');
    place.scale = scan_.real("a factor");
    scan_.expect(',');
    place.offset = scan_.real("an offset");
    scan_.expect(')');
    scan_.expect('[');
    signal.min = scan_.accept_real().value_or(0.0);
    signal.max = scan_.accept('|') ? scan_.accept_real().value_or(signal.min) : signal.min;
    scan_.skip_behind(']');
    return place.scale != 0.0;
  }

  void read_receivers() {
    if (scan_.next_name().empty() || is_keyword(scan_.next_word())) return;
    do {
      scan_.name("a receiver");
    } while (scan_.accept(','));
  }

  void check_signal(const DbcMessage& message, DbcSignal& signal, bool has_scale) {
    if (!signal_names_.insert(signal.name).second) {
      flaw(signal.line, signal.name, "", "is the name of two signals of " + message.name, about_);
    }
    if (!has_scale) {
      flaw(signal.line, signal.name, "0", "the factor must not be 0", about_, {"scale"});
      signal.place.scale = 1.0;
    }
    if (message.name == no_message) return;
    const int length = signal.place.length_bits;
    if (length < 1 || (length > 64 && message.bytes <= 64)) {
      flaw(signal.line, signal.name, std::to_string(length), "must have 1 to 64 bits", about_,
           {"length_bits"});
    } else if (end_byte(signal.place) > message.bytes) {
      flaw(signal.line, signal.name,
           std::to_string(signal.place.start_bit) + "|" + std::to_string(length),
           "must end within the " + std::to_string(message.bytes) + " bytes of " + message.name,
           about_, {"start_bit", "length_bits"});
    }
  }

  // -------------------------------------------------------------- attributes and references

  Remark read_remark(int line) {
    Remark remark;
    remark.line = line;
    remark.message = static_cast<std::uint32_t>(scan_.integer("a message's number", UINT32_MAX));
    if (const auto found = by_id_.find(remark.message); found != by_id_.end()) {
      about_.message = drafts_[found->second].message.name;
    }
    return remark;
  }

  Remark read_signal_remark(int line) {
    Remark remark = read_remark(line);
    remark.signal = about_.signal = scan_.name("a signal's name");
    return remark;
  }

  void read_value_type(int line) {
    FloatRemark remark{read_signal_remark(line), 0};
    static_cast<void>(scan_.accept(':'));
    remark.type = scan_.integer("0 (whole number), 1 (float) or 2 (double)", 2);
    scan_.expect(';');
    floats_.push_back(std::move(remark));
  }

  void read_pages(int line) {
    PageRemark remark{read_signal_remark(line), {}, {}};
    remark.selector = scan_.name("a multiplexor's name");
    do {
      CanSelector::Pages pages;
      pages.first = scan_.integer("the first number of a range", UINT64_MAX);
      scan_.expect('-');
      pages.last = scan_.integer("the last number of a range", UINT64_MAX);
      if (pages.last < pages.first) {
        throw DbcSyntaxError{line, remark.signal, "a range must not end before it begins"};
      }
      remark.pages.push_back(pages);
    } while (scan_.accept(','));
    scan_.expect(';');
    pages_.push_back(std::move(remark));
  }

  void read_value_names(int line) {
    constexpr std::size_t names_max = 4096;
    // The statement names the values of an environment variable.
    if (!scan_.next_word().empty()) return scan_.skip_statement();
    ValueRemark remark{read_signal_remark(line), {}};
    std::optional<double> code;
    while (remark.names.size() < names_max && (code = scan_.accept_real()) && scan_.next_is('"')) {
      std::string name = printable(scan_.text("a value's name"));
      if (*code == std::floor(*code) && std::abs(*code) < 0x1p53)
        remark.names.emplace_back(static_cast<std::int64_t>(*code), std::move(name));
    }
    scan_.skip_statement();
    value_names_.push_back(std::move(remark));
  }

  void read_attribute_definition() {
    const bool of_message = scan_.next_word() == "BO_";
    if (!scan_.next_word().empty()) scan_.word("an object");
    const std::string attribute = scan_.text("an attribute's name");
    if (attribute != frame_format || !of_message || scan_.next_word() != "ENUM") {
      return scan_.skip_statement();
    }
    scan_.word("ENUM");
    formats_.clear();
    do {
      formats_.push_back(scan_.text("a format's name"));
    } while (scan_.accept(','));
    scan_.expect(';');
  }

  void read_attribute_default(int line) {
    if (scan_.text("an attribute's name") != frame_format) return scan_.skip_statement();
    FormatRemark remark;
    remark.line = line;
    read_format(remark);
    default_format_ = std::move(remark);
  }

  void read_attribute(int line) {
    const std::string attribute = scan_.text("an attribute's name");
    if (attribute == long_signal && scan_.next_word() == "SG_") {
      scan_.word("SG_");
      NameRemark remark{read_signal_remark(line), scan_.text("a name")};
      long_names_.push_back(std::move(remark));
    } else if (attribute == long_message && scan_.next_word() == "BO_") {
      scan_.word("BO_");
      NameRemark remark{read_remark(line), scan_.text("a name")};
      long_names_.push_back(std::move(remark));
    } else if (attribute == cycle_time && scan_.next_word() == "BO_") {
      scan_.word("BO_");
      const Remark remark = read_remark(line);
      const auto found = by_id_.find(remark.message);
      const double cycle_s = scan_.accept_real().value_or(0.0) * 1e-3;
      if (found != by_id_.end()) drafts_[found->second].message.cycle_s = cycle_s;
    } else if (attribute == frame_format) {
      if (scan_.word("BO_") != "BO_") {
        throw DbcSyntaxError{line, std::string(frame_format),
                             "must be an attribute of a message (BO_)"};
      }
      FormatRemark remark{read_remark(line), 0, {}};
      read_format(remark);
      return format_remarks_.push_back(std::move(remark));
    }
    scan_.skip_statement();
  }

  void read_format(FormatRemark& remark) {
    if (scan_.next_is('"')) {
      remark.format = scan_.text("a format's name");
    } else {
      remark.index = scan_.integer("a format's number", UINT32_MAX);
    }
    scan_.expect(';');
  }

  // -------------------------------------------------------------- resolution of references

  void resolve() {
    resolve_formats();
    for (const FloatRemark& remark : floats_) apply(remark);
    for (const NameRemark& remark : long_names_) apply(remark);
    for (ValueRemark& remark : value_names_) apply(remark);
    std::map<std::pair<std::size_t, std::size_t>, const PageRemark*> pages;
    for (const PageRemark& remark : pages_) {
      const auto [draft, index] = find(remark);
      if (draft == nullptr) continue;
      const About about{draft->message.name, remark.signal};
      const auto place = static_cast<std::size_t>(draft - drafts_.data());
      if (!draft->multiplexing[index].page) {
        flaw(remark.line, remark.signal, "", "has a multiplexor here, but not in its SG_", about);
      } else if (!pages.emplace(std::pair(place, index), &remark).second) {
        flaw(remark.line, remark.signal, "", "has two lists of ranges", about);
      }
    }
    for (std::size_t place = 0; place < drafts_.size(); ++place) {
      Draft& draft = drafts_[place];
      std::vector<std::optional<Choice>> choices(draft.message.signals.size());
      for (std::size_t i = 0; i < choices.size(); ++i) {
        const auto remark = pages.find({place, i});
        choices[i] = choice_of(draft, i, remark == pages.end() ? nullptr : remark->second);
      }
      for (std::size_t i = 0; i < choices.size(); ++i) collect_selectors(draft, choices, i);
    }
  }

  /// The draft that a remark refers to; nullptr after a flaw.
  Draft* draft_of(const Remark& remark) {
    const auto found = by_id_.find(remark.message);
    if (found != by_id_.end()) return &drafts_[found->second];
    flaw(remark.line, remark.signal, std::to_string(remark.message),
         "is the number of no message (BO_) of this file", {std::to_string(remark.message), ""});
    return nullptr;
  }

  /// The draft and the signal's index that a remark refers to; nullptr after a flaw.
  std::pair<Draft*, std::size_t> find(const Remark& remark) {
    Draft* draft = draft_of(remark);
    if (draft == nullptr) return {nullptr, 0};
    const auto index = index_of(*draft, remark.signal);
    if (index) return {draft, *index};
    flaw(remark.line, remark.signal, "", "must be a signal of " + draft->message.name,
         {draft->message.name, remark.signal});
    return {nullptr, 0};
  }

  static std::optional<std::size_t> index_of(const Draft& draft, std::string_view signal) {
    const auto& signals = draft.message.signals;
    const auto found = std::find_if(signals.begin(), signals.end(),
                                    [&](const DbcSignal& each) { return each.name == signal; });
    if (found == signals.end()) return std::nullopt;
    return static_cast<std::size_t>(found - signals.begin());
  }

  /// Name of the remark's format, by default as in common files; none: not listed.
  [[nodiscard]] std::optional<std::string> format_of(const FormatRemark& remark) const {
    if (!remark.format.empty()) return remark.format;
    if (!formats_.empty()) {
      if (remark.index >= formats_.size()) return std::nullopt;
      return formats_[remark.index];
    }
    if (remark.index == 3) return "J1939PG";
    return remark.index == 14 || remark.index == 15 ? "FD" : "";
  }

  static void apply(const std::string& format, DbcMessage& message) {
    message.declared_fd = format.find("FD") != std::string::npos;
    message.is_group = message.extended && format == "J1939PG";
  }

  void resolve_formats() {
    if (default_format_ && !default_format_->format.empty()) {
      for (Draft& draft : drafts_) apply(default_format_->format, draft.message);
    }
    for (const FormatRemark& remark : format_remarks_) {
      Draft* draft = draft_of(remark);
      if (draft == nullptr) continue;
      if (const auto format = format_of(remark)) {
        apply(*format, draft->message);
      } else {
        flaw(remark.line, std::string(frame_format), std::to_string(remark.index),
             "must be one of the formats that BA_DEF_ lists", {draft->message.name, ""}, {"fd"});
      }
    }
    for (Draft& draft : drafts_) {
      const DbcMessage& message = draft.message;
      const bool fd = message.bytes > classic_bytes_max || message.declared_fd == true;
      for (DbcSignal& signal : draft.message.signals) {
        signal.place.fd = fd;
        if (message.is_group) signal.place.id_mask = group_mask(message.id);
      }
    }
  }

  void apply(const NameRemark& remark) {
    if (remark.signal.empty()) {
      if (Draft* draft = draft_of(remark)) draft->message.long_name = remark.name;
      return;
    }
    const auto [draft, index] = find(remark);
    if (draft == nullptr || remark.name.empty()) return;
    auto& signals = draft->message.signals;
    if (long_seen_.emplace(draft->message.name, remark.name).second) {
      signals[index].long_name = remark.name;
      return;
    }
    for (DbcSignal& each : signals) {
      if (each.long_name == remark.name) each.long_name.clear();
    }
    flaw(remark.line, remark.name, "", "is the long name of two signals",
         {draft->message.name, remark.name});
  }

  void apply(ValueRemark& remark) {
    const auto found = by_id_.find(remark.message);
    if (found == by_id_.end()) return;
    Draft& draft = drafts_[found->second];
    if (const auto index = index_of(draft, remark.signal))
      draft.message.signals[*index].value_names = std::move(remark.names);
  }

  void apply(const FloatRemark& remark) {
    const auto [draft, index] = find(remark);
    if (draft == nullptr || remark.type == 0) return;
    CanSignal& place = draft->message.signals[index].place;
    const int length = remark.type == 1 ? 32 : 64;
    if (place.length_bits != length) {
      flaw(remark.line, remark.signal, std::to_string(place.length_bits),
           "must have " + std::to_string(length) + " bits, being a float of that size",
           {draft->message.name, remark.signal}, {"float"});
      return;
    }
    place.is_float = true;
  }

  /// The multiplexor that selects a signal, and its numbers.
  struct Choice {
    std::size_t selector{0};
    std::vector<CanSelector::Pages> pages;
  };

  std::optional<Choice> choice_of(const Draft& draft, std::size_t index, const PageRemark* remark) {
    const DbcSignal& signal = draft.message.signals[index];
    const std::optional<std::uint64_t> page = draft.multiplexing[index].page;
    if (!page) return std::nullopt;
    const About about{draft.message.name, signal.name};
    const auto selects = [](const Multiplexing& each) { return each.selects; };
    const auto& all = draft.multiplexing;
    Choice choice{0, {{*page, *page}}};
    if (remark != nullptr) {
      const auto selector = index_of(draft, remark->selector);
      if (!selector || !all[*selector].selects) {
        flaw(remark->line, signal.name, remark->selector,
             "must be a multiplexor of " + draft.message.name, about);
        return std::nullopt;
      }
      choice = {*selector, remark->pages};
    } else if (std::count_if(all.begin(), all.end(), selects) != 1) {
      flaw(signal.line, signal.name, "m" + std::to_string(*page),
           "needs a line SG_MUL_VAL_ unless its message has just one multiplexor", about);
      return std::nullopt;
    } else {
      choice.selector =
          static_cast<std::size_t>(std::find_if(all.begin(), all.end(), selects) - all.begin());
    }
    const int length = draft.message.signals[choice.selector].place.length_bits;
    const bool reachable =
        std::any_of(choice.pages.begin(), choice.pages.end(), [length](const auto& pages) {
          return length >= 64 || pages.first < (std::uint64_t{1} << std::max(length, 0));
        });
    if (!reachable) {
      flaw(signal.line, signal.name, std::to_string(choice.pages.front().first),
           "is more than its multiplexor can be", about);
    }
    return choice;
  }

  /// Adds the multiplexor of a signal, that multiplexor's own one, and so on.
  void collect_selectors(Draft& draft, const std::vector<std::optional<Choice>>& choices,
                         std::size_t index) {
    constexpr std::size_t depth_max = 16;
    DbcSignal& signal = draft.message.signals[index];
    const About about{draft.message.name, signal.name};
    std::size_t at = index;
    while (choices[at]) {
      if (signal.place.selectors.size() == depth_max) {
        flaw(signal.line, signal.name, "", "must not be selected by itself, nor 17 deep", about);
        signal.place.selectors.clear();
        return;
      }
      const DbcSignal& selector = draft.message.signals[choices[at]->selector];
      if (flawed_.contains({draft.message.name, selector.name})) {
        flaw(signal.line, signal.name, selector.name, "is its multiplexor and has a flaw", about);
      }
      const CanSignal& place = selector.place;
      signal.place.selectors.push_back(
          {{place.start_bit, place.length_bits, place.byte_order}, choices[at]->pages});
      at = choices[at]->selector;
    }
  }

  DbcScanner scan_;
  std::string name_;
  DbcFile file_;
  std::vector<Draft> drafts_;
  std::map<std::uint32_t, std::size_t> by_id_;  ///< as in the file, including bit 31
  std::set<std::string> names_;
  std::set<std::string> signal_names_;  ///< of the present message
  bool in_message_{false};
  bool in_broken_message_{false};  ///< its BO_ has a flaw: its signals are dropped
  About about_;                    ///< of the present statement, as far as known
  std::set<std::pair<std::string, std::string>> flawed_;  ///< message and signal with a flaw
  std::vector<FloatRemark> floats_;
  std::vector<PageRemark> pages_;
  std::vector<FormatRemark> format_remarks_;
  std::vector<NameRemark> long_names_;
  std::vector<ValueRemark> value_names_;
  std::set<std::pair<std::string, std::string>> long_seen_;  ///< of messages
  std::vector<std::string> formats_;
  std::optional<FormatRemark> default_format_;
};

}  // namespace

DbcFile read_dbc_text(std::string_view text, const std::string& name) {
  return DbcReader(text, name).read();
}

}  // namespace thermocomp
