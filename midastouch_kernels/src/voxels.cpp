// Which sparse voxels lie at the offsets of a cubic kernel.
#include "arrays.hpp"

#include <algorithm>

namespace {

constexpr int64_t kWidest = 10;

// Keys are sorted, so the voxels of one kernel row (equal y and z) follow each other and move on with the centre: a
// merge of two sorted lists for each row, which needs no hash table.
Out<int32_t> neighbours(In<int64_t, -1> keys, int64_t width, int64_t plane, int64_t radius) {
    if (radius < 0 || radius > kWidest) throw nb::value_error("a kernel of this radius is not supported");
    const int64_t n = keys.shape(0), side = 2 * radius + 1;
    const int64_t* key = keys.data();
    if (!std::is_sorted(key, key + n)) throw nb::value_error("keys must be sorted");
    auto rows = make_array<int32_t>({static_cast<std::size_t>(side * side * side), static_cast<std::size_t>(n)});
    nb::gil_scoped_release released;
    std::fill_n(rows.data(), rows.size(), -1);
    for (int64_t line = 0; line < side * side; ++line) {
        const int64_t shift = (line / side - radius) * plane + (line % side - radius) * width - radius;
        int32_t* out = rows.data() + line * side * n;
        int64_t start = 0;
        for (int64_t centre = 0; centre < n; ++centre) {
            const int64_t first = key[centre] + shift;
            while (start < n && key[start] < first) ++start;
            for (int64_t row = start; row < n && key[row] < first + side; ++row)
                out[(key[row] - first) * n + centre] = static_cast<int32_t>(row);
        }
    }
    return rows;
}

}  // namespace

void bind_voxels(nb::module_& m) {
    m.def(
        "neighbours", &neighbours, named("keys"), nb::arg("width"), nb::arg("plane"), nb::arg("radius"),
        "Rows ((2 radius + 1)^3, N) of the voxels at each offset of a cubic kernel, x fastest; -1 where there is none. "
        "Keys (N,) are sorted: x + width y + plane z.");
}
