// SE(3) for batches of transforms.
#include "tangent.hpp"

#include "arrays.hpp"

#include <algorithm>
#include <array>
#include <initializer_list>

namespace {

// The function's results, arrays, one after the other, for items (shape[0], size of an Item).
template <class Item, class Function>
Out<double> of_each(const double* items, std::initializer_list<std::size_t> shape, Function function) {
    auto out = make_array<double>(shape);
    double* to = out.data();
    for (std::size_t i = 0; i < *shape.begin(); ++i) {
        Item item;
        std::copy_n(items + i * item.size(), item.size(), item.begin());
        const auto result = function(item);
        to = std::copy(result.begin(), result.end(), to);
    }
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

}  // namespace

void bind_tangent(nb::module_& m) {
    m.def("exponentials", &exponentials, named("vectors"), "Transforms (N, 4, 4) of tangent vectors (N, 6).");
    m.def("inverses", &inverses, named("transforms"), "Inverses (N, 4, 4) of rigid transforms.");
    m.def("logarithms", &logarithms, named("transforms"),
          "Tangent vectors (N, 6) of transforms (N, 4, 4); angles in [0, pi].");
    m.def("quaternions", &quaternions, named("transforms"), "Unit quaternions (N, 4) xyzw of transforms (N, 4, 4).");
}
