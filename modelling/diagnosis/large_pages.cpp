#include "modelling/diagnosis/large_pages.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdlib>

#ifdef __GLIBC__
#include <malloc.h>
#include <unistd.h>

#include <sys/mman.h>
#endif

namespace thermocomp::diagnosis {

#ifdef __GLIBC__
namespace {

constexpr std::ptrdiff_t large_page_bytes = 2097152;
constexpr std::ptrdiff_t small_page_bytes = 4096;
constexpr std::ptrdiff_t growth_bytes = 196608;  ///< more than what a heap begins with has left
constexpr int heap_bytes = 48 << 20;             // not touched before it is needed
constexpr int largest_of_heap_bytes = 16 << 20;

char* end_of_heap() {
  return static_cast<char*>(::sbrk(0));
}

}  // namespace

void use_large_pages() {
  ::mallopt(M_MMAP_THRESHOLD, largest_of_heap_bytes);
  ::mallopt(M_TRIM_THRESHOLD, 2 * heap_bytes);
  ::mallopt(M_TOP_PAD, heap_bytes);
  // The heap is made to grow so that nothing beyond the begin of a large page is written before the
  // system is asked, or that page would stay a small one. malloc allows for others who move the
  // heap's end.
  constexpr std::ptrdiff_t before_bytes = growth_bytes + small_page_bytes;
  const auto end = static_cast<std::ptrdiff_t>(reinterpret_cast<std::uintptr_t>(end_of_heap()));
  ::sbrk(large_page_bytes - (end + before_bytes) % large_page_bytes);
  char* const first = end_of_heap() + before_bytes;
  void* volatile grown = std::malloc(growth_bytes);  // volatile, or it is optimised away
  std::free(grown);
  ::mallopt(M_TOP_PAD, static_cast<int>(large_page_bytes));
  const std::ptrdiff_t length = end_of_heap() - first;
  if (length > 0) ::madvise(first, static_cast<std::size_t>(length), MADV_HUGEPAGE);  // may fail
}
#else
void use_large_pages() {}
#endif

}  // namespace thermocomp::diagnosis
