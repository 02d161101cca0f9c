// Gaussians over poses: a mean, and a covariance of [translation, rotation] in the mean's own frame.
#pragma once

#include "cholesky.hpp"
#include "tangent.hpp"

struct Gaussian {
    Transform mean;
    Matrix6 covariance;
};

inline Matrix6 product(const Matrix6& a, const Matrix6& b) {
    Matrix6 out{};
    for (int i = 0; i < 6; ++i)
        for (int k = 0; k < 6; ++k)
            for (int j = 0; j < 6; ++j) out[6 * i + j] += a[6 * i + k] * b[6 * k + j];
    return out;
}

inline Matrix6 transposed(const Matrix6& a) {
    Matrix6 out;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) out[6 * i + j] = a[6 * j + i];
    return out;
}

inline Vector6 product(const Matrix6& a, const Vector6& b) {
    Vector6 out{};
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) out[i] += a[6 * i + j] * b[j];
    return out;
}

// a + factor (b - a), to the symmetric part of it.
inline Matrix6 between(const Matrix6& a, const Matrix6& b, double factor) {
    Matrix6 out;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) {
            const int here = 6 * i + j, there = 6 * j + i;
            out[here] = 0.5 * (a[here] + a[there] + factor * (b[here] + b[there] - a[here] - a[there]));
        }
    return out;
}

// Takes a tangent vector of a pose's own frame to the frame that went on by `motion`.
inline Matrix6 adjoint(const Transform& motion) {
    const Transform back = inverse(motion);
    const double x = back[3], y = back[7], z = back[11];
    const double cross[9] = {0, -z, y, z, 0, -x, -y, x, 0};
    Matrix6 out{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            out[6 * i + j] = out[6 * (i + 3) + j + 3] = back[4 * i + j];
            for (int k = 0; k < 3; ++k) out[6 * i + j + 3] += cross[3 * i + k] * back[4 * k + j];
        }
    return out;
}

inline Matrix6 sum_of(Matrix6 a, const Matrix6& b) {
    for (int i = 0; i < 36; ++i) a[i] += b[i];
    return a;
}

// The same Gaussian of a frame that went on by `motion`.
inline Gaussian moved(const Gaussian& before, const Transform& motion) {
    const Matrix6 on = adjoint(motion);
    return {before.mean * motion, product(product(on, before.covariance), transposed(on))};
}

// `prior`, where the sum of it and of an error N(0, jitter) turned out to be `posterior`.
inline Gaussian condition(const Gaussian& prior, const Matrix6& jitter, const Gaussian& posterior) {
    const Matrix6 total = sum_of(prior.covariance, jitter);
    const Matrix6 gain = product(prior.covariance, Cholesky(total).inverse());
    const Vector6 offset = product(gain, logarithm(inverse(prior.mean) * posterior.mean));
    Matrix6 less = posterior.covariance;
    for (int i = 0; i < 36; ++i) less[i] -= total[i];
    const Matrix6 left = sum_of(product(product(gain, less), transposed(gain)), prior.covariance);
    return {prior.mean * exponential(offset), between(left, left, 0)};
}

// `prior` with `factor` times the information that made it `posterior`.
inline Gaussian weaken(const Gaussian& prior, const Gaussian& posterior, double factor) {
    const Matrix6 before = Cholesky(prior.covariance).inverse();
    const Matrix6 total = Cholesky(posterior.covariance).inverse();
    const Matrix6 wider = Cholesky(between(before, total, factor)).inverse();
    Vector6 pull = product(total, logarithm(inverse(prior.mean) * posterior.mean));
    for (double& each : pull) each *= factor;
    return {prior.mean * exponential(product(wider, pull)), wider};
}
