/// Electronic data sheets: loaded objects are found by address and name; refusals name their cause.
#include "config/bus_files/eds_file.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "common/fuzz.hpp"

using namespace thermocomp;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::string name = "module.eds";
  const EdsFile file = read_eds_text(text, name);
  std::vector<Problem> problems;
  for (const EdsFlaw& flaw : file.flaws) problems.push_back(flaw.problem);
  const fuzz::NamedText files[] = {{name, text}};
  if (!problems.empty()) fuzz::check_problems(problems, files);
  FUZZ_REQUIRE(!file.objects.empty() || !problems.empty());
  const EdsObject* before = nullptr;
  for (const EdsObject& object : file.objects) {
    FUZZ_REQUIRE(file.find(object.address) == &object);
    const auto named = file.find(object.name);
    FUZZ_REQUIRE(!named.empty());
    for (const char c : object.name) FUZZ_REQUIRE(c >= 0x20 && c < 0x7F);
    if (object.type) FUZZ_REQUIRE(object.type->length_bits >= 1 && object.type->length_bits <= 64);
    if (before != nullptr) {
      FUZZ_REQUIRE(std::pair(before->address.index, before->address.sub) <
                   std::pair(object.address.index, object.address.sub));
    }
    before = &object;
  }
  return 0;
}
