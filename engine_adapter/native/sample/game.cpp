// Sample of a game loop in which a ball falls onto a lift every second: game FOLDER [SECONDS]
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "taichi_soft.hpp"

using taichi_soft::Body;
using taichi_soft::Pose;

int main(int count, char** arguments) {
  if (count < 2) return std::fprintf(stderr, "usage: game FOLDER [SECONDS]\n"), 2;
  const double seconds = count > 2 ? std::atof(arguments[2]) : 4.0;
  try {
    taichi_soft::Scene scene(arguments[1]);
    taichi_soft::World world = scene.create();
    const int32_t ball = scene.find(TS_ASSET, "ball"), lift = scene.find(TS_COLLIDER, "lift");
    const int32_t skin = scene.find(TS_MESH, "ball.surface");
    const std::vector<uint32_t> index_buffer = scene.triangles(skin);
    std::vector<float> vertices(3 * size_t(scene.mesh(skin).vertex_count)), normals(vertices.size());

    world.record_events(TS_CONTACT_BEGAN);
    std::vector<ts_event> events;
    int touches = 0;
    int64_t step = 0;
    std::vector<Body> balls = {world.body(scene.find(TS_BODY, "first"))};
    world.on_step([&] {  // called once per step, independent of the frame rate
      const double time = double(step++) / 60.0;
      world.move_collider(lift, {{0.0, 0.0, 0.4 - 0.3 * std::cos(time)}, {0.0, 0.0, 0.0, 1.0}});
      if (step % 60 == 0 && balls.size() < 6) balls.push_back(world.spawn(ball, {{0.05, 0.0, 2.0}, {0, 0, 0, 1}}));
    });

    const double frame = 1.0 / 50.0;  // in a game, the time since the last frame
    for (int i = 0; i * frame < seconds; ++i) {
      const ts_clock clock = world.advance(frame);
      for (Body each : balls) world.mesh(each, skin, vertices, normals);  // draw them with index_buffer
      world.drain_events(events);
      for (const ts_event& each : events) touches += each.collider == lift;  // or play a sound, as loud as each.impulse
      if (i % 50 != 0) continue;
      const auto [impulse, moment] = world.collider_impulse(lift);
      std::printf("%.2f s: %zu ball%s of %zu triangles, the first at %.3f m; the lift feels %.1f N, touched %d times\n",
                  clock.time, balls.size(), balls.size() == 1 ? "" : "s", index_buffer.size() / 3, world.center(balls[0])[2],
                  impulse[2] * -60.0 + 0.0, touches);
    }
    std::printf("state %016llx\n", static_cast<unsigned long long>(world.hash()));
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "error: %s\n", error.what()), 1;
  }
}
