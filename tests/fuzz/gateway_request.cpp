/// Gateway requests with any headers and query: each is accepted or refused, an accepted host is
/// one of ours, and an accepted time range can be drawn.
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/fuzz.hpp"
#include "gateway/http/request_rules.hpp"

using namespace thermocomp;
using namespace thermocomp::gateway;

namespace {

/// Fields of the input, separated by the byte 0xFF, which is not part of UTF-8.
std::vector<std::string_view> fields_of(std::string_view input) {
  std::vector<std::string_view> fields;
  while (fields.size() < 8) {
    const std::size_t end = input.find('\xFF');
    fields.push_back(input.substr(0, end));
    if (end == std::string_view::npos) break;
    input.remove_prefix(end + 1);
  }
  fields.resize(8);
  return fields;
}

void judge(const std::vector<std::string_view>& fields) {
  static const HostRules hosts("10.0.0.5", {"mill.example"});
  const RequestFacts request{fields[0], fields[1],        fields[2], fields[3],
                             fields[4], fields[5].size(), 1};
  const std::optional<Refusal> refusal = judge_request(request, hosts);
  if (refusal) {
    FUZZ_REQUIRE(refusal->status >= 400 && refusal->status < 500 && !refusal->text.empty());
    return;
  }
  const std::optional<std::string> name = host_name(request.host);
  FUZZ_REQUIRE(name && (*name == "localhost" || *name == "127.0.0.1" || *name == "::1" ||
                        *name == "10.0.0.5" || *name == "mill.example"));
  FUZZ_REQUIRE(request.path.front() == '/');
  // An accepted origin is the host itself.
  if (!request.origin.empty())
    FUZZ_REQUIRE(request.origin.size() == request.host.size() + 7 ||
                 request.origin.size() == request.host.size() + 8);
}

void read_history(const std::vector<std::string_view>& fields) {
  std::string why;
  constexpr double now_s = 1.7e9;
  const auto request = parse_history_request(fields[5], fields[6], fields[7], now_s, why);
  FUZZ_REQUIRE(request.has_value() != !why.empty());
  if (!request) return;
  FUZZ_REQUIRE(std::isfinite(request->from_s) && std::isfinite(request->to_s));
  FUZZ_REQUIRE(request->from_s >= 0.0 && request->to_s > request->from_s);
  FUZZ_REQUIRE(request->points >= 2 && request->points <= 5000);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto fields = fields_of({reinterpret_cast<const char*>(data), size});
  judge(fields);
  read_history(fields);
  return 0;
}
