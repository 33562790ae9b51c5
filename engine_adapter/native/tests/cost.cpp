// Measures the time of a step outside its kernel: cost FOLDER [ROUNDS [STEPS]]
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "../src/world.hpp"

using namespace taichi_soft;
using Clock = std::chrono::steady_clock;

namespace {

constexpr double kDt = 1.0 / 60.0;

Kernels::Kernel kernel_of_step;
double kernel_took;  // [us]

double microseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

void run_timed(void* context) {
  const Clock::time_point start = Clock::now();
  kernel_of_step(static_cast<Context*>(context));
  kernel_took = microseconds_since(start);
}

// Loads a scene again with linked kernels, of which the kernel of a step is timed.
std::shared_ptr<Scene> with_timed_step(const Scene& scene, const std::string& folder) {
  std::ifstream file(folder + "/world.tsw", std::ios::binary);
  std::vector<char> world((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const auto stamp = scene.archive.texts("kernels/stamp"), names = scene.archive.texts("kernels/names");
  std::vector<ts_linked_kernel> rows = {{stamp[0].c_str(), nullptr}};
  for (const std::string& name : names) {
    rows.push_back({name.c_str(), name == "step" ? run_timed : reinterpret_cast<void (*)(void*)>(scene.kernel(name))});
  }
  rows.push_back({nullptr, nullptr});
  kernel_of_step = scene.kernel("step");
  return std::make_shared<Scene>(std::move(world), rows.data());
}

void print(const char* what, std::vector<double> numbers) {
  std::sort(numbers.begin(), numbers.end());
  std::printf("%-32s %9.3f %9.3f %9.3f\n", what, numbers.front(), numbers[numbers.size() / 2], numbers.back());
}

// Times consecutive steps. Each round begins with a new world.
void measure(const char* what, const std::shared_ptr<Scene>& scene, int rounds, int steps, int32_t events) {
  std::vector<double> own, ratios;
  for (int round = 0; round < rounds; ++round) {
    World world(scene);
    world.record_events(events);
    for (int i = 0; i < steps; ++i) {
      const Clock::time_point before = Clock::now();
      world.step(kDt, 0);
      const double took = microseconds_since(before);
      own.push_back(took - kernel_took);
      ratios.push_back(took / kernel_took);
    }
  }
  std::printf("%s\n", what);
  print("  all but the kernel [us]", own);
  print("  step over kernel", ratios);
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) return std::fprintf(stderr, "usage: cost FOLDER [ROUNDS [STEPS]]\n"), 2;
  const int rounds = count > 2 ? std::atoi(arguments[2]) : 30, steps = count > 3 ? std::atoi(arguments[3]) : 100;
  const Clock::time_point start = Clock::now();
  const auto opened = std::make_shared<Scene>(arguments[1]);
  std::printf("loaded in %.1f ms\n", microseconds_since(start) * 1e-3);
  const Clock::time_point loaded = Clock::now();
  World world(opened);
  std::printf("a world in %.1f ms\n", microseconds_since(loaded) * 1e-3);
  const auto scene = with_timed_step(*opened, arguments[1]);
  std::printf("%d rounds of %d steps                 least    median      most\n", rounds, steps);
  measure("no events", scene, rounds, steps, 0);
  measure("all events", scene, rounds, steps, TS_ALL_EVENTS);
}
