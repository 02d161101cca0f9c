// SE(3): exponential, logarithm and products of transforms (4, 4). Tangent vectors are [rho, omega].
#pragma once

#include "quaternion.hpp"

#include <array>
#include <cmath>

using Transform = std::array<double, 16>;
using Vector6 = std::array<double, 6>;

inline constexpr double kSmallAngle = 1e-4;  // rad: series instead of quotients of small numbers

// a I + b W + c W^2 of the cross-product matrix W of w, row-major (3, 3).
inline std::array<double, 9> rotation_series(const double* w, double a, double b, double c) {
    const double x = w[0], y = w[1], z = w[2], squared = x * x + y * y + z * z;
    // W^2 = w w' - |w|^2 I
    const double diagonal = a - c * squared;
    return {diagonal + c * x * x, c * x * y - b * z, c * x * z + b * y, c * x * y + b * z,   diagonal + c * y * y,
            c * y * z - b * x,    c * x * z - b * y, c * y * z + b * x, diagonal + c * z * z};
}

inline Transform exponential(const Vector6& xi) {
    const double* w = xi.data() + 3;
    const double squared = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], angle = std::sqrt(squared);
    double a, b, c;
    if (angle < kSmallAngle)
        a = 1 - squared / 6, b = 0.5 - squared / 24, c = 1.0 / 6 - squared / 120;
    else
        a = std::sin(angle) / angle, b = (1 - std::cos(angle)) / squared,
        c = (angle - std::sin(angle)) / (squared * angle);
    const auto r = rotation_series(w, 1, a, b), v = rotation_series(w, 1, b, c);
    Transform out{};
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) out[4 * i + j] = r[3 * i + j], out[4 * i + 3] += v[3 * i + j] * xi[j];
    }
    out[15] = 1;
    return out;
}

// Angle in [0, pi].
inline Vector6 logarithm(const Transform& t) {
    const Quaternion<double> q = from_matrix(t.data(), 4);
    Vector6 out{};
    rotation_vector(q, out.data() + 3);
    const double* w = out.data() + 3;
    const double angle = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), half = angle / 2;
    const double d = angle < kSmallAngle ? 1.0 / 12 + angle * angle / 720
                                         : (1 - half * std::cos(half) / std::sin(half)) / (angle * angle);
    const auto v = rotation_series(w, 1, -0.5, d);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out[i] += v[3 * i + j] * t[4 * j + 3];
    return out;
}

inline Transform inverse(const Transform& t) {
    Transform out{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out[4 * i + j] = t[4 * j + i], out[4 * i + 3] -= t[4 * j + i] * t[4 * j + 3];
    out[15] = 1;
    return out;
}

inline Transform operator*(const Transform& a, const Transform& b) {
    Transform out{};
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            for (int k = 0; k < 4; ++k) out[4 * i + j] += a[4 * i + k] * b[4 * k + j];
    return out;
}
