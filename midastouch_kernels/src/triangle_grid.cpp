// Which triangles may lie in which cell of a uniform grid.
#include "arrays.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

nb::tuple fill_cells(In<double, -1, 3, 3> corners, In<double, 3> origin, double cell, In<int64_t, 3> shape) {
    const std::size_t n = corners.shape(0);
    const int64_t *size = shape.data();
    auto start = make_array<int64_t>({static_cast<std::size_t>(size[0] * size[1] * size[2] + 1)});
    int64_t* first = start.data();
    // calls visit(c) for each cell c that the bounding box of triangle f meets
    auto for_cells = [&](std::size_t f, auto&& visit) {
        int64_t low[3], high[3];
        for (int k = 0; k < 3; ++k) {
            const double* c = corners.data() + 9 * f + k;
            const double least = std::min({c[0], c[3], c[6]}), most = std::max({c[0], c[3], c[6]});
            low[k] = std::clamp<int64_t>(std::floor((least - origin.data()[k]) / cell), 0, size[k] - 1);
            high[k] = std::clamp<int64_t>(std::floor((most - origin.data()[k]) / cell), 0, size[k] - 1);
        }
        for (int64_t x = low[0]; x <= high[0]; ++x)
            for (int64_t y = low[1]; y <= high[1]; ++y)
                for (int64_t z = low[2]; z <= high[2]; ++z) visit((x * size[1] + y) * size[2] + z);
    };
    for (std::size_t f = 0; f < n; ++f) for_cells(f, [&](int64_t c) { ++first[c + 1]; });
    for (std::size_t i = 1; i < start.size(); ++i) first[i] += first[i - 1];
    auto items = make_array<int32_t>({static_cast<std::size_t>(first[start.size() - 1])});
    std::vector<int64_t> next(first, first + start.size() - 1);
    for (std::size_t f = 0; f < n; ++f)
        for_cells(f, [&](int64_t c) { items.data()[next[c]++] = static_cast<int32_t>(f); });
    return nb::make_tuple(start, items);
}

}  // namespace

void bind_triangle_grid(nb::module_& m) {
    m.def("fill_cells", &fill_cells, named("corners"), named("origin"), nb::arg("cell"), named("shape"),
          "Cells of triangles (F, 3, 3): those of cell c (x-major) are items[start[c]:start[c + 1]].");
}
