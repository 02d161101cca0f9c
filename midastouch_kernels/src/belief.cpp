// Moments of weighted poses.
#include "arrays.hpp"
#include "quaternion.hpp"

namespace {

// Mass of the particles outside of mode 0, and the mean (6, 6) of d d' over them, d = (position, rotation vector) from
// `centre` [x y z qx qy qz qw] in fixed axes. At most about `most` of them are looked at, every n-th: systematic
// sampling.
nb::tuple second_moment(In<float, -1, 3> positions, In<float, -1, 4> quaternions, In<double, -1> weights,
                        In<int32_t, -1> members, In<double, 7> centre, std::size_t most) {
    const std::size_t n = weights.shape(0);
    if (positions.shape(0) != n || quaternions.shape(0) != n || members.shape(0) != n)
        throw nb::value_error("poses, weights and members of different sizes");
    if (!most) throw nb::value_error("no particle to look at");
    auto out = make_array<double>({6, 6});
    double mass = 0;
    {
        nb::gil_scoped_release released;
        std::size_t count = 0;
        for (std::size_t i = 0; i < n; ++i) {  // without a branch, that nobody could predict
            const bool other = members.data()[i] != 0;
            mass += other ? weights.data()[i] : 0.0, count += other;
        }
        const std::size_t every = count / most > 1 ? count / most : 1;
        const double* c = centre.data();
        double sums[6][6] = {}, sampled = 0;
        for (std::size_t i = 0, left = 1; i < n; ++i) {
            left -= members.data()[i] != 0;
            if (left) continue;
            left = every;
            if (!(weights.data()[i] > 0)) continue;
            const float *t = positions.data() + 3 * i, *q = quaternions.data() + 4 * i;
            const double w = weights.data()[i];
            double d[6];
            for (int a = 0; a < 3; ++a) d[a] = t[a] - c[a];
            rotation_vector(multiply(Quaternion<double>{q[0], q[1], q[2], q[3]},
                                     Quaternion<double>{-c[3], -c[4], -c[5], c[6]}),
                            d + 3);
            sampled += w;
            for (int a = 0; a < 6; ++a)
                for (int b = 0; b < 6; ++b) sums[a][b] += w * d[a] * d[b];
        }
        for (int a = 0; a < 6; ++a)
            for (int b = 0; b < 6; ++b) out.data()[6 * a + b] = sampled > 0 ? sums[a][b] / sampled : 0;
        if (!(sampled > 0)) mass = 0;
    }
    return nb::make_tuple(mass, out);
}

}  // namespace

void bind_belief(nb::module_& m) {
    m.def("second_moment", &second_moment, named("positions"), named("quaternions"), named("weights"),
          named("members"), named("centre"), nb::arg("most"),
          "Mass of the particles outside of mode 0, and the mean (6, 6) of d d' over them, d = (position, rotation "
          "vector) from `centre` (7,), fixed axes.");
}
