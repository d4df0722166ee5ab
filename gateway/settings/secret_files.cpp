#include "gateway/settings/secret_files.hpp"

#include <algorithm>
#include <crypt.h>
#include <memory>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sstream>
#include <vector>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::gateway {
namespace {

using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;

/// Reads the first such object of the file, without prompting for a password.
template <class Object, class Free>
std::unique_ptr<Object, Free> read_pem(const std::filesystem::path& file, Free free,
                                       Object* (*read)(BIO*, Object**, pem_password_cb*, void*),
                                       const char* rule) {
  const std::string text = read_text_file(file);
  const std::unique_ptr<BIO, decltype(&BIO_free)> bytes(
      BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), &BIO_free);
  const auto no_password = [](char*, int, int, void*) { return -1; };
  std::unique_ptr<Object, Free> object(read(bytes.get(), nullptr, no_password, nullptr), free);
  ERR_clear_error();
  if (!object) throw ConfigurationError({{file.string(), 0, "", "", rule}});
  return object;
}

Certificate certificate_in(const std::filesystem::path& file) {
  return read_pem(file, &X509_free, &PEM_read_bio_X509, "must be a certificate in PEM");
}

Key key_in(const std::filesystem::path& file) {
  return read_pem(file, &EVP_PKEY_free, &PEM_read_bio_PrivateKey,
                  "must be a private key in PEM, without a password");
}

}  // namespace

bool is_user_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](char c) {
    return c > ' ' && c < 127 && c != ':' && c != '#';
  });
}

std::map<std::string, std::string> read_passwords(const std::filesystem::path& file) {
  std::map<std::string, std::string> hashes;
  std::vector<Problem> problems;
  std::istringstream lines(read_text_file(file));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.empty() || line.front() == '#') continue;
    const std::size_t colon = line.find(':');
    const std::string user = line.substr(0, colon);
    const std::string hash = colon == std::string::npos ? "" : line.substr(colon + 1);
    if (!is_user_name(user) || crypt_checksalt(hash.c_str()) != CRYPT_SALT_OK)
      problems.push_back({file.string(), number, user, "",
                          "must be user:hash as thermocomp-gateway --password-line prints it"});
    else if (!hashes.emplace(user, hash).second)
      problems.push_back({file.string(), number, user, "", "is listed twice"});
  }
  if (problems.empty() && hashes.empty())
    problems.push_back({file.string(), 0, "", "", "must have at least one line user:hash"});
  if (!problems.empty()) throw ConfigurationError(problems);
  return hashes;
}

void read_certificate(const std::filesystem::path& file) {
  static_cast<void>(certificate_in(file));
}

void read_key(const std::filesystem::path& file) {
  static_cast<void>(key_in(file));
}

bool fit_each_other(const std::filesystem::path& certificate, const std::filesystem::path& key) {
  const bool fit =
      X509_check_private_key(certificate_in(certificate).get(), key_in(key).get()) == 1;
  ERR_clear_error();
  return fit;
}

}  // namespace thermocomp::gateway
