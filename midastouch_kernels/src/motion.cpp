// Motion of particles: odometry and noise.
#include "arrays.hpp"
#include "noise.hpp"
#include "quaternion.hpp"

#include <algorithm>
#include <cmath>

namespace {

// How far (4, 4) is from a rigid transform, its row [x y z qx qy qz qw], and that row as a transform.
nb::tuple decompose(In<double, 4, 4> transform) {
    const double* t = transform.data();
    auto r = [&](int i, int j) { return t[4 * i + j]; };
    double error = std::max({std::abs(t[12]), std::abs(t[13]), std::abs(t[14]), std::abs(t[15] - 1)});
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const double dot = r(0, i) * r(0, j) + r(1, i) * r(1, j) + r(2, i) * r(2, j);
            error = std::max(error, std::abs(dot - (i == j)));
        }
    const double determinant = r(0, 0) * (r(1, 1) * r(2, 2) - r(1, 2) * r(2, 1)) -
                               r(0, 1) * (r(1, 0) * r(2, 2) - r(1, 2) * r(2, 0)) +
                               r(0, 2) * (r(1, 0) * r(2, 1) - r(1, 1) * r(2, 0));
    auto row = make_array<double>({7}), rigid = make_array<double>({4, 4});
    const Quaternion<double> q = from_matrix(t, 4);
    const double values[7] = {r(0, 3), r(1, 3), r(2, 3), q.x, q.y, q.z, q.w};
    std::copy_n(values, 7, row.data());
    to_matrix(q, rigid.data(), 4);
    for (int i = 0; i < 3; ++i) rigid.data()[4 * i + 3] = r(i, 3);
    rigid.data()[15] = 1;
    return nb::make_tuple(determinant > 0 ? error : INFINITY, row, rigid);
}

// Move by `step` [x y z qx qy qz qw]; then each by noise of its own, of widths `scale` (6,), unless `noise` is null.
void compose(std::size_t low, std::size_t high, InOut<float, -1, 3> positions, InOut<float, -1, 4> quaternions,
             In<float, 7> step, In<float, 6> scale, NormalStream* noise) {
    if (low > high || high > positions.shape(0) || high > quaternions.shape(0))
        throw nb::value_error("range beyond the particles");
    nb::gil_scoped_release released;
    const float *s = step.data(), *width = scale.data();
    const Quaternion<float> turn{s[3], s[4], s[5], s[6]};
    for (std::size_t block = low; block < high; block += kLanes) {
        Lanes drawn[6] = {};
        if (noise)
            for (int a = 0; a < 6; a += 2) noise->draw(drawn[a], drawn[a + 1]);
        for (int a = 0; a < 6; ++a) drawn[a] *= width[a];
        for (std::size_t i = block; i < std::min(block + kLanes, high); ++i) {
            const std::size_t l = i - block;
            float *t = positions.data() + 3 * i, *r = quaternions.data() + 4 * i, moved[3];
            Quaternion<float> q{r[0], r[1], r[2], r[3]};
            rotate(q, s[0], s[1], s[2], moved);
            for (int a = 0; a < 3; ++a) t[a] += moved[a];
            q = multiply(q, turn);
            if (noise) {
                rotate(q, drawn[0][l], drawn[1][l], drawn[2][l], moved);
                for (int a = 0; a < 3; ++a) t[a] += moved[a];
                q = multiply(q, Quaternion<float>{drawn[3][l], drawn[4][l], drawn[5][l], 1.0f});
            }
            const float shrink = 1 / std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
            r[0] = q.x * shrink, r[1] = q.y * shrink, r[2] = q.z * shrink, r[3] = q.w * shrink;
        }
    }
}

}  // namespace

void bind_motion(nb::module_& m) {
    m.def("decompose", &decompose, named("transform"),
          "How far a transform (4, 4) is from a rigid one, its row [x y z qx qy qz qw], and that row as a transform.");
    nb::class_<NormalStream>(m, "NormalStream", "Normal random numbers; equal seeds give equal ones.")
        .def(nb::init<uint64_t>(), nb::arg("seed"));
    m.def("compose", &compose, nb::arg("low"), nb::arg("high"), named("positions"), named("quaternions"), named("step"),
          named("scale"), nb::arg("noise").none(),
          "Move poses [low, high) by a step (7,), then each by noise of widths `scale` (6,), unless that is None.");
}
