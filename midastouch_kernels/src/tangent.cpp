// SE(3) for batches of transforms.
#include "tangent.hpp"

#include "arrays.hpp"

#include <algorithm>

namespace {

Out<double> exponentials(In<double, -1, 6> vectors) {
    const std::size_t n = vectors.shape(0);
    auto out = make_array<double>({n, 4, 4});
    for (std::size_t i = 0; i < n; ++i) {
        Vector6 xi;
        std::copy_n(vectors.data() + 6 * i, 6, xi.begin());
        const Transform t = exponential(xi);
        std::copy_n(t.begin(), 16, out.data() + 16 * i);
    }
    return out;
}

Out<double> inverses(In<double, -1, 4, 4> transforms) {
    const std::size_t n = transforms.shape(0);
    auto out = make_array<double>({n, 4, 4});
    for (std::size_t i = 0; i < n; ++i) {
        Transform t;
        std::copy_n(transforms.data() + 16 * i, 16, t.begin());
        const Transform back = inverse(t);
        std::copy_n(back.begin(), 16, out.data() + 16 * i);
    }
    return out;
}

Out<double> logarithms(In<double, -1, 4, 4> transforms) {
    const std::size_t n = transforms.shape(0);
    auto out = make_array<double>({n, 6});
    for (std::size_t i = 0; i < n; ++i) {
        Transform t;
        std::copy_n(transforms.data() + 16 * i, 16, t.begin());
        const Vector6 xi = logarithm(t);
        std::copy_n(xi.begin(), 6, out.data() + 6 * i);
    }
    return out;
}

Out<double> quaternions(In<double, -1, 4, 4> transforms) {
    const std::size_t n = transforms.shape(0);
    auto out = make_array<double>({n, 4});
    for (std::size_t i = 0; i < n; ++i) {
        const Quaternion<double> q = from_matrix(transforms.data() + 16 * i, 4);
        const double values[4] = {q.x, q.y, q.z, q.w};
        std::copy_n(values, 4, out.data() + 4 * i);
    }
    return out;
}

}  // namespace

void bind_tangent(nb::module_& m) {
    m.def("exponentials", &exponentials, named("vectors"), "Transforms (N, 4, 4) of tangent vectors (N, 6).");
    m.def("inverses", &inverses, named("transforms"), "Inverses (N, 4, 4) of rigid transforms.");
    m.def("logarithms", &logarithms, named("transforms"),
          "Tangent vectors (N, 6) of transforms (N, 4, 4); angles in [0, pi].");
    m.def("quaternions", &quaternions, named("transforms"), "Unit quaternions (N, 4) xyzw of transforms (N, 4, 4).");
}
