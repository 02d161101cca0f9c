// Gaussians over poses: mean (4, 4), covariance (6, 6) of [translation, rotation] in the mean's own frame.
#include "arrays.hpp"
#include "cholesky.hpp"
#include "tangent.hpp"

#include <algorithm>

namespace {

template <class Item>
Item item_at(const double* from) {
    Item out;
    std::copy_n(from, out.size(), out.begin());
    return out;
}

template <class Item>
Out<double> given(const Item& item, std::size_t rows) {
    auto out = make_array<double>({rows, rows});
    std::copy(item.begin(), item.end(), out.data());
    return out;
}

Matrix6 product(const Matrix6& a, const Matrix6& b) {
    Matrix6 out{};
    for (int i = 0; i < 6; ++i)
        for (int k = 0; k < 6; ++k)
            for (int j = 0; j < 6; ++j) out[6 * i + j] += a[6 * i + k] * b[6 * k + j];
    return out;
}

Matrix6 transposed(const Matrix6& a) {
    Matrix6 out;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) out[6 * i + j] = a[6 * j + i];
    return out;
}

Vector6 product(const Matrix6& a, const Vector6& b) {
    Vector6 out{};
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) out[i] += a[6 * i + j] * b[j];
    return out;
}

// a + factor (b - a), to the symmetric part of it.
Matrix6 between(const Matrix6& a, const Matrix6& b, double factor) {
    Matrix6 out;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) {
            const int here = 6 * i + j, there = 6 * j + i;
            out[here] = 0.5 * (a[here] + a[there] + factor * (b[here] + b[there] - a[here] - a[there]));
        }
    return out;
}

Matrix6 adjoint(const Transform& motion) {
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

Out<double> transform_covariances(In<double, -1, 6, 6> covariances, In<double, 4, 4> motion) {
    auto out = make_array<double>({covariances.shape(0), 6, 6});
    const Matrix6 on = adjoint(item_at<Transform>(motion.data())), back = transposed(on);
    for (std::size_t i = 0; i < covariances.shape(0); ++i) {
        const Matrix6 moved = product(product(on, item_at<Matrix6>(covariances.data() + 36 * i)), back);
        std::copy(moved.begin(), moved.end(), out.data() + 36 * i);
    }
    return out;
}

// Mean and covariance, each an array.
using Gaussian = nb::tuple;

Gaussian condition(In<double, 4, 4> pose, In<double, 6, 6> prior, In<double, 6, 6> jitter, In<double, 4, 4> mean,
                   In<double, 6, 6> posterior) {
    const auto own = item_at<Matrix6>(prior.data());
    Matrix6 total = item_at<Matrix6>(jitter.data());
    for (int i = 0; i < 36; ++i) total[i] += own[i];
    const Matrix6 gain = product(own, Cholesky(total).inverse());
    const auto centre = item_at<Transform>(pose.data());
    const Vector6 offset = product(gain, logarithm(inverse(centre) * item_at<Transform>(mean.data())));
    Matrix6 less = item_at<Matrix6>(posterior.data());
    for (int i = 0; i < 36; ++i) less[i] -= total[i];
    Matrix6 left = product(product(gain, less), transposed(gain));
    for (int i = 0; i < 36; ++i) left[i] += own[i];
    return nb::make_tuple(given(centre * exponential(offset), 4), given(between(left, left, 0), 6));
}

Gaussian weaken(In<double, 4, 4> pose, In<double, 6, 6> prior, In<double, 4, 4> mean, In<double, 6, 6> posterior,
                double factor) {
    const Matrix6 before = Cholesky(item_at<Matrix6>(prior.data())).inverse();
    const Matrix6 total = Cholesky(item_at<Matrix6>(posterior.data())).inverse();
    const Matrix6 wider = Cholesky(between(before, total, factor)).inverse();
    const auto centre = item_at<Transform>(pose.data());
    Vector6 pull = product(total, logarithm(inverse(centre) * item_at<Transform>(mean.data())));
    for (double& each : pull) each *= factor;
    return nb::make_tuple(given(centre * exponential(product(wider, pull)), 4), given(wider, 6));
}

}  // namespace

void bind_gaussian(nb::module_& m) {
    m.def("transform_covariances", &transform_covariances, named("covariances"), named("motion"),
          "Covariances (N, 6, 6) of a pose's own frame after the frame went on by `motion` (4, 4).");
    m.def("condition", &condition, named("pose"), named("prior"), named("jitter"), named("mean"), named("posterior"),
          "Mean (4, 4) and covariance (6, 6) of N(pose, prior), where the sum of it and of an error N(0, jitter) turned\n"
          "out to be N(mean, posterior).");
    m.def("weaken", &weaken, named("pose"), named("prior"), named("mean"), named("posterior"), nb::arg("factor"),
          "Mean (4, 4) and covariance (6, 6) of N(pose, prior) with `factor` times the information that made it\n"
          "N(mean, posterior).");
}
