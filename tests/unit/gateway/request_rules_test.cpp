#include "gateway/http/request_rules.hpp"

#include <array>
#include <string>

#include <catch2/catch.hpp>

using namespace thermocomp::gateway;

namespace {

RequestFacts plain_request() {
  return {"GET", "/api/status", "localhost:8420", "", "", 0, 1};
}

const HostRules hosts("192.168.1.5", {"Mill-3.shop.example"});

unsigned status_of(const RequestFacts& request) {
  const auto refusal = judge_request(request, hosts);
  return refusal ? refusal->status : 200;
}

}  // namespace

TEST_CASE("host names match regardless of port and case", "[gateway][http]") {
  for (const char* host : {"localhost", "LOCALHOST:1", "127.0.0.1:8420", "[::1]:8420",
                           "192.168.1.5", "mill-3.shop.example:443"})
    CHECK(hosts.allows(host));
  for (const char* host :
       {"", "evil.example", "localhost.evil.example", "localhost:", "localhost:x", "[::1", "[]",
        "::1", "localhost:80:80", "local host", "127.0.0.11"})
    CHECK_FALSE(hosts.allows(host));
}

TEST_CASE("in a browser only pages of this gateway may send requests", "[gateway][http]") {
  CHECK(status_of(plain_request()) == 200);
  RequestFacts request = plain_request();
  request.origin = "https://localhost:8420";
  CHECK(status_of(request) == 200);
  for (const char* origin : {"null", "http://localhost:8421", "http://evil.example",
                             "ftp://localhost:8420", "localhost:8420"}) {
    request.origin = origin;
    CHECK(status_of(request) == 403);
  }
  request = plain_request();
  request.fetch_site = "cross-site";
  CHECK(status_of(request) == 403);
  request.path = "/";
  CHECK(status_of(request) == 200);  // a followed link
  request.method = "POST";
  CHECK(status_of(request) == 403);
}

TEST_CASE("malformed requests are refused", "[gateway][http]") {
  RequestFacts request = plain_request();
  request.hosts_given = 2;
  CHECK(status_of(request) == 400);
  request = plain_request();
  request.lengths_given = 1;
  CHECK(status_of(request) == 200);
  request.lengths_given = 2;
  CHECK(status_of(request) == 400);
  request = plain_request();
  request.method = "PUT";
  CHECK(status_of(request) == 405);
  request = plain_request();
  request.query_bytes = 5000;
  CHECK(status_of(request) == 414);
  request = plain_request();
  request.path = "api";
  CHECK(status_of(request) == 400);
}

TEST_CASE("history is requested by absolute or relative times", "[gateway][http]") {
  std::string why;
  const double now_s = 1e9;
  const auto shift = parse_history_request("", "", "", now_s, why);
  REQUIRE(shift);
  CHECK(shift->from_s == now_s - 8 * 3600.0);
  CHECK(shift->to_s == now_s);
  const auto hour = parse_history_request("-3600", "999999000", "2", now_s, why);
  REQUIRE(hour);
  CHECK(hour->from_s == now_s - 3600.0);
  CHECK(hour->to_s == 999999000.0);
  CHECK(hour->points == 2);
  for (const auto& [from, to, points] :
       {std::array{"x", "", ""}, std::array{"-10", "-20", ""}, std::array{"", "", "1"},
        std::array{"", "", "5001"}, std::array{"", "", "2.5"}, std::array{"nan", "", ""},
        std::array{"-1e300", "", ""}, std::array{"", "inf", ""}, std::array{"5 ", "", ""}}) {
    why.clear();
    CHECK_FALSE(parse_history_request(from, to, points, now_s, why));
    CHECK_FALSE(why.empty());
  }
}
