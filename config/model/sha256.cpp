#include <array>
#include <openssl/evp.h>

#include "config/model/model_file.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {

std::string sha256_hex(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  const int done =
      EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr);
  THERMOCOMP_ENSURE(done == 1 && size == 32);
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    constexpr std::string_view digits = "0123456789abcdef";
    text += digits[digest[i] >> 4u];
    text += digits[digest[i] & 15u];
  }
  return text;
}

}  // namespace thermocomp
