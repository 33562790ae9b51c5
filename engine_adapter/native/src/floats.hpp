// Makes calls follow IEEE 754, including subnormal numbers, whatever floating-point mode the game's threads use.
#pragma once

#include <cstdint>
#if defined(__x86_64__) || defined(_M_X64)
#include <xmmintrin.h>
#endif

namespace taichi_soft {

// CPU register that contains the rounding mode and flush-to-zero.
#if defined(__x86_64__) || defined(_M_X64)
constexpr uint64_t kUsualFloats = 0x1F80;
inline uint64_t float_control() { return _mm_getcsr(); }
inline void set_float_control(uint64_t control) { _mm_setcsr(unsigned(control)); }
#elif defined(__aarch64__)
constexpr uint64_t kUsualFloats = 0;
inline uint64_t float_control() {
  uint64_t control;
  asm volatile("mrs %0, fpcr" : "=r"(control));
  return control;
}
inline void set_float_control(uint64_t control) { asm volatile("msr fpcr, %0" : : "r"(control)); }
#else
constexpr uint64_t kUsualFloats = 0;  // the register of other CPUs is unknown
inline uint64_t float_control() { return 0; }
inline void set_float_control(uint64_t) {}
#endif

class WithUsualFloats {
 public:
  WithUsualFloats() : before_(float_control()) { set_float_control(kUsualFloats); }
  ~WithUsualFloats() { set_float_control(before_); }
  WithUsualFloats(const WithUsualFloats&) = delete;
  WithUsualFloats& operator=(const WithUsualFloats&) = delete;

 private:
  uint64_t before_;
};

}  // namespace taichi_soft
