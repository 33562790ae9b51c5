// Numbers that fields depend on. Written by engine_adapter/native/write_fields.py from the declarations
// in Python: do not edit.
// clang-format off
#pragma once

#include <cstddef>

namespace taichi_soft {

constexpr size_t kLanes = 8;
constexpr double kNear = 64.0;
constexpr size_t kFrameWidth = 15;
constexpr size_t kRestWidth = 11;
constexpr size_t kMostGrabs = 16;
constexpr size_t kPatchRows = 128;
constexpr double kStrongest = 1e+20;
constexpr size_t kGrabCorners = 4;
constexpr size_t kMostJoints = 64;
constexpr size_t kJointRows = 2048;
constexpr size_t kJointEnds = 8;
constexpr double kSpread = 0.25;
constexpr size_t kMostMotors = 64;
constexpr size_t kMotorRows = 16384;
constexpr size_t kPairRows = 32;
constexpr double kFarthest = -0.5;
constexpr double kDraw = 0.25;
constexpr double kLargestLimit = 1000000000000.0;
constexpr double kThinnest = 0.001;

enum Status { kActive = 0, kFrozen = 1, kAsleep = 2, kSkipping = 3, kAbsent = 4, kDisabled = 5, kFrozenDisabled = 6 };
enum Drives { kMovesPins = 1, kFeelsReaction = 2, kDamped = 8, kSheltered = 16, kGrabbed = 32, kJoined = 64 };
enum Aims { kStill = 0, kToTarget = 1, kArrived = 2, kWithFrame = 3 };
enum Touched { kOfCollider = 0, kOfBody = 1 };
enum GridShapes { kHeightField = 4, kMeshShape = 5 };

}  // namespace taichi_soft
