// Kernels compute as IEEE 754 says, subnormal numbers included, in whichever thread they run and whatever the game
// has its own threads do.
#pragma once

#if defined(__x86_64__) || defined(_M_X64)
#include <xmmintrin.h>
#endif

namespace taichi_soft {

#if defined(__x86_64__) || defined(_M_X64)
class WithUsualFloats {
 public:
  WithUsualFloats() : before_(_mm_getcsr()) { _mm_setcsr(0x1F80u); }
  ~WithUsualFloats() { _mm_setcsr(before_); }
  WithUsualFloats(const WithUsualFloats&) = delete;
  WithUsualFloats& operator=(const WithUsualFloats&) = delete;

 private:
  unsigned before_;
};
#else
class WithUsualFloats {
 public:
  WithUsualFloats() {}
};
#endif

}  // namespace taichi_soft
