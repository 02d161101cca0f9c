// Quaternions are xyzw and unit.
#pragma once

#include <cmath>

template <class T>
struct Quaternion {
    T x, y, z, w;
};

// Hamilton product a * b.
template <class T>
inline Quaternion<T> multiply(const Quaternion<T>& a, const Quaternion<T>& b) {
    return {
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    };
}

// Vector turned by the quaternion: v + 2 w (u x v) + 2 u x (u x v).
template <class T>
inline void rotate(const Quaternion<T>& q, T x, T y, T z, T* out) {
    const T tx = 2 * (q.y * z - q.z * y), ty = 2 * (q.z * x - q.x * z), tz = 2 * (q.x * y - q.y * x);
    out[0] = x + q.w * tx + q.y * tz - q.z * ty;
    out[1] = y + q.w * ty + q.z * tx - q.x * tz;
    out[2] = z + q.w * tz + q.x * ty - q.y * tx;
}

inline constexpr double kSeries = 0.04;  // squared sine up to which a series is exact, and faster than the library

// arcsin(s) / s of s * s = x <= kSeries.
inline double arcsine_ratio(double x) {
    constexpr double c[] = {1.0 / 6,       3.0 / 40,      5.0 / 112,       35.0 / 1152,      63.0 / 2816,
                            231.0 / 13312, 143.0 / 10240, 6435.0 / 557056, 12155.0 / 1245184};
    double sum = 0;
    for (int i = 8; i >= 0; --i) sum = (sum + c[i]) * x;
    return 1 + sum;
}

// Rotation vector, the shorter way round: angle in [0, pi].
inline void rotation_vector(const Quaternion<double>& q, double* out) {
    const double squared = q.x * q.x + q.y * q.y + q.z * q.z, sine = std::sqrt(squared);
    double scale = 2 * (squared < kSeries ? arcsine_ratio(squared) : std::atan2(sine, std::abs(q.w)) / sine);
    if (q.w < 0) scale = -scale;
    out[0] = scale * q.x, out[1] = scale * q.y, out[2] = scale * q.z;
}

// Rotation matrix (3, 3) with rows `stride` apart.
inline void to_matrix(const Quaternion<double>& q, double* r, int stride = 3) {
    const double x = q.x, y = q.y, z = q.z, w = q.w;
    r[0] = 1 - 2 * (y * y + z * z), r[1] = 2 * (x * y - z * w), r[2] = 2 * (x * z + y * w);
    r += stride;
    r[0] = 2 * (x * y + z * w), r[1] = 1 - 2 * (x * x + z * z), r[2] = 2 * (y * z - x * w);
    r += stride;
    r[0] = 2 * (x * z - y * w), r[1] = 2 * (y * z + x * w), r[2] = 1 - 2 * (x * x + y * y);
}

// Quaternion of a rotation matrix with rows `stride` apart, by its largest component (Shepperd 1978).
inline Quaternion<double> from_matrix(const double* matrix, int stride = 3) {
    auto r = [&](int i, int j) { return matrix[i * stride + j]; };
    const double trace = r(0, 0) + r(1, 1) + r(2, 2);
    double largest = trace, q[4];
    int k = 3;
    for (int i = 0; i < 3; ++i)
        if (r(i, i) > largest) largest = r(i, i), k = i;
    if (k == 3) {
        q[3] = 1 + trace;
        q[0] = r(2, 1) - r(1, 2), q[1] = r(0, 2) - r(2, 0), q[2] = r(1, 0) - r(0, 1);
    } else {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        q[k] = 1 + r(k, k) - r(i, i) - r(j, j);
        q[i] = r(i, k) + r(k, i), q[j] = r(j, k) + r(k, j);
        q[3] = r(j, i) - r(i, j);
    }
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    return {q[0] / length, q[1] / length, q[2] / length, q[3] / length};
}
