// Commits one chosen fault that an instrumented build must stop.
#include <cstdio>
#include <limits>
#include <string_view>
#include <thread>
#include <vector>

namespace {

volatile int sink = 0;

// volatile prevents the compiler from detecting or removing the fault.
void heap_overflow() {
  volatile std::size_t one_too_many = 4;
  const std::vector<int> values(4, 1);
  sink = values.data()[one_too_many];
}

void use_after_free() {
  int* volatile value = new int{1};
  delete value;
  sink = *value;
}

void signed_overflow() {
  volatile int largest = std::numeric_limits<int>::max();
  sink = largest + 1;
}

void data_race() {
  int shared = 0;
  const auto count = [&shared] {
    for (int i = 0; i < 10000; ++i) shared = shared + 1;
  };
  std::thread first(count);
  std::thread second(count);
  first.join();
  second.join();
  sink = shared;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view fault = argc == 2 ? argv[1] : "";
  if (fault == "heap_overflow") {
    heap_overflow();
  } else if (fault == "use_after_free") {
    use_after_free();
  } else if (fault == "signed_overflow") {
    signed_overflow();
  } else if (fault == "data_race") {
    data_race();
  } else if (fault != "none") {
    std::fputs("usage: planted_fault none|heap_overflow|use_after_free|signed_overflow|data_race\n",
               stderr);
    return 2;
  }
  std::puts("ran to the end");
  return 0;
}
