// Subnormal numbers are zero to kernels, in whichever thread they run, and as they were to everybody else.
#pragma once

#include <cstdint>
#if defined(__x86_64__) || defined(_M_X64)
#include <xmmintrin.h>
#endif

namespace taichi_soft {

#if defined(__x86_64__) || defined(_M_X64)
class WithoutSubnormals {
 public:
  WithoutSubnormals() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040u); }
  ~WithoutSubnormals() { _mm_setcsr(before_); }
  WithoutSubnormals(const WithoutSubnormals&) = delete;
  WithoutSubnormals& operator=(const WithoutSubnormals&) = delete;

 private:
  unsigned before_;
};
#else
class WithoutSubnormals {
 public:
  WithoutSubnormals() {}  // Taichi leaves other processors as they are
};
#endif

}  // namespace taichi_soft
