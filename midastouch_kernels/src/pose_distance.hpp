// Squared distance between poses [m^2]: |t - t'|^2 + (2 r sin(angle / 2))^2, where 1 rad counts as r = 10 mm.
#pragma once

#include "lanes.hpp"

inline constexpr float kRotationScale = 0.01f;
inline constexpr int kRecord =
    kLanes;  // floats of a pose record: position, one left to who keeps the records, quaternion

inline float squared_pose_distance(const float* position, const float* quaternion, const float* record) {
    const float dx = position[0] - record[0], dy = position[1] - record[1], dz = position[2] - record[2];
    const float dot =
        quaternion[0] * record[4] + quaternion[1] * record[5] + quaternion[2] * record[6] + quaternion[3] * record[7];
    // (2 sin(a / 2))^2 = 4 (1 - (q.q')^2)
    return dx * dx + dy * dy + dz * dz + 4 * kRotationScale * kRotationScale * (1 - dot * dot);
}
