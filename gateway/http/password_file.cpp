#include "gateway/http/password_file.hpp"

#include <algorithm>
#include <array>
#include <crypt.h>
#include <cstring>
#include <memory>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <stdexcept>

#include <sys/random.h>

#include "gateway/settings/secret_files.hpp"

namespace thermocomp::gateway {
namespace {

constexpr std::size_t password_bytes_max = 256;

std::string random_bytes(std::size_t count) {
  std::string bytes(count, '\0');
  if (getrandom(bytes.data(), count, 0) != static_cast<ssize_t>(count))
    throw std::runtime_error("the kernel provides no random numbers");
  return bytes;
}

/// @return empty if crypt_r fails
std::string crypted(const std::string& password, const std::string& setting) {
  const auto work = std::make_unique<crypt_data>();
  const char* made = crypt_r(password.c_str(), setting.c_str(), work.get());
  return made != nullptr && made[0] != '*' ? made : "";
}

}  // namespace

PasswordFile::PasswordFile(const std::filesystem::path& file)
    : hashes_(read_passwords(file)), key_(random_bytes(32)) {}

std::string PasswordFile::digest(const std::string& user, const std::string& password) const {
  const std::string text = key_ + user + '\n' + password;
  std::array<unsigned char, EVP_MAX_MD_SIZE> bytes{};
  unsigned size = 0;
  if (EVP_Digest(text.data(), text.size(), bytes.data(), &size, EVP_sha256(), nullptr) != 1)
    throw std::runtime_error("SHA-256 is not available");
  return {bytes.begin(), bytes.begin() + size};
}

PasswordFile::Answer PasswordFile::check(const std::string& user, const std::string& password,
                                         Clock::time_point now) {
  if (password.size() > password_bytes_max) return Answer::wrong;
  const std::string seen = digest(user, password);
  if (const auto right = right_.find(user);
      right != right_.end() && CRYPTO_memcmp(right->second.data(), seen.data(), seen.size()) == 0)
    return Answer::right;
  const double passed_s = std::chrono::duration<double>(now - filled_at_).count();
  tokens_ = std::min(looked_at_burst, tokens_ + std::max(0.0, passed_s) * looked_at_per_s);
  filled_at_ = now;
  if (!(tokens_ >= 1.0)) return Answer::too_many;
  tokens_ -= 1.0;
  // Hashes for an unknown user too, so that the time does not reveal which users exist.
  const auto found = hashes_.find(user);
  const std::string& hash = found != hashes_.end() ? found->second : hashes_.begin()->second;
  const std::string made = crypted(password, hash);
  const bool same =
      made.size() == hash.size() && CRYPTO_memcmp(made.data(), hash.data(), hash.size()) == 0;
  if (!same || found == hashes_.end()) return Answer::wrong;
  right_[user] = seen;
  return Answer::right;
}

std::string password_line(const std::string& user, const std::string& password) {
  if (!is_user_name(user))
    throw std::runtime_error(
        "a user name must consist of letters, digits and signs other than : and #");
  if (password.size() < 8 || password.size() > password_bytes_max)
    throw std::runtime_error("a password must have 8 to 256 characters");
  const std::string salt = random_bytes(16);
  std::array<char, CRYPT_GENSALT_OUTPUT_SIZE> setting{};
  if (crypt_gensalt_rn("$y$", 0, salt.data(), static_cast<int>(salt.size()), setting.data(),
                       static_cast<int>(setting.size())) == nullptr)
    throw std::runtime_error("yescrypt is not available");
  const std::string hash = crypted(password, setting.data());
  if (hash.empty()) throw std::runtime_error("the password cannot be hashed");
  return user + ":" + hash;
}

}  // namespace thermocomp::gateway
