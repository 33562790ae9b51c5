// What a step of the library takes over the kernel's own time, in turns: cost FOLDER [ROUNDS [STEPS]]
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "../src/world.hpp"

using namespace taichi_soft;
using Clock = std::chrono::steady_clock;

namespace {

constexpr double kDt = 1.0 / 60.0;

double microseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

void print(const char* what, std::vector<double> numbers) {
  std::sort(numbers.begin(), numbers.end());
  std::printf("%-28s %9.3f %9.3f %9.3f\n", what, numbers.front(), numbers[numbers.size() / 2], numbers.back());
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) return std::fprintf(stderr, "usage: cost FOLDER [ROUNDS [STEPS]]\n"), 2;
  const int rounds = count > 2 ? std::atoi(arguments[2]) : 30, steps = count > 3 ? std::atoi(arguments[3]) : 100;
  const Clock::time_point start = Clock::now();
  const auto scene = std::make_shared<Scene>(arguments[1]);
  std::printf("loaded in %.1f ms\n", microseconds_since(start) * 1e-3);
  const Clock::time_point loaded = Clock::now();
  World world(scene);
  std::printf("a world in %.1f ms\n", microseconds_since(loaded) * 1e-3);
  // The same kernel with memory of its own, launched with nothing round it.
  const auto machine = std::make_unique<Machine>(*scene);
  const int32_t substeps = world.stable_substeps(kDt), bodies = scene->slot_count;
  std::vector<Argument> call = {Machine::whole(bodies)};
  if (scene->has_contact) call.push_back(Machine::whole(std::min(machine->threads.most(), bodies) - 1));
  call.insert(call.end(), {Machine::whole(substeps), Machine::real(kDt / substeps), Machine::whole(2147483647),
                           Machine::whole(0)});
  std::vector<double> ratios, own, whole;
  for (int round = 0; round < rounds; ++round) {
    double least[2] = {1e30, 1e30};
    for (int i = 0; i < steps; ++i) {
      const Clock::time_point before = Clock::now();
      machine->launch("step", call);
      least[0] = std::min(least[0], microseconds_since(before));
      const Clock::time_point middle = Clock::now();
      world.step(kDt, 0);
      least[1] = std::min(least[1], microseconds_since(middle));
    }
    own.push_back(least[0]);
    whole.push_back(least[1]);
    ratios.push_back(least[1] / least[0]);
  }
  std::printf("%d substeps                    least    median      most\n", substeps);
  print("kernel [us]", own);
  print("step of the library [us]", whole);
  print("step over kernel", ratios);
}
