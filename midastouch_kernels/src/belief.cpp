// Moments of weighted poses.
#include "arrays.hpp"
#include "quaternion.hpp"

namespace {

Out<double> second_moment(In<float, -1, 3> positions, In<float, -1, 4> quaternions, In<double, -1> weights,
                          In<double, 3> centre, In<double, 4> turn) {
    const std::size_t n = weights.shape(0);
    if (positions.shape(0) != n || quaternions.shape(0) != n) throw nb::value_error("poses and weights of different sizes");
    auto out = make_array<double>({6, 6});
    nb::gil_scoped_release released;
    const double *c = centre.data(), *u = turn.data();
    double sums[6][6] = {};
    for (std::size_t i = 0; i < n; ++i) {
        const float *t = positions.data() + 3 * i, *q = quaternions.data() + 4 * i;
        double d[6];
        for (int a = 0; a < 3; ++a) d[a] = t[a] - c[a];
        rotation_vector(multiply(Quaternion<double>{q[0], q[1], q[2], q[3]},
                                 Quaternion<double>{-u[0], -u[1], -u[2], u[3]}),
                        d + 3);
        for (int a = 0; a < 6; ++a)
            for (int b = 0; b < 6; ++b) sums[a][b] += weights.data()[i] * d[a] * d[b];
    }
    for (int a = 0; a < 6; ++a)
        for (int b = 0; b < 6; ++b) out.data()[6 * a + b] = sums[a][b];
    return out;
}

}  // namespace

void bind_belief(nb::module_& m) {
    m.def("second_moment", &second_moment, named("positions"), named("quaternions"), named("weights"),
          named("centre"), named("turn"),
          "Sum (6, 6) of w d d', d = (position - centre, rotation vector from `turn` (4,)), fixed axes.");
}
