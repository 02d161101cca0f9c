// SE(3) for batches of transforms, and of covariances of poses.
#include "tangent.hpp"

#include "arrays.hpp"
#include "gaussian.hpp"

#include <array>
#include <initializer_list>

namespace {

// The function's results, arrays, one after the other, for items (shape[0], size of an Item).
template <class Item, class Function>
Out<double> of_each(const double* items, std::initializer_list<std::size_t> shape, Function function) {
    auto out = make_array<double>(shape);
    for (std::size_t i = 0; i < *shape.begin(); ++i) put(function(item_at<Item>(items, i)), out.data(), i);
    return out;
}

Out<double> exponentials(In<double, -1, 6> vectors) {
    return of_each<Vector6>(vectors.data(), {vectors.shape(0), 4, 4},
                            [](const Vector6& xi) { return exponential(xi); });
}

Out<double> inverses(In<double, -1, 4, 4> transforms) {
    return of_each<Transform>(transforms.data(), {transforms.shape(0), 4, 4},
                              [](const Transform& t) { return inverse(t); });
}

Out<double> logarithms(In<double, -1, 4, 4> transforms) {
    return of_each<Transform>(transforms.data(), {transforms.shape(0), 6},
                              [](const Transform& t) { return logarithm(t); });
}

Out<double> quaternions(In<double, -1, 4, 4> transforms) {
    return of_each<Transform>(transforms.data(), {transforms.shape(0), 4}, [](const Transform& t) {
        const Quaternion<double> q = from_matrix(t.data(), 4);
        return std::array{q.x, q.y, q.z, q.w};
    });
}

Out<double> transform_covariances(In<double, -1, 6, 6> covariances, In<double, 4, 4> motion) {
    const Matrix6 on = adjoint(item_at<Transform>(motion.data(), 0)), back = transposed(on);
    return of_each<Matrix6>(covariances.data(), {covariances.shape(0), 6, 6},
                            [&](const Matrix6& before) { return product(product(on, before), back); });
}

}  // namespace

void bind_tangent(nb::module_& m) {
    m.def("exponentials", &exponentials, named("vectors"), "Transforms (N, 4, 4) of tangent vectors (N, 6).");
    m.def("inverses", &inverses, named("transforms"), "Inverses (N, 4, 4) of rigid transforms.");
    m.def("logarithms", &logarithms, named("transforms"),
          "Tangent vectors (N, 6) of transforms (N, 4, 4); angles in [0, pi].");
    m.def("quaternions", &quaternions, named("transforms"), "Unit quaternions (N, 4) xyzw of transforms (N, 4, 4).");
    m.def("transform_covariances", &transform_covariances, named("covariances"), named("motion"),
          "Covariances (N, 6, 6) of a pose's own frame after the frame went on by `motion` (4, 4).");
}
