#include "config/model/approval.hpp"

#include <fstream>

#include <catch2/catch.hpp>

#include "config/text/problems.hpp"

namespace {

using Catch::Matchers::Contains;
using thermocomp::ConfigurationError;
using thermocomp::ReleaseOrder;
using thermocomp::sign_order;
using thermocomp::signer_of;

namespace fs = std::filesystem;

/// Secret and public key of the first test of RFC 8032, section 7.1.
constexpr const char* secret =
    "-----BEGIN PRIVATE KEY-----\n"
    "MC4CAQAwBQYDK2VwBCIEIJ1hsZ3v/VpguoRK9JLsLMREScVpezJpGXA7rAMcrn9g\n"
    "-----END PRIVATE KEY-----\n";
constexpr const char* known =
    "-----BEGIN PUBLIC KEY-----\n"
    "MCowBQYDK2VwAyEA11qYAYKxCrfVS/7TyWQHOg7hcvPapiMlrwIaaPcHURo=\n"
    "-----END PUBLIC KEY-----\n";

struct Keys {
  Keys() : folder(fs::temp_directory_path() / "thermocomp_approval_test") {
    fs::remove_all(folder);
    fs::create_directory(folder);
    write("secret.key", secret);
    write("maria.pem", known);
  }
  ~Keys() { fs::remove_all(folder); }
  void write(const char* name, const std::string& text) const {
    std::ofstream(folder / name) << text;
  }
  fs::path folder;
};

const ReleaseOrder order{"mill_1", 17, std::string(64, 'a'), false};

TEST_CASE("a signature identifies its key and is not valid for any other order",
          "[config][approval]") {
  const Keys keys;
  const std::string signature = sign_order(order, keys.folder / "secret.key");
  CHECK(signature.size() == 128);
  CHECK(signer_of(order, signature, keys.folder) == "maria");
  ReleaseOrder other = order;
  other.machine = "mill_2";
  CHECK(signer_of(other, signature, keys.folder).empty());
  other = order;
  other.release = 18;
  CHECK(signer_of(other, signature, keys.folder).empty());
  other = order;
  other.checksum.back() = 'b';
  CHECK(signer_of(other, signature, keys.folder).empty());
  other = order;
  other.takes_back = true;
  CHECK(signer_of(other, signature, keys.folder).empty());
  for (const std::string& forged : {std::string(), std::string("yes"), std::string(128, '0'),
                                    std::string(128, 'g'), signature + "00", signature.substr(2)})
    CHECK(signer_of(order, forged, keys.folder).empty());
}

TEST_CASE("an unusable key is named", "[config][approval]") {
  const Keys keys;
  CHECK_THROWS_WITH(sign_order(order, keys.folder / "maria.pem"),
                    Contains("maria.pem") && Contains("private Ed25519 key"));
  CHECK_THROWS_AS(sign_order(order, keys.folder / "nothing.key"), ConfigurationError);
  CHECK_THROWS_AS(signer_of(order, std::string(128, '0'), keys.folder / "nowhere"),
                  ConfigurationError);
  keys.write("otto.pem", "nonsense");
  CHECK_THROWS_WITH(signer_of(order, std::string(128, '0'), keys.folder),
                    Contains("otto.pem") && Contains("public Ed25519 key"));
}

}  // namespace
