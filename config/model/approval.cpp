#include "config/model/approval.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <vector>

#include <system_error>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t signature_bytes = 64;
constexpr std::uintmax_t key_bytes_max = 4096;

using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
using Context = std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)>;

/// Never asks for a passphrase: signing programs run unattended.
int no_passphrase(char* /*text*/, int /*size*/, int /*writes*/, void* /*user*/) {
  return -1;
}

Key key_in(const fs::path& file, bool is_private) {
  const std::string text = read_text_file(file, key_bytes_max);
  const std::unique_ptr<BIO, decltype(&BIO_free)> bytes(
      BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), &BIO_free);
  Key key(is_private ? PEM_read_bio_PrivateKey(bytes.get(), nullptr, no_passphrase, nullptr)
                     : PEM_read_bio_PUBKEY(bytes.get(), nullptr, no_passphrase, nullptr),
          &EVP_PKEY_free);
  if (!key || EVP_PKEY_get_id(key.get()) != EVP_PKEY_ED25519)
    throw ConfigurationError(
        {{file.string(), 0, "", "",
          is_private ? "must be a private Ed25519 key in PEM, without a passphrase"
                     : "must be a public Ed25519 key in PEM"}});
  return key;
}

const unsigned char* bytes_of(const std::string& text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

/// @return empty unless it has 128 hexadecimal digits
std::vector<unsigned char> bytes_from(const std::string& digits) {
  std::vector<unsigned char> bytes;
  if (digits.size() != 2 * signature_bytes) return bytes;
  for (std::size_t i = 0; i < digits.size(); i += 2) {
    const std::string pair = digits.substr(i, 2);
    if (pair.find_first_not_of("0123456789abcdef") != std::string::npos) return {};
    bytes.push_back(static_cast<unsigned char>(std::stoul(pair, nullptr, 16)));
  }
  return bytes;
}

bool is_signed_by(EVP_PKEY* key, const std::string& text,
                  const std::vector<unsigned char>& signature) {
  const Context context(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  return context && !signature.empty() &&
         EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, key) == 1 &&
         EVP_DigestVerify(context.get(), signature.data(), signature.size(), bytes_of(text),
                          text.size()) == 1;
}

}  // namespace

std::string ReleaseOrder::text() const {
  return std::string("thermocomp release order 1\nmachine ")
      .append(machine)
      .append("\nrelease ")
      .append(std::to_string(release))
      .append("\nmodel ")
      .append(checksum)
      .append(takes_back ? "\ntake back\n" : "\npromote\n");
}

std::string sign_order(const ReleaseOrder& order, const fs::path& key) {
  const Key signer = key_in(key, true);
  const std::string text = order.text();
  std::array<unsigned char, signature_bytes> signature{};
  std::size_t size = signature.size();
  const Context context(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  if (!context || EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, signer.get()) != 1 ||
      EVP_DigestSign(context.get(), signature.data(), &size, bytes_of(text), text.size()) != 1)
    throw ConfigurationError({{key.string(), 0, "", "", "cannot sign with this key"}});
  std::string digits;
  for (const unsigned char byte : signature) {
    constexpr std::string_view hexadecimal = "0123456789abcdef";
    digits += hexadecimal[byte >> 4u];
    digits += hexadecimal[byte & 15u];
  }
  return digits;
}

std::string signer_of(const ReleaseOrder& order, const std::string& signature,
                      const fs::path& folder) {
  const std::vector<unsigned char> bytes = bytes_from(signature);
  std::error_code error;
  std::vector<fs::path> files;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    if (entry->path().extension() == ".pem") files.push_back(entry->path());
  if (error) throw ConfigurationError({{folder.string(), 0, "", "", error.message()}});
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files)
    if (is_signed_by(key_in(file, false).get(), order.text(), bytes)) return file.stem().string();
  return "";
}

}  // namespace thermocomp
