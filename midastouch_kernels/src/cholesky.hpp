// Symmetric positive definite systems of six unknowns, by their Cholesky factor.
#pragma once

#include "tangent.hpp"

#include <array>
#include <cmath>
#include <stdexcept>

using Matrix6 = std::array<double, 36>;

class Cholesky {
public:
    // Of the lower triangle of a matrix. Throws std::domain_error if that is not positive definite.
    explicit Cholesky(const Matrix6& matrix) {
        for (int i = 0; i < 6; ++i)
            for (int j = 0; j <= i; ++j) {
                double sum = matrix[6 * i + j];
                for (int k = 0; k < j; ++k) sum -= factor_[6 * i + k] * factor_[6 * j + k];
                if (i != j) {
                    factor_[6 * i + j] = sum / factor_[7 * j];
                } else {
                    if (!(sum > 0)) throw std::domain_error("a covariance that is not positive definite");
                    factor_[7 * i] = std::sqrt(sum);
                }
            }
    }

    Vector6 solve(Vector6 b) const {
        for (int i = 0; i < 6; ++i) {
            for (int k = 0; k < i; ++k) b[i] -= factor_[6 * i + k] * b[k];
            b[i] /= factor_[7 * i];
        }
        for (int i = 5; i >= 0; --i) {
            for (int k = i + 1; k < 6; ++k) b[i] -= factor_[6 * k + i] * b[k];
            b[i] /= factor_[7 * i];
        }
        return b;
    }

    Matrix6 inverse() const {
        Matrix6 out{};
        for (int j = 0; j < 6; ++j) {
            Vector6 unit{};
            unit[j] = 1;
            const Vector6 column = solve(unit);
            for (int i = 0; i < 6; ++i) out[6 * i + j] = column[i];
        }
        for (int i = 0; i < 6; ++i)  // exactly symmetric
            for (int j = 0; j < i; ++j) out[6 * i + j] = out[6 * j + i] = 0.5 * (out[6 * i + j] + out[6 * j + i]);
        return out;
    }

private:
    Matrix6 factor_{};
};
